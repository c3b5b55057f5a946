"""A study ends with the same bytes however many workers it has and however often it is stopped."""

from __future__ import annotations

import os
import random
import shutil
import signal
import subprocess
import sys
import time
from contextlib import suppress
from pathlib import Path

import psutil
import pytest

from snakebench.studies.config import study_path, study_settings
from snakebench.studies.running import run_study, study_config

ANY = """
question = "Does it continue?"
fluids = ["water", "oil2"]
profile = "tiny"
[profiles.tiny]
"""
STUDIES = {
    "sea_snake": """
method = "sea_snake"
seeds = [0, 1]
duration = 1.0
trials = 8
batch = 4
""",
    "pareto": """
method = "pareto"
seeds = [0, 1]
duration = 2.0
search = "both"
engine = "planar"
grid = [3, 3, 3]
population = 4
generations = 3
periods = 1
""",
    "fourier": """
method = "fourier"
seeds = [0, 1]
duration = 2.0
harmonics = [1]
prices = [0.05]
trials = 12
price_trials = 12
population = 6
periods = 1
""",
    "limit": """
method = "limit"
robot = { lengths = [0.28, 0.44, 0.44, 0.32], masses = [1.0, 1.5, 1.5, 1.2] }
duration = 10.0
viscosities = 0
powers = [0.5, 1.0]
anchors = [1.0]
shown = 1.0
currencies = ["net"]
waves = 0
bounds = { policies = { target = 1.0 }, held = { target = 1.0, held = true, powers = [1.0] } }
starts = { thin = { kind = "sea-snake", amplitude = 1.2, frequency = 0.9, phase = 0.5 } }
""",
}
TABLES = {
    "sea_snake": {"trials.csv", "optima.csv", "water-water.npz", "mean-oil2.npz"},
    "pareto": {
        "grid.csv",
        "verified.csv",
        "fronts.csv",
        "switching.csv",
        "indicators.csv",
        "growth.csv",
        "attainment.csv",
    },
    "fourier": {"optima.csv", "gaits.csv", "fronts.csv", "switching.csv", "growth.csv"},
    "limit": {"limit.csv", "replays.csv", "gaits.csv", "solutions.csv"},
}
FEWEST = 30  # different evaluations that each of them makes at least
MOMENTS = {"sea_snake": 20, "pareto": 15, "fourier": 15, "limit": 4}  # at which they are killed in a long test


def start(directory: Path, method: str, *, workers: int) -> subprocess.Popen[str]:
    """The study by the command line, in processes of its own that a test may stop."""
    write(directory, method)
    command = [sys.executable, "-m", "snakebench.cli", "run-study", "tiny.toml", "--workers", str(workers)]
    return subprocess.Popen(
        command, cwd=directory, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True
    )


def write(directory: Path, method: str, name: str = "tiny") -> Path:
    directory.mkdir(exist_ok=True)
    path = directory / f"{name}.toml"
    path.write_text(ANY + STUDIES[method])
    return path


def finish(directory: Path, method: str, *, workers: int, name: str = "tiny") -> None:
    """The study from this process, to its end."""
    settings = study_settings(study_path(str(write(directory, method, name))))
    run_study(study_config(settings), directory / "results", workers)


def outcome(directory: Path, name: str = "tiny") -> dict[str, bytes]:
    """Every table and trajectory by its path; the manifest, which tells the time and machine, is left out."""
    results = directory / "results" / name
    files = [path for path in results.rglob("*") if path.is_file() and path.name != "manifest.json"]
    return {str(path.relative_to(results)): path.read_bytes() for path in files}


@pytest.fixture(
    scope="module",
    params=["sea_snake", *(pytest.param(name, marks=pytest.mark.slow) for name in ("pareto", "fourier", "limit"))],
)
def finished(request, tmp_path_factory) -> tuple[str, Path]:
    """A study, and the directory where one worker ran it in one go."""
    directory = tmp_path_factory.mktemp("uninterrupted")
    finish(directory, request.param, workers=1)
    return request.param, directory


@pytest.fixture(scope="module")
def uninterrupted(finished) -> tuple[str, dict[str, bytes]]:
    """A study, and what it leaves behind then."""
    method, directory = finished
    return method, outcome(directory)


def test_a_study_leaves_its_tables(uninterrupted):
    method, tables = uninterrupted
    assert {Path(name).name for name in tables} >= TABLES[method]
    assert all(content.count(b"\n") > 1 for name, content in tables.items() if name.endswith(".csv"))


@pytest.mark.parametrize("workers", [2, pytest.param(4, marks=pytest.mark.slow)])
def test_more_workers_give_the_same_bytes(uninterrupted, tmp_path, workers):
    method, tables = uninterrupted
    finish(tmp_path, method, workers=workers)
    assert outcome(tmp_path) == tables


