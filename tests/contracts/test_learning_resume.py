"""A study that learns, stopped and continued: the same bytes, and nobody is left learning."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time

import pytest

pytestmark = pytest.mark.slow

STUDY = """
question = "Does learning continue?"
method = "teacher_student"
fluids = ["water"]
profile = "tiny"
viscosities = 2
published = ["teacher", "student"]
[policies.teacher]
[policies.memoryless]
lstm = []
[policies.student]
teacher = "teacher"
[profiles.tiny]
duration = 1.0
seeds = [0]
training = { steps = 12_000, members = 8, rollout = 24, checkpoints = 12 }
distillation = { iterations = 60, members = 8, rollout = 20, handover = 20, checkpoints = 12 }
"""


def start(directory, workers=2):
    directory.mkdir(exist_ok=True)
    (directory / "tiny.toml").write_text(STUDY)
    command = [sys.executable, "-m", "snakebench.cli", "run-study", "tiny.toml", "--workers", str(workers)]
    return subprocess.Popen(
        command, cwd=directory, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True
    )


def rows(directory):
    logs = (directory / "results" / ".cache" / "training").glob("*/log.csv")
    return sum(max(len(log.read_text().splitlines()) - 1, 0) for log in logs)


def wait_for(process, directory, count):
    while rows(directory) < count and process.poll() is None:
        time.sleep(0.02)
    assert process.poll() is None, process.communicate()[1]


def outcome(directory):
    files = [path for path in (directory / "results" / "tiny").rglob("*.*") if path.name != "manifest.json"]
    assert len(files) > 5
    return {path.name: path.read_bytes() for path in files}


def wait_until_gone(group):
    """Returns once the last worker of a process group has ended."""
    for _ in range(300):
        try:
            os.killpg(group, 0)
        except ProcessLookupError:
            return
        time.sleep(0.1)
    pytest.fail("somebody is still learning")


def test_a_study_that_learns_goes_on_after_kill_and_interrupt_with_the_same_bytes(tmp_path):
    whole = start(tmp_path / "whole", workers=1)
    _, err = whole.communicate(timeout=600)
    assert whole.returncode == 0, err
    assert "student 0: 100%" in err and " to go" in err
    stopped = tmp_path / "stopped"
    for count, stop in ((3, signal.SIGKILL), (9, signal.SIGINT), (28, signal.SIGKILL)):
        process = start(stopped)
        wait_for(process, stopped, count)
        os.killpg(process.pid, stop)
        _, err = process.communicate(timeout=60)
        if stop == signal.SIGINT:
            assert process.returncode == 130 and "Traceback" not in err
            assert "same command continues" in err.splitlines()[-1]
        wait_until_gone(process.pid)
        assert not (stopped / "results" / "tiny" / "manifest.json").exists()
    last = start(stopped)
    _, err = last.communicate(timeout=600)
    assert last.returncode == 0, err
    assert outcome(stopped) == outcome(tmp_path / "whole")
