"""Fixtures shared by the tests: the calibration gait, the command line, a look at a study that runs elsewhere, what
earlier studies found, and the pages of the committed results.
"""

from __future__ import annotations

import os
import pickle
import shutil
import signal
import sqlite3
import subprocess
import time
from contextlib import closing
from functools import cache
from itertools import product
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from filelock import FileLock
from hypothesis import settings
from writing import write_manifest, write_table

import snakebench as sb
import snakebench.comparison.page
import snakebench.site
import snakebench.studies.config
import snakebench.studies.running
from snakebench.names import STUDIES
from snakebench.progress import Work
from snakebench.registry import load_plugins

os.environ.setdefault("OMP_NUM_THREADS", "1")  # of PyTorch, whose threads wait for each other more than they work
settings.register_profile("shared machine", deadline=None)
settings.load_profile("shared machine")
signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell's background job ignores it; children inherit that

load_plugins()  # those of this environment, and none that a test names in its own


def pytest_configure(config: pytest.Config) -> None:
    """Files go to pytest-xdist's workers in their order: first those of few but long tests, last the unit tests."""
    if hasattr(config.option, "loadscopereorder"):
        config.option.loadscopereorder = False


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


@pytest.fixture(scope="session")
def run_counted():
    """Run a study: returns where its results are, and what was done and expected whenever something was done."""

    def run(config: snakebench.studies.config.StudyConfig, results: Path) -> tuple[Path, list[tuple[int, int]]]:
        counted: list[tuple[int, int]] = []

        class Counting(Work):
            def advance(self, units: int = 1, seconds: float | None = None, found: bool = False) -> None:
                super().advance(units, seconds, found)
                counted.append((self._done, self._total))

        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(snakebench.studies.running, "Work", Counting)
            return snakebench.studies.running.run_study(config, results, workers=1), counted

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


@pytest.fixture(scope="session")
def published_reports(tmp_path_factory):
    """All pages of the committed results, written once for all of pytest-xdist's workers; nobody may change them."""
    shared = tmp_path_factory.getbasetemp()
    if "PYTEST_XDIST_WORKER" in os.environ:
        shared = shared.parent
    reports, unfinished = shared / "published_reports", shared / "unfinished_reports"
    with FileLock(shared / "published_reports.lock"):
        if not reports.exists():
            _write_published(unfinished)
            unfinished.rename(reports)
    return reports


def _write_published(reports: Path) -> None:
    """The pages, and what the index shows before it becomes HTML."""
    shown = []

    def index_page(*results):
        shown.append(snakebench.comparison.page.index_page(*results))
        return dict(shown[0])

    results = reports.with_name("results")  # without the studies that the user has run beside
    for name in (*STUDIES, "bench"):
        shutil.copytree(Path(__file__).parents[1] / "results" / name, results / name)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(snakebench.site, "index_page", index_page)
        snakebench.site.write_reports(results, reports, say=lambda _: None)
    (reports / "index.pickle").write_bytes(pickle.dumps(shown[0]))


@pytest.fixture(scope="session")
def published_index(published_reports):
    """What the index page of the committed results shows, before it becomes HTML."""
    return pickle.loads((published_reports / "index.pickle").read_bytes())


@pytest.fixture(scope="session")
def write_contenders():
    """Writes what four studies found, or those named, into a results directory, as small as it can be; returns it."""

    def write(results: Path, *names: str) -> Path:
        config = {"gait": "sinusoidal-torque", "robot": sb.Robot().model_dump(mode="json")}
        for name in names or _FOUND:
            (results / name).mkdir(parents=True)
            _FOUND[name](results / name)
            write_manifest(results / name, {"commit": "abc", "config": config})
        return results

    return write


@pytest.fixture(scope="session")
def gait_of():
    """The parameters of a gait of its own for each fluid and for all, and of a stronger or weaker one."""
    return _gait_of


_TUNED_TO = ("water", "oil1", "oil2", "integrated")


def _gait_of(tuned_to: str, stronger: float = 1.0) -> dict[str, float]:
    frequency = 0.7 - 0.05 * _TUNED_TO.index(tuned_to)
    return {"amplitude": 3.5 * stronger, "frequency": frequency, "phase": 0.84}


def _write_sinusoids(directory: Path) -> None:
    """Fronts of a slow gait, a fast one, and one that is faster still but takes more than the reference."""
    rows = [
        {"space": space, "front": tuned_to, "currency": "net", "speed": speed, "power": power}
        | _gait_of(tuned_to, stronger)
        for space, tuned_to in product(("paper", "extended"), _TUNED_TO)
        for speed, power, stronger in ((0.1, 2.0, 0.5), (0.3, 8.0, 1.0), (0.4, 31.0, 1.1))
    ]
    write_table(directory / "fronts.csv", pd.DataFrame(rows))


def _write_sea_snakes(directory: Path) -> None:
    """Of each objective the gaits of one seed, seed 1; what is verified does not count."""
    rows = [
        {"objective": "mean" if tuned_to == "integrated" else tuned_to, "seed": seed, "variant": variant}
        | {"return": value, **_gait_of(tuned_to, 0.2 + 0.05 * seed)}
        for tuned_to, (seed, variant, value) in product(_TUNED_TO, [(1, "searched", 11.0), (1, "finer step", 99.0)])
    ]
    write_table(directory / "optima.csv", pd.DataFrame(rows))


def _write_waveforms(directory: Path) -> None:
    """Of each fluid waveforms of one harmonic and of two, which are of higher return, and one found for less power."""
    optima = [
        {"tuned_to": tuned_to, "harmonics": harmonics, "objective": objective, "seed": 0, "variant": "searched"}
        | {"return": value}
        for tuned_to, (harmonics, objective, value) in product(
            _TUNED_TO, [(1, "return", 1.0), (2, "return", 2.0), (2, "price", 3.0)]
        )
    ]
    gaits = [
        {key: row[key] for key in ("tuned_to", "harmonics", "objective", "seed")}
        | {"frequency": _gait_of(row["tuned_to"])["frequency"], "joint": joint, "harmonic": harmonic}
        | {"price": np.nan, "cosine": -amplitude * np.sin(0.7 * joint), "sine": amplitude * np.cos(0.7 * joint)}
        for row in optima
        for joint, harmonic in product(range(1, 8), range(1, row["harmonics"] + 1))
        for amplitude in [0.4 * row["harmonics"] / harmonic**3]
    ]
    write_table(directory / "optima.csv", pd.DataFrame(optima))
    write_table(directory / "gaits.csv", pd.DataFrame(gaits))


def _write_policies(directory: Path) -> None:
    """Some of the published policies; a student in the place of a teacher, whose files the repository leaves out."""
    published = Path(__file__).parents[1] / "results" / "teacher_student" / "policies"
    (directory / "policies").mkdir()
    for name, file in (("student-0", "student-10"), ("student-1", "student-11"), ("teacher-0", "student-12")):
        shutil.copy(published / f"{file}.safetensors", directory / "policies" / f"{name}.safetensors")


_FOUND = {
    "pareto": _write_sinusoids,
    "sea_snake": _write_sea_snakes,
    "fourier": _write_waveforms,
    "teacher_student": _write_policies,
}
