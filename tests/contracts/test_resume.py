"""A study ends with the same bytes however many workers it has and however often it is stopped."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

STUDY = """
question = "Does it continue?"
method = "sea_snake"
fluids = ["water", "oil2"]
profile = "tiny"
[profiles.tiny]
trials = 8
batch = 4
seeds = [0, 1]
duration = 2.0
"""
EVALUATIONS = 2 * 4 * (8 + 3)  # seeds, fluids of all objectives, trials and checks


def start(directory: Path, *, workers: int) -> subprocess.Popen[str]:
    directory.mkdir(exist_ok=True)
    (directory / "tiny.toml").write_text(STUDY)
    command = [sys.executable, "-m", "snakebench.cli", "run-study", "tiny.toml", "--workers", str(workers)]
    return subprocess.Popen(
        command, cwd=directory, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True
    )


def finish(directory: Path, *, workers: int) -> None:
    process = start(directory, workers=workers)
    _, err = process.communicate(timeout=300)
    assert process.returncode == 0, err


def outcome(directory: Path) -> dict[str, bytes]:
    """Every table and trajectory by its path; the manifest, which tells the time and machine, is left out."""
    files = [path for path in (directory / "results" / "tiny").rglob("*") if path.is_file()]
    return {str(path.relative_to(directory)): path.read_bytes() for path in files if path.name != "manifest.json"}


def evaluated(directory: Path) -> int:
    """How many evaluations the cache holds, seen from another process."""
    import sqlite3

    path = directory / "results" / ".cache" / "evaluations.sqlite"
    try:
        with sqlite3.connect(f"file:{path}?mode=ro", uri=True) as database:
            return int(database.execute("SELECT count(*) FROM evaluations").fetchone()[0])
    except sqlite3.Error:
        return 0


def wait_for(directory: Path, process: subprocess.Popen[str], count: int) -> None:
    while evaluated(directory) < count and process.poll() is None:
        time.sleep(0.02)
    assert process.poll() is None, "the study ended before it could be stopped"


@pytest.fixture(scope="module")
def uninterrupted(tmp_path_factory) -> dict[str, bytes]:
    directory = tmp_path_factory.mktemp("uninterrupted")
    finish(directory, workers=1)
    return outcome(directory)


def test_a_study_leaves_its_tables(uninterrupted):
    assert {Path(name).name for name in uninterrupted} >= {
        "trials.csv",
        "optima.csv",
        "water-water.npz",
        "mean-oil2.npz",
    }
    assert uninterrupted["results/tiny/trials.csv"].count(b"\n") == 1 + 2 * 4 * 8


def test_two_workers_give_the_same_bytes(uninterrupted, tmp_path):
    finish(tmp_path, workers=2)
    assert outcome(tmp_path) == uninterrupted


def test_killed_and_resumed_gives_the_same_bytes(uninterrupted, tmp_path):
    for count in (5, 25):
        process = start(tmp_path, workers=2)
        wait_for(tmp_path, process, count)
        os.killpg(process.pid, signal.SIGKILL)
        process.communicate()
        assert not (tmp_path / "results" / "tiny" / "trials.csv").exists()
    before = evaluated(tmp_path)
    assert before >= 25
    finish(tmp_path, workers=2)
    assert outcome(tmp_path) == uninterrupted


@pytest.mark.parametrize("workers", [1, 2])
def test_an_interrupt_keeps_what_was_evaluated_and_says_how_to_continue(uninterrupted, tmp_path, workers):
    process = start(tmp_path, workers=workers)
    wait_for(tmp_path, process, 10)
    os.killpg(process.pid, signal.SIGINT)  # as a terminal does: to the workers as well
    out, err = process.communicate(timeout=60)
    assert process.returncode == 130
    assert out == "" and "Traceback" not in err
    assert "interrupted" in err.splitlines()[-1] and "same command continues" in err.splitlines()[-1]
    assert evaluated(tmp_path) >= 10
    finish(tmp_path, workers=workers)
    assert outcome(tmp_path) == uninterrupted


def test_a_finished_study_is_answered_from_the_cache(tmp_path):
    finish(tmp_path, workers=1)
    held, tables = evaluated(tmp_path), outcome(tmp_path)
    finish(tmp_path, workers=1)
    assert evaluated(tmp_path) == held <= EVALUATIONS
    assert outcome(tmp_path) == tables
