"""SIGINT and SIGTERM end a command, at whatever moment they arrive. Nothing heavy is imported here."""

from __future__ import annotations

import signal
import sys
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from threading import current_thread, main_thread
from types import FrameType

_AGAIN = 0.05  # after an interrupt that Python ignored [s]


class Interrupted(KeyboardInterrupt):
    """A signal has arrived that ends the command.

    Not KeyboardInterrupt itself: where that leaves code which a library made from text, Python ends by SIGINT later,
    whatever exit code it is told.

    Attributes:
        number: of the signal.
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
        raise Interrupted(arrived[-1])

    def ignored(what: sys.UnraisableHookArgs) -> None:
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
