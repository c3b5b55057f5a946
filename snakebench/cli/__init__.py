"""The command line: runs a command and ends with its exit code, whatever happens in one line."""

from __future__ import annotations

import atexit
import os
import sys
import warnings
from contextlib import suppress
from io import TextIOWrapper

from snakebench.cli.interrupts import Interrupted, interruptible
from snakebench.errors import SnakebenchError, printable

_interrupted: list[int] = []  # exit codes


def main() -> None:
    """Entry point: runs the command and ends with its exit code.

    It is 2 for anything refused, 130 when interrupted and 143 when terminated.
    """
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")  # a path may be any bytes
    warnings.formatwarning = _warning
    try:
        with interruptible():
            from snakebench.cli.commands import run  # takes its time, and may be interrupted

            run(sys.argv[1:])
            sys.stdout.flush()
    except SnakebenchError as error:
        _end(str(error), 2)
    except Interrupted as interrupt:
        _interrupted.append(128 + interrupt.number)
        resumes = {"run-study", "pareto", "reproduce"} & set(sys.argv)
        kept = "; what was evaluated is kept, the same command continues" if resumes else ""
        _end(f"interrupted{kept}", _interrupted[-1])
    except BrokenPipeError:  # the reader, such as head, has seen enough
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    except RecursionError:
        _end("a file is nested too deeply to be read", 2)
    except OSError as error:  # of the system, such as a name too long to look up
        _end(f"{error.filename or 'cannot go on'}: {error.strerror or error}", 2)


def _warning(message: Warning | str, category: type[Warning], *_: object, **__: object) -> str:
    """A warning of a library, which may quote a file, in one line."""
    return printable(f"{category.__name__}: {message}") + "\n"


def _end(why: str, code: int) -> None:
    """End in one line that says why."""
    print(f"snakebench: {printable(why)}", file=sys.stderr)
    sys.exit(code)


@atexit.register  # so early that all others are called before it
def _leave() -> None:
    """After an interrupt, end without freeing what is left: freeing what a compiler had only begun may crash."""
    if _interrupted:
        with suppress(OSError, ValueError):  # no one reads it, or it is closed
            sys.stdout.flush()
        os._exit(_interrupted[-1])
