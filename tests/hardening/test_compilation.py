"""Compiled code is kept where the user may write, and nowhere that someone else may."""

from __future__ import annotations

import os
import shutil
import tempfile
from pathlib import Path

import pytest

import snakebench
from snakebench import compilation

SCRIPT = """
import os
import snakebench as sb
print(sb.SeaSnake(amplitude=1.0, frequency=0.5, phase=0.5).commands([0.0, 0.5], 2)[1, 1])
print(os.environ["NUMBA_CACHE_DIR"])
"""


@pytest.fixture
def closed(without_powers, open_directory):
    """Runs the script where neither the package nor the home directory may be written; `temporary` may."""
    package = open_directory / "package"
    shutil.copytree(Path(snakebench.__file__).parent, package / "snakebench", ignore=shutil.ignore_patterns("*.nb?"))
    for path in (package, *package.rglob("*")):
        path.chmod(0o555 if path.is_dir() else 0o444)
    temporary = open_directory / "temporary"
    temporary.mkdir()
    temporary.chmod(0o1777)
    home = str(package)  # nothing may be written there
    own = {"PYTHONPATH": home, "HOME": home, "XDG_CACHE_HOME": home, "NUMBA_CACHE_DIR": ""}

    def run(first: str = "") -> list[str]:
        answer = without_powers("-c", first + SCRIPT, **own, TMPDIR=str(temporary))
        assert (answer.returncode, answer.stderr) == (0, "")
        return answer.stdout.split()

    return run


@pytest.fixture
def usual(open_directory):
    """Where compiled code is kept."""
    return open_directory / "temporary" / f"snakebench-{os.geteuid()}"


@pytest.mark.slow
def test_where_nothing_else_may_be_written_compiled_code_is_kept_for_workers_and_the_next_run(closed, usual):
    assert closed() == ["1.0", str(usual)]
    assert usual.stat().st_mode & 0o777 == 0o700
    kept = {path: path.stat().st_mtime_ns for path in usual.rglob("*.nb?")}
    assert len(kept) == 2
    assert closed()[0] == "1.0"
    assert {path: path.stat().st_mtime_ns for path in usual.rglob("*.nb?")} == kept


@pytest.mark.slow
def test_where_someone_else_may_write_nothing_is_kept(closed, usual, open_directory):
    other = open_directory / "other"
    other.mkdir(mode=0o700)
    usual.symlink_to(other)
    assert closed() == ["1.0"]  # compiled each time
    assert list(usual.parent.iterdir()) == [usual]
    assert not list(other.iterdir())


def test_a_directory_is_used_if_nobody_else_may_write_there(monkeypatch, tmp_path):
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    usual = tmp_path / f"snakebench-{os.geteuid()}"
    usual.touch()
    assert compilation._directory() is None
    usual.unlink()
    usual.mkdir()
    for mode in (0o777, 0o720, 0o702):
        usual.chmod(mode)
        assert compilation._directory() is None
    usual.chmod(0o700)
    assert compilation._directory() == str(usual)


@pytest.mark.slow
def test_where_nothing_at_all_may_be_written_code_is_compiled_each_time(closed, open_directory):
    assert closed(f"import tempfile; tempfile.tempdir = {str(open_directory / 'package')!r}") == ["1.0"]


def test_numba_that_compiles_nothing_is_refused_in_a_line(without_powers):
    answer = without_powers(
        "-m",
        "snakebench.cli",
        "simulate",
        "sea-snake",
        "--amplitude",
        "1",
        "--frequency",
        "1",
        "--phase",
        "1",
        NUMBA_DISABLE_JIT="1",
    )
    assert (answer.returncode, answer.stdout) == (2, "")
    assert (
        answer.stderr == "snakebench: NUMBA_DISABLE_JIT = 1: the physics runs compiled only: unset it, or set it to 0\n"
    )
