"""What does not fit into memory is refused in one line, before anything is allocated; what is freed can be kept."""

from __future__ import annotations

import platform
import subprocess
import sys
from pathlib import Path

import psutil
import pytest

import snakebench as sb
from snakebench import memory
from snakebench.memory import available_memory, check_memory

GAIT = sb.SeaSnake(amplitude=0.5, frequency=0.7, phase=0.5)


@pytest.fixture
def machine(monkeypatch):
    """Lets the machine have so much memory [bytes]."""

    def have(available: float) -> None:
        monkeypatch.setattr(memory, "available_memory", lambda: available)

    return have


@pytest.fixture
def groups(monkeypatch, tmp_path):
    """Control groups: the process is in the lower of two, which is unlimited."""
    (tmp_path / "job" / "step").mkdir(parents=True)
    (tmp_path / "job" / "step" / "memory.max").write_text("max\n")
    (tmp_path / "cgroup").write_text("0::/job/step\n")
    monkeypatch.setattr(memory, "_CONTROL_GROUPS", tmp_path)
    monkeypatch.setattr(memory, "_OWN_GROUP", tmp_path / "cgroup")
    return tmp_path


def test_what_fits_is_let_pass(machine):
    machine(2e9)
    check_memory("duration = 9 s", 1.9e9)


def test_what_does_not_fit_is_refused_with_the_memory_needed_and_available(machine):
    machine(9.8e9)
    with pytest.raises(sb.SnakebenchError) as refused:
        check_memory("duration = 1e6 s", 12e9)
    assert str(refused.value) == "duration = 1e6 s: needs 12.0 GB of memory, 9.8 GB are available"


def test_a_limit_of_a_container_counts_without_the_files_that_it_caches(groups):
    (groups / "job" / "memory.max").write_text("3000000\n")
    (groups / "job" / "memory.stat").write_text("anon 1000000\nfile 1900000\n")
    assert available_memory() == 2_000_000


def test_a_limit_of_the_process_counts(little_memory):
    assert 3e9 < available_memory() < 4.4e9


def test_no_more_is_available_than_the_machine_has(groups):
    assert 0 < available_memory() <= psutil.virtual_memory().total


@pytest.mark.parametrize("engine", ["planar", "pybullet"])
def test_a_run_that_does_not_fit_is_refused_before_anything_is_allocated(machine, engine):
    machine(1e6)
    with pytest.raises(
        sb.SnakebenchError, match=r"^duration = 100.0 s: needs 0.\d GB of memory, 0.0 GB are available$"
    ):
        sb.evaluate(GAIT, engine=engine, duration=100.0)


PEAK = """
import sys
from pathlib import Path
import snakebench as sb

def most():  # memory that this process has taken [bytes]
    (line,) = [line for line in Path("/proc/self/status").read_text().splitlines() if line.startswith("VmHWM")]
    return int(line.split()[1]) * 1024

gait, engine = sb.SeaSnake(amplitude=0.5, frequency=0.7, phase=0.5), sys.argv[1]
for joints, steps in zip(map(int, sys.argv[2::2]), map(int, sys.argv[3::2])):
    where = sb.Scenario(engine=engine, robot=sb.Robot.with_joints(joints), physics_rate=480)
    sb.evaluate(gait, where, duration=2.0)
    Path("/proc/self/clear_refs").write_text("5")
    before = most()
    where = where.but(duration=steps / 480)
    sb.evaluate(gait, where)
    print((most() - before) / where.memory)
"""


@pytest.mark.skipif(not Path("/proc/self/clear_refs").exists(), reason="only Linux tells the peak so")
@pytest.mark.parametrize(
    ("engine", "joints_and_steps"),
    [("planar", ((2, 240_048), (7, 120_000), (63, 24_000))), ("pybullet", ((7, 48_000),))],
)  # 240 048: the frequencies of a prime number of rows take most
@pytest.mark.slow
def test_an_evaluation_takes_no_more_memory_than_is_asked_for(engine, joints_and_steps):
    command = [sys.executable, "-c", PEAK, engine, *(str(number) for pair in joints_and_steps for number in pair)]
    answer = subprocess.run(command, capture_output=True, text=True, timeout=120, check=True)
    shares = [float(line) for line in answer.stdout.splitlines()]
    assert len(shares) == len(joints_and_steps) and all(0.4 < share < 1.0 for share in shares), shares


PAGES_TAKEN = """
import resource
import numpy as np
from snakebench.memory import keep_freed_memory

keep_freed_memory()
faults = []
for _ in range(3):
    arrays = [np.ones(500_000) for _ in range(20)]
    del arrays
    faults.append(resource.getrusage(resource.RUSAGE_SELF).ru_minflt)
print(faults[-1] - faults[0])
"""


@pytest.mark.skipif(platform.libc_ver()[0] != "glibc", reason="only glibc is asked to keep memory")
def test_memory_that_is_freed_is_kept_for_what_is_allocated_next():
    run = subprocess.run([sys.executable, "-c", PAGES_TAKEN], capture_output=True, text=True, check=True)
    assert int(run.stdout) < 1000  # of 39 000 that two rounds would take anew
