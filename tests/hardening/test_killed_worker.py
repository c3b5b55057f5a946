"""A worker process that is killed, as by the system when memory runs out, ends a study in one line; it continues."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import psutil
import pytest

from snakebench.errors import WorkersLost
from snakebench.execution import Evaluator
from snakebench.store import EvaluationCache
from snakebench.workers import open_workers

LINE = "a worker process was killed, as happens when memory runs out; what was evaluated is kept, the same command"
STUDY = """
question = "Does it survive?"
method = "pareto"
fluids = ["water", "oil2"]
profile = "tiny"
[profiles.tiny]
engine = "planar"
grid = [6, 4, 3]
seeds = [0]
duration = 6.0
periods = 1
"""


def start(directory: Path) -> subprocess.Popen[str]:
    (directory / "tiny.toml").write_text(STUDY)
    command = [sys.executable, "-m", "snakebench.cli", "run-study", "tiny.toml", "--workers", "2"]
    return subprocess.Popen(command, cwd=directory, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)


def workers(process: psutil.Process) -> list[psutil.Process]:
    """loky's worker processes."""
    children = process.children(recursive=True)
    alive = [child for child in children if child.status() != psutil.STATUS_ZOMBIE]
    return [child for child in alive if any("popen_loky" in word for word in child.cmdline())]


@pytest.fixture
def evaluator(tmp_path):
    with open_workers(2) as crew, EvaluationCache(tmp_path, print) as cache:
        yield Evaluator(cache, crew)


def _die(_: int) -> None:
    os.kill(os.getpid(), signal.SIGKILL)


@pytest.mark.slow
def test_a_killed_worker_is_one_line_and_the_same_command_ends_with_the_same_tables(
    tmp_path, wait_for, evaluated, contents
):
    whole, broken = tmp_path / "whole", tmp_path / "broken"
    for directory in (whole, broken):
        directory.mkdir()
    undisturbed = start(whole)
    undisturbed.communicate(timeout=300)
    assert undisturbed.returncode == 0 and contents(whole)
    process = start(broken)
    wait_for(process, broken, 10)
    crew = workers(psutil.Process(process.pid))
    crew[0].kill()
    out, err = process.communicate(timeout=60)
    assert (process.returncode, out) == (2, "") and "Traceback" not in err
    assert err.splitlines()[-1] == f"snakebench: {LINE} continues"
    assert not psutil.wait_procs(crew, timeout=10)[1]
    assert evaluated(broken) >= 10
    again = start(broken)
    again.communicate(timeout=300)
    assert again.returncode == 0 and contents(broken / "results") == contents(whole / "results")


def test_a_worker_killed_while_it_learns_is_one_line(evaluator):
    with pytest.raises(WorkersLost, match=LINE):
        list(evaluator.compute(_die, [(1,), (2,)]))


def test_a_worker_killed_between_tasks_is_one_line(evaluator):
    assert list(evaluator.compute(abs, [(-1,), (-2,)])) == [1, 2]
    for one in workers(psutil.Process()):
        one.kill()
    time.sleep(0.5)
    with pytest.raises(WorkersLost, match=LINE):
        list(evaluator.compute(abs, [(-1,), (-2,)]))
