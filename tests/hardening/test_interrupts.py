"""SIGINT and SIGTERM end a command in one line, whatever libraries make of them; Python's own ways come back after."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import textwrap
import time
from pathlib import Path
from threading import Thread

import pytest

from snakebench.cli import Interrupted, interruptible

KEPT = "snakebench: interrupted; what was evaluated is kept, the same command continues\n"
SIGNALS = [(signal.SIGINT, 130), (signal.SIGTERM, 143)]


class Finaliser:
    """Sends a signal where Python ignores what it raises."""

    def __init__(self, number: int) -> None:
        self._number = number

    def __del__(self) -> None:
        signal.raise_signal(self._number)
        for _ in range(10):  # whatever the handler raises is raised here
            pass


def long() -> None:
    """Work that ends in time only if it is interrupted."""
    end = time.monotonic() + 10
    while time.monotonic() < end:
        pass


@pytest.fixture
def command(tmp_path):
    """Run a command in whose modules one, loaded early, sends a signal in its own way: exit code, output and error."""

    def run(module: str, how: str, *words: str) -> tuple[int, str, str]:
        (tmp_path / "modules").mkdir()
        (tmp_path / "modules" / f"{module}.py").write_text(textwrap.dedent(how))
        paths = os.pathsep.join([str(tmp_path / "modules"), str(Path(__file__).parents[2])])
        answer = subprocess.run(
            [sys.executable, "-m", "snakebench.cli", *words],
            cwd=tmp_path,
            env=os.environ | {"PYTHONPATH": paths},
            capture_output=True,
            text=True,
            timeout=60,
        )
        return answer.returncode, answer.stdout, answer.stderr

    return run


@pytest.mark.parametrize(("number", "code"), SIGNALS)
def test_an_interrupt_that_python_ignores_ends_the_work_and_is_not_printed(number, code, capsys):
    def work() -> None:
        Finaliser(number)
        long()

    with pytest.raises(Interrupted) as interrupt, interruptible():
        work()
    assert 128 + interrupt.value.number == code
    assert capsys.readouterr() == ("", "")


def test_an_interrupt_that_becomes_another_error_is_an_interrupt():
    def load() -> None:
        try:
            signal.raise_signal(signal.SIGTERM)
        except KeyboardInterrupt:
            raise ImportError("initialization failed") from None

    with pytest.raises(Interrupted), interruptible():
        load()


def test_an_error_without_a_signal_stays_what_it_is():
    with pytest.raises(ImportError), interruptible():
        raise ImportError


def test_everything_is_as_before_when_the_command_has_ended(snakebench_command):
    names = (signal.SIGINT, signal.SIGTERM, signal.SIGALRM)
    before = [*map(signal.getsignal, names), sys.unraisablehook]
    assert snakebench_command("--version")[0] == 0
    assert [*map(signal.getsignal, names), sys.unraisablehook] == before


def test_a_signal_that_is_ignored_stays_ignored():
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        with interruptible():
            signal.raise_signal(signal.SIGINT)
    finally:
        signal.signal(signal.SIGINT, before)


@pytest.mark.parametrize(("number", "code"), SIGNALS)
@pytest.mark.parametrize("how", ["raise_signal({})", "exec('raise_signal({})')"])  # libraries make much code from text
def test_a_signal_while_the_command_line_loads_ends_it_in_a_line(command, number, code, how):
    module = f"from signal import raise_signal\n{how.format(int(number))}"
    assert command("cyclopts", module, "run-study", "quickstart") == (code, "", KEPT)


@pytest.mark.parametrize(("number", "code"), SIGNALS)
def test_a_signal_in_a_finaliser_while_the_engine_loads_ends_the_command(command, number, code):
    module = f"""
    import signal, time
    class Finaliser:
        def __del__(self):
            signal.raise_signal({int(number)})
            time.sleep(0)
    Finaliser()
    time.sleep(10)
    raise AssertionError("the signal was swallowed")
    """
    words = ("simulate", "sea-snake", "--amplitude", "1", "--frequency", "1", "--phase", "1")
    assert command("pybullet", module, *words) == (code, "", "snakebench: interrupted\n")


def test_in_another_thread_signals_are_left_alone():
    before, meanwhile = signal.getsignal(signal.SIGTERM), []

    def work() -> None:
        with interruptible():
            meanwhile.append(signal.getsignal(signal.SIGTERM))

    thread = Thread(target=work)
    thread.start()
    thread.join()
    assert meanwhile == [before]


def test_after_an_interrupt_nothing_is_said_of_what_was_only_begun(command):
    module = """
    import signal
    class Half:
        def __del__(self):
            raise AttributeError("half made")
    kept = Half()
    signal.raise_signal(signal.SIGTERM)
    """
    assert command("cyclopts", module, "list") == (143, "", "snakebench: interrupted\n")
