"""The pages for learners and on dashboards are true: their blocks run, and so do the examples."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PAGES = ("learners.md", "dashboards.md")
COMMANDS = {**os.environ, "PATH": f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"}
TINY = {"plain_ppo.py": ("--steps", "64"), "mo_swim.py": ("--steps", "200")}


def blocks(language):
    pages = {page: (ROOT / "docs" / page).read_text() for page in PAGES}
    found = [
        (page, block) for page in PAGES for block in re.findall(rf"```{language}\n(.*?)```", pages[page], re.DOTALL)
    ]
    return [pytest.param(block, id=f"{page}-{k}") for k, (page, block) in enumerate(found)]


@pytest.mark.parametrize("block", blocks("python"))
def test_python_blocks_run(block, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    exec(compile(block, "block.py", "exec"), {"__name__": "__main__"})
    assert capsys.readouterr().out


@pytest.mark.parametrize("block", blocks("sh"))
def test_shell_blocks_run(block, tmp_path):
    done = subprocess.run(["sh", "-ec", block], cwd=tmp_path, env=COMMANDS, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


def test_every_example_is_tried():
    assert {path.name for path in (ROOT / "examples").glob("*.py")} == set(TINY)


@pytest.mark.parametrize("name", TINY)
def test_examples_run_and_print_what_they_found(name, tmp_path):
    command = [sys.executable, str(ROOT / "examples" / name), *TINY[name]]
    done = subprocess.run(command, cwd=tmp_path, env=COMMANDS, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    if name == "plain_ppo.py":
        rows = [line.split() for line in done.stdout.splitlines() if " ok " in line or " invalid " in line]
        assert [row[2] for row in rows] == ["water", "oil1", "oil2"] * 2
        assert rows[3][:2] == ["sea", "snake"] and float(rows[3][4]) == pytest.approx(0.205, abs=0.001)  # README
    else:
        assert re.search(r"20 waves.*are on the front\n(at .* m/J: .*\n){3}$", done.stdout)
