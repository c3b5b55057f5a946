"""Bullet prints nothing where results are printed, and leaves no file behind."""

from __future__ import annotations

import ctypes
import json
import os
import signal
import subprocess
import sys
from threading import Thread

import pytest

import snakebench as sb
from snakebench.engines import bullet

GAIT = sb.SeaSnake(amplitude=0.5, frequency=0.7, phase=0.5)
KILLED = """
import os, signal, sys
import snakebench as sb
from snakebench.engines import bullet

def kill(name, **_):
    with open(name) as file:
        assert file.read().startswith("<?xml")
    os.kill(os.getpid(), signal.SIGKILL)

bullet.pybullet.loadURDF = kill
sb.evaluate(sb.SeaSnake(amplitude=0.5, frequency=0.7, phase=0.5), duration=0.1)
"""


@pytest.fixture
def native():
    """What native code prints: to standard output, or to standard error."""
    library = ctypes.CDLL(None)

    def write(text: str, stream: str = "stdout") -> None:
        library.fputs(text.encode(), ctypes.c_void_p.in_dll(library, stream))

    return write


@pytest.mark.skipif(not hasattr(os, "memfd_create"), reason="elsewhere there is no file in memory")
def test_a_kill_while_bullet_loads_the_robot_leaves_no_file(tmp_path):
    environment = os.environ | {"TMPDIR": str(tmp_path)}
    answer = subprocess.run([sys.executable, "-c", KILLED], env=environment, capture_output=True, text=True)
    assert answer.returncode == -signal.SIGKILL, answer.stderr
    assert not list(tmp_path.iterdir())


def test_without_files_in_memory_the_file_is_removed(monkeypatch, tmp_path):
    expected = sb.evaluate(GAIT, duration=0.5)
    monkeypatch.delattr(os, "memfd_create", raising=False)
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    assert sb.evaluate(GAIT, duration=0.5) == expected
    assert not list(tmp_path.iterdir())


def test_what_bullet_complains_of_is_one_error_and_nothing_is_printed(monkeypatch, capfd):
    monkeypatch.setattr(sb.Robot, "urdf", lambda _: "<robot")
    with pytest.raises(sb.SnakebenchError, match="PyBullet cannot load the robot"):
        sb.evaluate(GAIT, duration=0.1)
    ctypes.CDLL(None).fflush(None)
    assert capfd.readouterr() == ("", "")


def test_what_native_code_printed_before_is_kept(native, capfd):
    native("before ")
    with bullet._silence():
        native("meanwhile ")
        native("meanwhile ", "stderr")
    native("after")
    ctypes.CDLL(None).fflush(None)
    assert capfd.readouterr() == ("before after", "")


def test_after_many_threads_were_silent_at_a_time_there_is_output_again(capfd):
    def be_silent() -> None:
        for _ in range(200):
            with bullet._silence():
                pass

    threads = [Thread(target=be_silent) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    print("here", flush=True)
    assert capfd.readouterr().out == "here\n"


@pytest.mark.parametrize("closed", [(), (1,), (1, 2)])
def test_a_run_needs_no_open_output(closed):
    script = f"""
import os
[os.close(stream) for stream in {closed}]
import snakebench as sb
assert sb.evaluate(sb.SeaSnake(amplitude=0.5, frequency=0.7, phase=0.5), duration=0.5).status == "ok"
os._exit(0)
"""
    assert subprocess.run([sys.executable, "-c", script], capture_output=True).returncode == 0


def test_simulate_with_json_prints_json_only():
    words = ("simulate", "sea-snake", "--amplitude", "0.5", "--frequency", "0.7", "--phase", "0.5", "--duration", "1")
    command = [sys.executable, "-m", "snakebench.cli", *words, "--json"]
    answer = subprocess.run(command, capture_output=True, text=True, check=True)
    assert json.loads(answer.stdout)["status"] == "ok"
    assert answer.stderr == ""
