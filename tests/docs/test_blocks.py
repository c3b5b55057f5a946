"""What README, CONTRIBUTING and docs tell their reader to type works: every code block is executed.

A page is one reader: its blocks run in order, in one directory that has the committed results beside it; its Python
shares one namespace. A TOML, Python or C block that begins with the name of a file becomes that file. Text
right after a Python block is what that prints.

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
from contextlib import ExitStack, redirect_stdout
from io import StringIO
from itertools import pairwise
from pathlib import Path

import pytest

from snakebench.cli import main
from snakebench.fluid import FLUIDS
from snakebench.registry import VARIABLE

ROOT = Path(__file__).parents[2]
PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").rglob("*.md"))]
FENCE = re.compile(r"^```(.*?)\n(.*?)^```$", flags=re.DOTALL | re.MULTILINE)
RECIPE = re.compile(r"(?:# |<!-- )(?:snakebench/)?studies/")
NAMED = re.compile(r"# (\w+\.(?:toml|py))\n")
EXTRAS = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["optional-dependencies"]
TOX = (ROOT / "tox.ini").read_text()
CHECK = """
from pathlib import Path
from snakebench.studies.running import study_config
from snakebench.studies.config import study_profiles, study_settings
path = Path("{path}")
for profile in study_profiles(path):
    study_config(study_settings(path, profile))
"""
PROFILED = re.compile(r"snakebench (run-study|reproduce|pareto) ")
COMPARED = ("teacher_student", "pareto", "sea_snake")  # what the smoke profiles of comparisons read, in profile smoke
SLOW = re.compile(
    r"(\w+=\S+ )*(dask|snakebench (run-study|pareto|reproduce|report|bench|limit|score|leaderboard))\b"
)  # seconds to minutes
HERE = re.compile(r"snakebench [^|<>=$*]+$")  # needs no shell, and so no process
READY = {"scheduler": "Scheduler at", "worker": "Registered to"}  # what a server of Dask says at last
LOOKED_UP = {  # commands that are not run, and what must be true of their words
    "python3.11": lambda words: words[1:3] == ["-m", "venv"],
    "apt-get": lambda words: True,
    "pip": lambda words: (
        {extra for w in words for e in re.findall(r"\[(.+)\]", w) for extra in e.split(",")} <= {*EXTRAS}
    ),
    "tox": lambda words: all(f"[testenv:{name}]" in TOX for name in words[2:]),
    **dict.fromkeys(("pytest", "ruff", "mypy", "lint-imports"), lambda words: words[0] in TOX),
    "tensorboard": lambda words: words[0] in str(EXTRAS),
    "optuna-dashboard": lambda words: words[1] == "sqlite:///studies.db",
}


def blocks(page: Path) -> list[tuple[str, str]]:
    """Language and content of every code block; directives are Sphinx's to check, a recipe's files `test_recipe`'s."""
    found = [(kind, content) for kind, content in FENCE.findall(page.read_text()) if not kind.startswith("{")]
    return [(kind, content) for kind, content in found if not RECIPE.match(content)]


def commands(content: str) -> list[str]:
    """The commands of a block, without comments and without where this machine has its environment."""
    typed = (line.split("  #")[0].replace(".venv/bin/", "").strip() for line in content.splitlines())
    return [command for line in typed if line for command in line.split(" && ")]


def has_slow(page: Path) -> bool:
    return any(SLOW.match(command) for kind, content in blocks(page) if kind == "sh" for command in commands(content))


