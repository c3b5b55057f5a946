"""The command line: runs a command and ends with its exit code, whatever happens in one line.

Nothing heavy is imported here, so that SIGINT and SIGTERM end a command at whatever moment they arrive.
"""

import atexit
import os
import signal
import sys
import warnings
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from io import TextIOWrapper
from pathlib import Path
from threading import current_thread, main_thread
from types import FrameType

from snakebench.errors import SnakebenchError, printable

_AGAIN = 0.05  # after an interrupt that Python ignored [s]
_interrupted: list[int] = []  # exit codes


class Interrupted(KeyboardInterrupt):
    """A signal of that number has arrived that ends the command.

    Not KeyboardInterrupt itself: where that leaves code which a library made from text, Python ends by SIGINT later,
    whatever exit code it is told.
    """

    def __init__(self, number: int) -> None:
        super().__init__()
        self.number = number


@contextmanager
def interruptible() -> Iterator[None]:
    """Meanwhile SIGINT and SIGTERM raise `Interrupted` in the main thread, unless they are ignored as under nohup.

    Python cannot raise out of callbacks and finalisers, of which numba has many: it prints and ignores what they raise.
    An interrupt that is ignored so is not printed but raised again shortly after. Whatever else libraries make of one,
    such as an ImportError, leaves as `Interrupted`.
    """
    if current_thread() is not main_thread():
        yield
        return
    arrived: list[int] = []

    def interrupt(number: int, _: FrameType | None) -> None:
        if number in (signal.SIGINT, signal.SIGTERM):
            arrived.append(number)
        if arrived:
            raise Interrupted(arrived[-1])

    def ignored(what: "sys.UnraisableHookArgs") -> None:
        if isinstance(what.exc_value, Interrupted) and hasattr(signal, "setitimer"):
            signal.setitimer(signal.ITIMER_REAL, _AGAIN)
        elif not arrived:  # after an interrupt, of what was only begun
            usual(what)

    usual = sys.unraisablehook
    with ExitStack() as restored:
        restored.callback(setattr, sys, "unraisablehook", usual)
        sys.unraisablehook = ignored
        for name in ("SIGALRM", "SIGINT", "SIGTERM"):
            number = getattr(signal, name, None)  # SIGALRM, of the timer, is not known everywhere
            if number is not None and signal.getsignal(number) not in (signal.SIG_IGN, None):
                restored.callback(signal.signal, number, signal.signal(number, interrupt))
        if hasattr(signal, "setitimer"):
            restored.callback(signal.setitimer, signal.ITIMER_REAL, 0)
        try:
            yield
        except BaseException:
            if arrived:
                raise Interrupted(arrived[-1]) from None
            raise


def main() -> None:
    """Entry point: runs the command and ends with its exit code.

    It is 2 for anything refused, 3 without an optimum, 130 when interrupted and 143 when terminated.
    """
    if sys.stdout is None:  # closed by the caller
        sys.stdout = Path(os.devnull).open("w")  # noqa: SIM115
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")  # a path may be any bytes
    warnings.formatwarning = _warning
    try:
        with interruptible():
            from snakebench.cli.commands import run  # takes its time, and may be interrupted

            run(sys.argv[1:])
            sys.stdout.flush()
        atexit.register(_ignore_signals)  # last, so that it is called before all others
    except SnakebenchError as error:
        _end(str(error), error.exit_code)
    except Interrupted as interrupt:
        _interrupted.append(128 + interrupt.number)
        resumes = {"run-study", "pareto", "reproduce", "limit", "score"} & set(sys.argv[1:2])
        kept = "; what was evaluated is kept, the same command continues" if resumes else ""
        _end(f"interrupted{kept}", _interrupted[-1])
    except BrokenPipeError:  # the reader, such as head, has seen enough
        _discard_output()
    except RecursionError:
        _end("a file is nested too deeply to be read", 2)
    except OSError as error:  # of the system, such as a name too long to look up
        try:
            sys.stdout.flush()
        except OSError:  # on a full disk; Python would try once more at its end, and end with 120
            _discard_output()
        _end(f"{error.filename or 'cannot go on'}: {error.strerror or error}", 2)


def _ignore_signals() -> None:
    """Once all is done: Python would end by a signal that arrives while it clears up, as if nothing were done."""
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, signal.SIG_IGN)


def _warning(message: Warning | str, category: type[Warning], *_: object, **__: object) -> str:
    """A warning of a library, which may quote a file, in one line."""
    return printable(f"{category.__name__}: {message}") + "\n"


def _discard_output() -> None:
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def _end(why: str, code: int) -> None:
    print(f"snakebench: {printable(why)}", file=sys.stderr)
    sys.exit(code)


@atexit.register  # so early that all others are called before it
def _leave() -> None:
    """After an interrupt, end without freeing what is left: freeing what a compiler had only begun may crash."""
    if _interrupted:
        with suppress(OSError, ValueError):  # no one reads it, or it is closed
            sys.stdout.flush()
        os._exit(_interrupted[-1])
