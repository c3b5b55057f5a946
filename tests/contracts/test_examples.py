"""The examples run, and find what their pages say."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
COMMANDS = {**os.environ, "PATH": f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"}
TINY = {"plain_ppo.py": ("--steps", "64"), "mo_swim.py": ("--steps", "200")}
UNTRIED = {"cpg.py", "gain_schedule.py"}  # a plug-in: test_plugins.py; what it does: test_gain_schedule.py
UNTRIED |= {"evolution_strategy.py", "feedback_cpg.py", "mppi.py", "off_policy.py", "rma.py"}  # test_baselines.py
UNTRIED |= {"study_entries.py"}  # test_making.py


def test_every_example_is_tried():
    assert {path.name for path in (ROOT / "examples").glob("*.py")} == {*TINY, *UNTRIED}


@pytest.mark.parametrize("name", [pytest.param("plain_ppo.py", marks=pytest.mark.slow), "mo_swim.py"])
def test_examples_run_and_print_what_they_found(name, tmp_path):
    command = [sys.executable, str(ROOT / "examples" / name), *TINY[name]]
    done = subprocess.run(command, cwd=tmp_path, env=COMMANDS, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    if name == "plain_ppo.py":
        rows = [line.split() for line in done.stdout.splitlines() if " ok " in line or " invalid " in line]
        assert [row[2] for row in rows] == ["water", "oil1", "oil2"] * 2
        assert rows[3][:2] == ["sea", "snake"] and float(rows[3][4]) == pytest.approx(0.207, abs=0.001)  # learners.md
    else:
        assert re.search(r"20 waves.*are on the front\n(at .* m/J: .*\n){3}$", done.stdout)
