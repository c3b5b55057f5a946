"""A command that is killed, or runs twice at once, leaves no half-written file and ends as if nothing had happened."""

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

import numpy as np
import psutil
import pytest

import snakebench as sb
from snakebench.identification.log import write_log

WAVE = sb.SeaSnake(amplitude=0.9, frequency=0.6, phase=0.7)
SMALL = sb.Robot(lengths=(0.28, 0.44, 0.44, 0.32), masses=(1.0, 1.5, 1.5, 1.2))  # whose limit is found in seconds
CLI = "-m snakebench.cli"
COMMANDS = {  # and the files that each writes; other studies are killed in test_resume.py and test_reproduce.py
    "score": (f"{CLI} score wave.json --quick --seed dev --workers 2", "score.*"),
    "limit": (f"{CLI} limit --fluid water --power 2 --robot small.json --save fast.json", "fast.json"),
    "identify": (f"{CLI} identify log.csv --fluid water --save found.json", "found.json"),
    "reproduce": ("again.py", "results/sea_snake-smoke/**/*.[cn]*"),
}
AGAIN = """
from pathlib import Path
from snakebench.studies.reproduction import checked_configs, reproduce

if __name__ == "__main__":
    reproduce(checked_configs("smoke", ["sea_snake"]), Path("results"), workers=2)
"""
MOMENTS = 13  # at which each is killed: 52 in all

pytestmark = pytest.mark.slow


def start(directory: Path, name: str, errors: int = subprocess.DEVNULL) -> subprocess.Popen[bytes]:
    command = [sys.executable, *COMMANDS[name][0].split()]
    return subprocess.Popen(command, cwd=directory, stdout=subprocess.DEVNULL, stderr=errors, start_new_session=True)


def prepare(directory: Path) -> Path:
    directory.mkdir()
    (directory / "wave.json").write_text(WAVE.model_dump_json())
    (directory / "small.json").write_text(SMALL.model_dump_json())
    (directory / "again.py").write_text(AGAIN)
    swim = sb.simulate(WAVE, "water", engine="planar", duration=5.0)
    write_log(directory / "log.csv", swim.thinned(4))
    return directory


def written(directory: Path, name: str) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in directory.glob(COMMANDS[name][1])}


@pytest.mark.parametrize("name", COMMANDS)
def test_a_killed_command_leaves_whole_files_and_ends_with_the_same_bytes(tmp_path, name):
    whole, killed, rng = prepare(tmp_path / "whole"), prepare(tmp_path / "killed"), random.Random(0)
    begun, landed = time.monotonic(), 0
    assert start(whole, name).wait(600) == 0
    seconds, expected = time.monotonic() - begun, written(whole, name)
    assert expected
    while landed < MOMENTS:
        process = start(killed, name)
        try:
            assert process.wait(rng.uniform(0.1, seconds)) == 0
        except subprocess.TimeoutExpired:
            landed += 1
        with suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)
        process.wait()
        for file, content in written(killed, name).items():
            assert content == expected[file]
        if written(killed, name) == expected:  # it ended: once more from the beginning
            shutil.rmtree(killed)
            prepare(killed)
    assert start(killed, name).wait(600) == 0
    assert written(killed, name) == expected


KEPT = "; what was evaluated is kept, the same command continues"


@pytest.mark.parametrize(
    ("name", "share", "kept"), [("score", 0.5, KEPT), ("identify", 0.5, ""), ("identify", 0.8, "")]
)
def test_an_interrupted_command_says_so_and_ends_with_the_same_bytes_when_it_runs_again(tmp_path, name, share, kept):
    whole, stopped = prepare(tmp_path / "whole"), prepare(tmp_path / "stopped")
    begun = time.monotonic()
    assert start(whole, name).wait(600) == 0
    seconds = time.monotonic() - begun
    for sooner in (1.0, 0.7, 0.5):  # it may take less time than the first
        process = start(stopped, name, subprocess.PIPE)
        with suppress(subprocess.TimeoutExpired):
            process.wait(sooner * share * seconds)
        if process.poll() is None and not written(stopped, name):
            break
        process.wait()
        shutil.rmtree(stopped)
        prepare(stopped)
    os.killpg(process.pid, signal.SIGINT)  # as a terminal does: to the workers as well
    errors = process.communicate(timeout=60)[1].decode()
    assert process.returncode == 130 and "Traceback" not in errors
    assert errors.splitlines()[-1] == f"snakebench: interrupted{kept}"
    assert not written(stopped, name) and not [path for path in stopped.glob(".*") if path.is_file()]
    assert start(stopped, name).wait(600) == 0
    assert written(stopped, name) == written(whole, name)


def test_an_interrupt_of_a_command_that_has_done_its_work_changes_nothing(tmp_path):
    directory = prepare(tmp_path / "done")
    begun, ends = time.monotonic(), set()
    assert start(directory, "identify").wait(600) == 0
    seconds = time.monotonic() - begun
    for late in np.arange(0.0, 0.8, 0.1):  # Python takes some tenths of a second to clear up
        process = start(directory, "identify", subprocess.PIPE)
        with suppress(subprocess.TimeoutExpired):
            process.wait(seconds - late)
        with suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGINT)
        errors = process.communicate(timeout=60)[1].decode()
        ends.add((process.returncode, errors))
    assert ends <= {(0, ""), (130, "snakebench: interrupted\n")} and (0, "") in ends


@pytest.fixture(scope="module")
def expected(tmp_path_factory):
    """What each command writes when nothing happens to it."""
    files = {}
    for name in ("score", "limit"):
        directory = prepare(tmp_path_factory.mktemp("whole") / name)
        assert start(directory, name).wait(600) == 0
        files[name] = written(directory, name)
    return files


@pytest.mark.parametrize("name", ["score", "limit"])
def test_two_commands_in_one_results_directory_end_with_the_same_bytes(tmp_path, expected, name):
    shared = prepare(tmp_path / "shared")
    assert [process.wait(600) for process in [start(shared, name), start(shared, name)]] == [0, 0]
    assert written(shared, name) == expected[name]


@pytest.mark.parametrize("name", ["score", "limit"])
def test_a_command_whose_worker_is_killed_ends_and_the_same_command_continues(tmp_path, expected, name):
    directory = prepare(tmp_path / "killed")
    process = start(directory, name)
    until = time.monotonic() + 120
    while not (crew := workers(process.pid)):
        assert process.poll() is None and time.monotonic() < until
        time.sleep(0.05)
    crew[0].kill()
    assert process.wait(120) == 2 and not written(directory, name)
    assert start(directory, name).wait(600) == 0
    assert written(directory, name) == expected[name]


@pytest.mark.parametrize("name", ["score", "limit"])
def test_a_damaged_cache_costs_what_was_in_it(tmp_path, expected, name):
    directory = prepare(tmp_path / "damaged")
    assert start(directory, name).wait(600) == 0
    (cache,) = directory.rglob("evaluations.sqlite")
    cache.write_bytes(random.Random(0).randbytes(cache.stat().st_size))
    for path in directory.glob(COMMANDS[name][1]):
        path.unlink()
    assert start(directory, name).wait(600) == 0
    assert written(directory, name) == expected[name]
    assert cache.with_name("evaluations.sqlite.damaged").exists()


def workers(pid: int) -> list[psutil.Process]:
    """The worker processes of a command."""
    with suppress(psutil.Error):
        children = psutil.Process(pid).children(recursive=True)
        return [child for child in children if any("popen_loky" in word for word in child.cmdline())]
    return []
