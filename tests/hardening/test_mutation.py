"""A physics constant that is off by a few per cent is found by a test of the physics, not only by published numbers."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from mutations import MUTATIONS

pytestmark = pytest.mark.slow

ROOT = Path(__file__).parents[2]
TESTS = ("tests/unit", "tests/physics")


@pytest.fixture(scope="module")
def package(tmp_path_factory) -> Path:
    """A copy of the package and its tests that a test may change."""
    root = tmp_path_factory.mktemp("copy")
    nothing = shutil.ignore_patterns("__pycache__")
    for name in ("snakebench", *TESTS):
        shutil.copytree(ROOT / name, root / name, ignore=nothing)
    for path in (ROOT / "pyproject.toml", *(ROOT / "tests").glob("*.py")):
        shutil.copy(path, root / path.relative_to(ROOT))
    for name in ("results", "studies"):
        (root / name).symlink_to(ROOT / name)
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
