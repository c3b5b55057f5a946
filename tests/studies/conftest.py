"""Results of earlier studies, as small as they can be, for those that compare what others found."""

from __future__ import annotations

import shutil
from itertools import product
from pathlib import Path

import pandas as pd
import pytest

import snakebench as sb
from snakebench.store import write_manifest, write_table

POLICIES = Path(__file__).parents[2] / "results" / "teacher_student" / "policies"
GAIT = {"amplitude": 3.5, "frequency": 0.7, "phase": 0.84}
FLUIDS = ("water", "oil1", "oil2", "integrated")


def gait(tuned_to: str, stronger: float = 1.0) -> dict[str, float]:
    """A gait of its own for each fluid."""
    slower = 0.05 * FLUIDS.index(tuned_to)
    return {"amplitude": GAIT["amplitude"] * stronger, "frequency": GAIT["frequency"] - slower, "phase": GAIT["phase"]}


def write_sinusoids(directory: Path) -> None:
    """Fronts of two points: a slow gait and a fast one, and one that is faster still but beyond the reference."""
    rows = [
        {"space": space, "front": fluid, "speed": speed, "power": power, **gait(fluid, stronger)}
        for space, fluid in product(("paper", "extended"), FLUIDS)
        for speed, power, stronger in ((0.1, 2.0, 0.5), (0.3, 8.0, 1.0), (0.4, 31.0, 1.1))
    ]
    write_table(directory / "fronts.csv", pd.DataFrame(rows))


def write_sea_snakes(directory: Path) -> None:
    """Of each objective two seeds, the second of higher return."""
    rows = [
        {"objective": "mean" if fluid == "integrated" else fluid, "seed": seed, "variant": variant}
        | {"return": 10.0 + seed, **gait(fluid, 0.2 + 0.05 * seed)}
        for fluid, seed, variant in product(FLUIDS, (0, 1), ("searched", "finer step"))
    ]
    write_table(directory / "optima.csv", pd.DataFrame(rows))


def write_waveforms(directory: Path) -> None:
    """Of each fluid waveforms of one and of two harmonics; those of two are of higher return."""
    optima = [
        {"tuned_to": fluid, "harmonics": harmonics, "objective": "return", "seed": 0, "variant": "searched"}
        | {"return": float(harmonics)}
        for fluid, harmonics in product(FLUIDS, (1, 2))
    ]
    gaits = [
        {key: row[key] for key in ("tuned_to", "harmonics", "objective", "seed")}
        | {"frequency": 0.5, "joint": joint, "harmonic": harmonic}
        | {"cosine": 0.1 * joint / harmonic, "sine": 0.02 * row["harmonics"]}
        for row in optima
        for joint, harmonic in product(range(1, 8), range(1, row["harmonics"] + 1))
    ]
    write_table(directory / "optima.csv", pd.DataFrame(optima))
    write_table(directory / "gaits.csv", pd.DataFrame(gaits))


def write_policies(directory: Path) -> None:
    """Three of the published policies."""
    (directory / "policies").mkdir()
    for name in ("student-0", "student-1", "teacher-0"):
        shutil.copy(POLICIES / f"{name}.safetensors", directory / "policies")


WRITERS = {
    "pareto": write_sinusoids,
    "sea_snake": write_sea_snakes,
    "fourier": write_waveforms,
    "teacher_student": write_policies,
}


@pytest.fixture
def write_found():
    """Writes the results of the studies named, or of all, into a directory, and returns it."""

    def write(results: Path, *names: str) -> Path:
        for name in names or WRITERS:
            (results / name).mkdir(parents=True)
            WRITERS[name](results / name)
            write_manifest(results / name, {"commit": "abc"})
        return results

    return write


@pytest.fixture(scope="module")
def found(tmp_path_factory) -> Path:
    """A results directory with what four studies found."""
    results = tmp_path_factory.mktemp("found")
    for name, write in WRITERS.items():
        (results / name).mkdir()
        write(results / name)
        write_manifest(results / name, {"commit": "abc"})
    return results


@pytest.fixture
def sinusoid():
    """The sinusoidal torque gait that is the fastest within the reference for a fluid."""
    return lambda tuned_to: sb.SinusoidalTorque(**gait(tuned_to))
