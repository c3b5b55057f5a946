"""A physics constant that is off by a few per cent is found by a test of the physics, not only by published numbers."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path
from typing import NamedTuple

import pytest

pytestmark = pytest.mark.slow

ROOT = Path(__file__).parents[2]
TESTS = ("tests/unit", "tests/physics")


class Mutation(NamedTuple):
    """One changed number."""

    file: str
    right: str
    wrong: str


MUTATIONS = {
    "added mass": Mutation("physics/hydrodynamics.py", "C_A = 0.011514", "C_A = 0.012"),
    "tangential pressure drag": Mutation("physics/hydrodynamics.py", "C_F = 0.022556", "C_F = 0.0237"),
    "viscous drag": Mutation("physics/hydrodynamics.py", "C_MU = 0.31584", "C_MU = 0.325"),
    "boundary layer": Mutation("physics/hydrodynamics.py", "C_NU = 1.0612", "C_NU = 1.1"),
    "drag fit, curvature": Mutation("physics/hydrodynamics.py", "= 0.039276, -0.43683", "= 0.0405, -0.43683"),
    "drag fit, slope": Mutation("physics/hydrodynamics.py", "-0.43683, 0.91538", "-0.4500, 0.91538"),
    "Lamb form": Mutation("physics/hydrodynamics.py", "C_1, C_2 = 1.36759", "C_1, C_2 = 1.42"),
    "head shape": Mutation("physics/hydrodynamics.py", "P_4, P_5 = 2.9302, 2.8501", "P_4, P_5 = 3.0, 2.8501"),
    "tail shape": Mutation("physics/hydrodynamics.py", "P_4, P_5 = 2.9302, 2.8501", "P_4, P_5 = 2.9302, 2.95"),
    "friction exponent": Mutation("physics/hydrodynamics.py", "C_MU * math.sqrt(abs(v_t))", "C_MU * abs(v_t) ** 0.52"),
    "inertia of a thick link": Mutation("robot.py", "(3 * (self.diameter / 2)", "(3.3 * (self.diameter / 2)"),
    "inertia of a long link": Mutation("robot.py", "self.link_lengths**2) / 12", "self.link_lengths**2) / 12.5"),
    "cover mass": Mutation("robot.py", "_COVER_MASS = 0.542", "_COVER_MASS = 0.57"),
    "proportional gain": Mutation("robot.py", "Field(4.0", "Field(4.2"),
    "derivative gain": Mutation("robot.py", "Field(0.3,", "Field(0.32,"),
    "joint stiffness": Mutation("robot.py", "Field(0.1 / DEGREE", "Field(0.105 / DEGREE"),
    "joint damping": Mutation("robot.py", "Field(5e-5 / DEGREE", "Field(5.4e-5 / DEGREE"),
    "density of an oil": Mutation("fluid.py", '"oil1": 874.0', '"oil1": 900.0'),
    "viscosity of an oil": Mutation("fluid.py", "15: 2.32e-4", "15: 2.40e-4"),
    "weight of speed": Mutation("reward.py", "propulsion: float = 10.0", "propulsion: float = 10.5"),
    "weight of torque": Mutation("reward.py", "torque_rate: float = -0.02", "torque_rate: float = -0.021"),
    "gravity": Mutation("metrics.py", "GRAVITY = 9.80665", "GRAVITY = 9.9"),
    "Runge-Kutta weights": Mutation("physics/stepping.py", "dt / 6 if", "dt / 6.2 if"),
}


@pytest.fixture(scope="module")
def package(tmp_path_factory) -> Path:
    """A copy of the package and its tests that a test may change."""
    root = tmp_path_factory.mktemp("copy")
    nothing = shutil.ignore_patterns("__pycache__")
    for name in ("snakebench", *TESTS):
        shutil.copytree(ROOT / name, root / name, ignore=nothing)
    for name in ("pyproject.toml", "tests/conftest.py"):
        shutil.copy(ROOT / name, root / name)
    return root


def failure(package: Path, *tests: str) -> str | None:
    """The first test of a copy that fails; None when all pass."""
    compiled = {"NUMBA_CACHE_DIR": str(package / ".numba"), "PYTHONPATH": str(package), "PYTHONDONTWRITEBYTECODE": "1"}
    command = [sys.executable, "-m", "pytest", "-x", "-q", "-p", "no:cacheprovider", *tests]
    answer = subprocess.run(
        command, cwd=package, env=os.environ | compiled, capture_output=True, text=True, timeout=900
    )
    if answer.returncode == 0:
        return None
    assert answer.returncode == 1, answer.stdout + answer.stderr
    found = re.search(r"^(?:FAILED|ERROR) (.*?)(?: - |$)", answer.stdout, re.MULTILINE)
    assert found is not None, answer.stdout
    return found[1]


def test_the_copy_as_it_is_passes(package):
    assert failure(package, *TESTS) is None


@pytest.mark.parametrize("name", MUTATIONS)
def test_a_wrong_constant_is_found(package, name):
    mutation = MUTATIONS[name]
    path = package / "snakebench" / mutation.file
    original = path.read_text()
    assert original.count(mutation.right) == 1
    path.write_text(original.replace(mutation.right, mutation.wrong))
    try:
        caught = failure(package, *TESTS)
    finally:
        path.write_text(original)
    print(f"{name}: {mutation.right} -> {mutation.wrong}: {caught}")
    assert caught is not None, f"{mutation} survives"