@pytest.mark.slow
def test_killed_at_random_moments_and_resumed_gives_the_same_bytes(uninterrupted, tmp_path, wait_for, evaluated):
    method, tables = uninterrupted
    moments = sorted(random.Random(method).sample(range(1, FEWEST), 2))
    for count in moments:
        process = start(tmp_path, method, workers=2)
        wait_for(process, tmp_path, count)
        os.killpg(process.pid, signal.SIGKILL)
        process.communicate()
        assert not list((tmp_path / "results" / "tiny").glob("*.csv"))
    assert evaluated(tmp_path) >= moments[-1]
    finish(tmp_path, method, workers=2)
    assert outcome(tmp_path) == tables, f"killed after {moments} evaluations"


@pytest.mark.slow
def test_killed_whenever_it_may_be_and_resumed_each_time_gives_the_same_bytes(uninterrupted, tmp_path):
    """Kills from before the first evaluation to the writing of tables and page, each of a study begun anew."""
    method, tables = uninterrupted
    moments = random.Random(f"{method} 1")
    begun = time.monotonic()
    process = start(tmp_path / "timed", method, workers=2)
    _, err = process.communicate(timeout=300)
    assert process.returncode == 0, err
    whole, landed = time.monotonic() - begun, 0
    for k in range(MOMENTS[method]):
        directory = tmp_path / str(k)
        process = start(directory, method, workers=2)
        moment = moments.uniform(0, whole)
        with suppress(subprocess.TimeoutExpired):
            process.wait(moment)
        landed += process.poll() is None
        with suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)
        process.communicate()
        finish(directory, method, workers=1)
        assert outcome(directory) == tables, f"killed after {moment} s"
    print(f"{method}: {landed} of {MOMENTS[method]} kills landed while it was running")
    assert landed > MOMENTS[method] / 2


@pytest.mark.parametrize(
    ("send", "number", "code"),
    [
        pytest.param(os.killpg, signal.SIGINT, 130, id="interrupted with its workers"),  # as a terminal does
        pytest.param(os.kill, signal.SIGTERM, 143, id="terminated alone", marks=pytest.mark.slow),  # as a system does
    ],
)
def test_an_interrupt_keeps_what_was_evaluated_and_says_how_to_continue(
    uninterrupted, tmp_path, wait_for, evaluated, send, number, code
):
    method, tables = uninterrupted
    process = start(tmp_path, method, workers=2)
    wait_for(process, tmp_path, 10)
    workers = psutil.Process(process.pid).children(recursive=True)
    send(process.pid, number)
    out, err = process.communicate(timeout=60)
    assert process.returncode == code, err
    assert not psutil.wait_procs(workers, timeout=10)[1]
    assert out == "" and "Traceback" not in err
    assert "interrupted" in err.splitlines()[-1] and "same command continues" in err.splitlines()[-1]
    assert evaluated(tmp_path) >= 10
    finish(tmp_path, method, workers=1)
    assert outcome(tmp_path) == tables


def test_a_finished_study_is_answered_from_the_cache(finished, tmp_path, evaluated):
    method, directory = finished
    shutil.copytree(directory / "results" / ".cache", tmp_path / "results" / ".cache")
    held = evaluated(tmp_path)
    assert held >= FEWEST
    finish(tmp_path, method, workers=1)
    assert evaluated(tmp_path) == held
    assert outcome(tmp_path) == outcome(directory)


def test_two_processes_do_not_write_the_same_results(tmp_path, wait_for):
    first = start(tmp_path, "sea_snake", workers=1)
    wait_for(first, tmp_path, 1)
    os.killpg(first.pid, signal.SIGSTOP)  # it must not end before the other one has started
    second = start(tmp_path, "sea_snake", workers=1)
    out, err = second.communicate(timeout=60)
    os.killpg(first.pid, signal.SIGCONT)
    _, first_err = first.communicate(timeout=300)
    assert (second.returncode, out) == (2, "")
    assert "is being written by another snakebench" in err and err.count("\n") == 1
    assert first.returncode == 0, first_err


@pytest.mark.slow
def test_two_studies_may_share_a_results_directory(uninterrupted, tmp_path, wait_for):
    method, tables = uninterrupted
    other = start(tmp_path, method, workers=1)
    wait_for(other, tmp_path, 1)
    finish(tmp_path, method, workers=1, name="beside")
    _, err = other.communicate(timeout=300)
    assert other.returncode == 0, err
    assert outcome(tmp_path) == outcome(tmp_path, "beside") == tables