class Reader:
    """Someone who types what a page says, in a directory of their own; without patience, only what takes seconds."""

    def __init__(self, here: Path, patch: pytest.MonkeyPatch, stack: ExitStack, patient: bool) -> None:
        self.here, self.patch, self.stack, self.patient = here, patch, stack, patient
        self.names = {"__name__": "__main__"}
        known = dict(FLUIDS)
        stack.callback(lambda: [FLUIDS.pop(name) for name in set(FLUIDS) - set(known)])  # which studies have named
        patch.chdir(here)
        smaller = {f"results/{study}-smoke": f"results/{study}" for study in COMPARED}
        for there, name in {
            **{name: name for name in ("examples", "studies", "results", "leaderboard")},
            **smaller,
        }.items():
            hidden = shutil.ignore_patterns(".*")
            shutil.copytree(ROOT / name, here / there, copy_function=os.symlink, ignore=hidden)
        with socket.socket() as free:
            free.bind(("127.0.0.1", 0))
            self.port = free.getsockname()[1]

    def python(self, content: str) -> None:
        if named := NAMED.match(content):
            (self.here / named[1]).write_text(content)
        else:
            with redirect_stdout(StringIO()) as printed:
                exec(compile(content, "block", "exec"), self.names)
            self.printed = printed.getvalue()

    def toml(self, content: str) -> None:
        named = NAMED.match(content)
        path = self.here / (named[1] if named else "block.toml")
        path.write_text(content)
        if "method" in tomllib.loads(content):
            if VARIABLE in os.environ:  # a plug-in would stay
                self._run(f"python -c '{CHECK.format(path=path)}'")
            else:
                exec(CHECK.format(path=path), {})

    def c(self, content: str) -> None:
        (self.here / re.match(r"/\* (\w+\.c) \*/\n", content)[1]).write_text(content)

    def text(self, content: str) -> None:
        """Output, or a picture."""

    mermaid = text

    def sh(self, content: str) -> None:
        for command in commands(content):
            words = shlex.split(command)
            if words[0] == "export":
                self.patch.setenv(*words[1].split("="))
            elif words[0] == "cc" and shutil.which("cc") is None:
                pytest.skip("no C compiler (cc) on the PATH: the rest of the page is not tried")
            elif words[0] in LOOKED_UP:
                assert LOOKED_UP[words[0]](words), command
            elif self.patient or not SLOW.match(command):
                self._serve(command, words[1]) if words[0] == "dask" else self._run(command)

    def _run(self, command: str) -> None:
        if PROFILED.match(f"{command} "):
            command = re.sub(r" --profile \w+", "", command) + " --profile smoke"
        if HERE.match(command) and not SLOW.match(command) and VARIABLE not in os.environ:  # which would stay
            self.patch.setattr("sys.argv", shlex.split(command))
            main()
            return
        done = subprocess.run(**self._shell(command), capture_output=True, text=True, timeout=1800)
        assert done.returncode == 0, f"{command}\n{done.stdout}{done.stderr}"

    def _serve(self, command: str, role: str) -> None:
        own, log = f" --host 127.0.0.1 --port {self.port}" if role == "scheduler" else "", self.here / f"{role}.log"
        with log.open("w") as out:
            process = subprocess.Popen(**self._shell(f"exec {command}{own}"), stdout=out, stderr=out)
        self.stack.callback(process.wait)
        self.stack.callback(process.terminate)
        end = time.monotonic() + 120
        while READY[role] not in log.read_text():
            assert process.poll() is None and time.monotonic() < end, log.read_text()
            time.sleep(0.1)

    def _shell(self, command: str) -> dict[str, object]:
        path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
        here = command.replace("HOST:8786", f"127.0.0.1:{self.port}")
        return {"args": ["bash", "-c", here], "cwd": self.here, "env": os.environ | {"PATH": path}}


def read(page: Path, here: Path, patient: bool = False) -> None:
    """Do what a page says, with or without what is slow."""
    with pytest.MonkeyPatch.context() as patch, ExitStack() as stack:
        reader = Reader(here, patch, stack, patient)
        for (before, _), (language, content) in pairwise([("", ""), *blocks(page)]):
            getattr(reader, language)(content)
            assert (before, language) != ("python", "text") or content in reader.printed


def name(page: Path) -> str:
    return str(page.relative_to(ROOT))


@pytest.mark.parametrize("page", [page for page in PAGES if blocks(page)], ids=name)
def test_what_a_page_says_works(tmp_path, page):
    read(page, tmp_path)


@pytest.mark.slow
@pytest.mark.parametrize("page", [page for page in PAGES if has_slow(page)], ids=name)
def test_what_a_page_says_works_to_the_last_command(tmp_path, page):
    read(page, tmp_path, patient=True)


def test_no_block_is_overlooked():
    kinds = [kind for page in PAGES for kind, _ in blocks(page)]
    built = sum(bool(RECIPE.match(content)) for page in PAGES for _, content in FENCE.findall(page.read_text()))
    fences, directives = (
        sum(len(re.findall(sign, page.read_text(), re.MULTILINE)) for page in PAGES) for sign in (r"^\s*```", r"^```\{")
    )
    assert fences == 2 * (len(kinds) + directives + built)
    assert built == 8  # the files of a study, which `test_recipe` builds
    assert set(kinds) == {"python", "sh", "toml", "text", "mermaid", "c"}
    assert len(kinds) >= 49
