"""Fixtures shared by the tests: the calibration gait, the command line, and a look at a study that runs elsewhere."""

from __future__ import annotations

import signal
import sqlite3
import subprocess
import time
from contextlib import closing
from functools import cache
from pathlib import Path

import pytest
from hypothesis import settings

import snakebench as sb

settings.register_profile("shared machine", deadline=None)
settings.load_profile("shared machine")
signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell's background job ignores it; children inherit that

CALIBRATION = sb.SinusoidalTorque(amplitude=3.5, frequency=0.70, phase=0.84)


@cache
def _calibration_run(fluid: str, physics_rate: int, diameter: float) -> sb.Trajectory:
    return sb.simulate(CALIBRATION, fluid=fluid, physics_rate=physics_rate, robot=sb.Robot(diameter=diameter))


@pytest.fixture
def calibration_run():
    """The calibration gait's trajectory: `calibration_run(fluid, physics_rate, diameter)`."""

    def run(fluid: str, physics_rate: int = 480, diameter: float = 0.10) -> sb.Trajectory:
        return _calibration_run(fluid, physics_rate, diameter)

    return run


@pytest.fixture
def snakebench_command(monkeypatch, capsys, tmp_path):
    """Run the command line in this process and in an empty directory: returns exit code, standard output and error."""
    from snakebench.cli import main

    monkeypatch.chdir(tmp_path)

    def run(*words: str) -> tuple[int, str, str]:
        monkeypatch.setattr("sys.argv", ["snakebench", *words])
        code = 0
        try:
            main()
        except SystemExit as stop:
            code = int(stop.code or 0)
        printed = capsys.readouterr()
        return code, printed.out, printed.err

    return run


@pytest.fixture
def evaluated():
    """How many evaluations the cache of a directory's results holds; whoever writes it is not disturbed."""
    return _evaluated


@pytest.fixture
def wait_for():
    """Returns once a study that runs in a directory has evaluated so much; it must not end before."""

    def wait(process: subprocess.Popen[str], directory: Path, count: int) -> None:
        while _evaluated(directory) < count and process.poll() is None:
            time.sleep(0.02)
        assert process.poll() is None, process.communicate()[1]

    return wait


def _evaluated(directory: Path) -> int:
    path = directory / "results" / ".cache" / "evaluations.sqlite"
    try:
        with closing(sqlite3.connect(f"file:{path}?mode=ro", uri=True)) as database:
            return int(database.execute("SELECT count(*) FROM evaluations").fetchone()[0])
    except sqlite3.Error:
        return 0
