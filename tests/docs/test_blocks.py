"""What the README, CONTRIBUTING and docs tell their reader to type works: every code block is executed.

A page is one reader: its blocks run in order, in one directory that has the committed results beside it; its Python
shares one namespace. A TOML block that begins with the name of a file becomes that file.

Commands run as they stand, but for this: studies run in profile smoke, whatever profile is told; HOST and its port are
this machine's; `.venv/bin/` is the environment of the tests. What installs, checks the code or serves is looked up.
"""

from __future__ import annotations

import os
import re
import shlex
import shutil
import socket
import subprocess
import sys
import time
import tomllib
from contextlib import ExitStack
from pathlib import Path

import pytest

from snakebench.studies import study_config
from snakebench.studies.config import study_profiles, study_settings

ROOT = Path(__file__).parents[2]
PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").rglob("*.md"))]
FENCE = re.compile(r"^```(\S*)\n(.*?)^```$", flags=re.DOTALL | re.MULTILINE)
EXTRAS = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["optional-dependencies"]
INSTALLS = ("python3.11", "apt-get")
CHECKS = ("pytest", "ruff", "mypy", "lint-imports")  # CI runs them, by tox
SERVERS = ("tensorboard", "optuna-dashboard")
READY = {"dask scheduler": "Scheduler at", "dask worker": "Registered to"}  # servers that are started, and then say so
COMPARED = ("teacher_student", "pareto", "sea_snake")
PROFILED = ("run-study", "reproduce", "pareto")
SLOW = re.compile(r"dask|snakebench (run-study (?!quickstart$)|pareto|reproduce|report|bench)")  # minutes, not seconds


def blocks(page: Path) -> list[tuple[str, str]]:
    """Language and content of every code block; directives are Sphinx's to check."""
    found = FENCE.findall(page.read_text())
    return [(language, content) for language, content in found if not language.startswith("{")]


def commands(content: str) -> list[str]:
    """The commands of a block, without comments and without where this machine has its environment."""
    typed = (line.split("  #")[0].replace(".venv/bin/", "").strip() for line in content.splitlines())
    return [command for line in typed if line for command in line.split(" && ")]


def has_slow(page: Path) -> bool:
    return any(SLOW.match(command) for kind, content in blocks(page) if kind == "sh" for command in commands(content))


class Reader:
    """Someone who types what a page says, in a directory of their own."""

    def __init__(self, here: Path, stack: ExitStack, patient: bool) -> None:
        self.here, self.stack, self.patient, self.names = here, stack, patient, {"__name__": "__main__"}
        beside = {f"results/{study}-smoke": f"results/{study}" for study in COMPARED}  # what a smoke study compares
        for there, name in {"studies": "studies", "results": "results", **beside}.items():
            ignored = shutil.ignore_patterns(".*")
            shutil.copytree(ROOT / name, here / there, copy_function=os.symlink, ignore=ignored)
        (here / "constraints.txt").symlink_to(ROOT / "constraints.txt")
        with socket.socket() as free:
            free.bind(("127.0.0.1", 0))
            self.port = free.getsockname()[1]

    def python(self, content: str) -> None:
        exec(compile(content, "block", "exec"), self.names)

    def toml(self, content: str) -> None:
        named = re.match(r"# (\w+\.toml)\n", content)
        path = self.here / (named[1] if named else "block.toml")
        path.write_text(content)
        for profile in study_profiles(path) if "method" in tomllib.loads(content) else ():
            study_config(study_settings(path, profile))

    def text(self, content: str) -> None:
        """Output, or a picture."""

    def sh(self, content: str) -> None:
        for command in commands(content):
            if self.patient or not SLOW.match(command):
                self._type(command, shlex.split(command))

    def _type(self, command: str, words: list[str]) -> None:
        if words[0] in INSTALLS:
            return
        if words[0] == "pip":
            wanted = re.findall(r"\[([\w,]+)\]", command)
            assert {extra for group in wanted for extra in group.split(",")} <= EXTRAS.keys()
        elif words[0] in CHECKS:
            assert words[0] in (ROOT / "tox.ini").read_text()
        elif words[0] == "tox":
            assert not words[1:] or f"[testenv:{words[2]}]" in (ROOT / "tox.ini").read_text()
        elif words[0] in SERVERS:
            assert any(words[0] in package for extra in EXTRAS.values() for package in extra)
        elif " ".join(words[:2]) in READY:
            self._serve(command, READY[" ".join(words[:2])])
        else:
            self._run(command, profiled=words[0] == "snakebench" and words[1] in PROFILED)

    def _run(self, command: str, profiled: bool) -> None:
        if profiled:
            command = re.sub(r" --profile \w+", "", command) + " --profile smoke"
        done = subprocess.run(**self._shell(command), capture_output=True, text=True, timeout=1800)
        assert done.returncode == 0, f"{command}\n{done.stdout}{done.stderr}"

    def _serve(self, command: str, ready: str) -> None:
        own = f" --host 127.0.0.1 --port {self.port}" if "scheduler" in command else ""
        log = self.here / "server.log"
        with log.open("w") as out:
            process = subprocess.Popen(**self._shell(f"exec {command}{own}"), stdout=out, stderr=out)
        self.stack.callback(process.wait)
        self.stack.callback(process.terminate)
        for _ in range(600):
            if ready in log.read_text():
                return
            assert process.poll() is None, log.read_text()
            time.sleep(0.1)
        raise AssertionError(log.read_text())

    def _shell(self, command: str) -> dict[str, object]:
        path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
        here = command.replace("HOST:8786", f"127.0.0.1:{self.port}")
        return {"args": ["bash", "-c", here], "cwd": self.here, "env": os.environ | {"PATH": path}}


@pytest.fixture
def read(tmp_path, monkeypatch):
    """Do what a page says, with or without what is slow."""
    monkeypatch.chdir(tmp_path)
    with ExitStack() as stack:

        def follow(page: Path, patient: bool = False) -> None:
            reader = Reader(tmp_path, stack, patient)
            for language, content in blocks(page):
                getattr(reader, language)(content)

        yield follow


def name(page: Path) -> str:
    return str(page.relative_to(ROOT))


@pytest.mark.parametrize("page", [page for page in PAGES if blocks(page)], ids=name)
def test_what_a_page_says_works(read, page):
    read(page)


@pytest.mark.slow
@pytest.mark.parametrize("page", [page for page in PAGES if has_slow(page)], ids=name)
def test_what_a_page_says_works_to_the_last_command(read, page):
    read(page, patient=True)


def test_no_block_is_overlooked():
    texts = [page.read_text() for page in PAGES]
    kinds = [kind for page in PAGES for kind, _ in blocks(page)]
    fences, directives = (
        sum(len(re.findall(sign, text, flags=re.MULTILINE)) for text in texts) for sign in (r"^\s*```", r"^```\{")
    )
    assert fences == 2 * (len(kinds) + directives)
    assert set(kinds) == {"python", "sh", "toml", "text"}
    assert len(kinds) >= 49
