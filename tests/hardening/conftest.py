"""A study of two seconds, what it leaves behind, and how a refusal looks."""

from __future__ import annotations

import os
import resource
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import pytest

import snakebench

TINY = """
question = "Does it survive?"
method = "sea_snake"
engine = "planar"
fluids = ["water"]
profile = "tiny"
[profiles.tiny]
duration = 0.5
trials = 4
batch = 2
seeds = [0]
"""
RUN = ("run-study", "tiny.toml", "--workers", "1")


def bytes_of(directory: Path) -> dict[str, bytes]:
    """Every file below a directory by its path; manifests, which tell the time and machine, and the cache left out."""
    files = [path for path in directory.rglob("*") if path.is_file() and ".cache" not in path.parts]
    return {str(path.relative_to(directory)): path.read_bytes() for path in files if path.name != "manifest.json"}


@pytest.fixture
def tiny_toml(tmp_path):
    """The study's file, in the test's directory."""
    path = tmp_path / "tiny.toml"
    path.write_text(TINY)
    return path


@pytest.fixture
def tiny(snakebench_command, tiny_toml):
    """Runs the study in the test's directory: returns exit code, standard output and error."""
    return lambda: snakebench_command(*RUN)


@pytest.fixture
def contents():
    """The bytes of every file below a directory; see `bytes_of`."""
    return bytes_of


@pytest.fixture
def open_directory():
    """An empty directory that every user may enter, as pytest's own is not."""
    with tempfile.TemporaryDirectory(prefix="snakebench-", dir="/tmp") as directory:
        path = Path(directory)
        path.chmod(0o755)
        yield path


@pytest.fixture
def without_powers(open_directory):
    """Run Python with some words without the powers of root: file permissions hold, as they do for users.

    Further arguments are variables of its environment.
    """
    root = os.geteuid() == 0
    if root and shutil.which("setpriv") is None:
        pytest.skip("root can give up its powers only with setpriv")
    home = open_directory / "home"
    home.mkdir()
    home.chmod(0o777)
    package = Path(snakebench.__file__).parents[1]
    own = {"HOME": str(home), "NUMBA_CACHE_DIR": str(home), "MPLCONFIGDIR": str(home), "PYTHONPATH": str(package)}

    def run(*words: str, **environment: str) -> subprocess.CompletedProcess[str]:
        user = ["setpriv", "--bounding-set=-all", "--inh-caps=-all"] if root else []
        command = [*user, sys.executable, *words]
        return subprocess.run(
            command, cwd=home, env=os.environ | own | environment, capture_output=True, text=True, timeout=120
        )

    return run


@pytest.fixture
def little_memory():
    """No more than 4 GB beyond what is taken."""
    before = resource.getrlimit(resource.RLIMIT_AS)
    taken = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
    resource.setrlimit(resource.RLIMIT_AS, (taken + (4 << 30), before[1]))
    yield
    resource.setrlimit(resource.RLIMIT_AS, before)
