"""How far long work has come: a bar on a terminal, a plain line now and then otherwise; always on standard error."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Mapping
from typing import Self

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

from snakebench.errors import printable
from snakebench.estimate import Estimate, in_words

_SECONDS_BETWEEN_LINES = 10.0
_CONSOLE = Console(stderr=True)


def timed(call: Callable[[], object]) -> float:
    """How long a call takes [s]."""
    started = time.perf_counter()
    call()
    return time.perf_counter() - started


def _print(text: str) -> None:
    """Print a line without disturbing a bar."""
    _CONSOLE.out(printable(text), highlight=False)


def _bars() -> Progress:
    """Bars on a terminal, nothing elsewhere."""
    fields = ("description", "fields[count]", "fields[left]")
    name, count, left = (TextColumn(f"{{task.{field}}}", markup=False) for field in fields)
    columns = name, BarColumn(), count, TimeElapsedColumn(), left
    return Progress(*columns, console=_CONSOLE, disable=not _CONSOLE.is_terminal)


class Whole:
    """Works one after another, shown as one, each weighed by the time that it is expected to take; a context manager.

    Args:
        names: of the works, in their order.

    Attributes:
        estimate: of how long they take.
        bars: of all, and below it of each work.
    """

    say = staticmethod(_print)

    def __init__(self, names: Iterable[str]) -> None:
        self._names, self.estimate, self.bars = list(names), Estimate(), _bars()
        self._bar = self.bars.add_task("all", total=1.0, count="", left="")

    def __enter__(self) -> Self:
        self.bars.start()
        return self

    def __exit__(self, *_: object) -> None:
        self.bars.stop()

    def show(self, name: str) -> None:
        """Draw the bar anew, in the work of that name."""
        share, description = self.estimate.share(), f"all, {self.place(name)}"
        self.bars.update(self._bar, description=description, completed=share, count=f"{share:.0%}", left=self.left())

    def left(self) -> str:
        """How long all that is not done is expected to take, in words."""
        return _left(self.estimate.seconds()) or "done"

    def place(self, name: str) -> str:
        """Which of the works it is."""
        return f"{self._names.index(name) + 1} of {len(self._names)}"


class Work:
    """Counts finished units of work of a known total; a context manager.

    Args:
        name: of the work.
        total: units of it.
        whole: what it is a part of.
    """

    def __init__(self, name: str, total: int, whole: Whole | None = None) -> None:
        self._name, self._total, self._done, self._whole = name, total, 0, whole
        self._estimate = whole.estimate if whole else Estimate()
        self._started = self._printed = time.monotonic()
        self._bars = whole.bars if whole else _bars()
        self._bar = self._bars.add_task(printable(name), total=total, count="", left="")

    def __enter__(self) -> Self:
        self._bars.start()
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        if kind is None:
            self._estimate.finish(self._name)
        self._show()
        if self._whole is None:
            self._bars.stop()
        if kind is None:
            self._print_line()

    def begin(self, units: float, known: Mapping[str, float] | None = None, **parts: float) -> None:
        """Set how long all units, and other parts, are expected to take [s], and what share of them is `known`."""
        self._estimate.expect(self._name, {"units": units} | parts, known)

    def advance(self, units: int = 1, seconds: float | None = None, found: bool = False) -> None:
        """Count `units` more as done.

        Args:
            units: how many.
            seconds: that they were expected to take; a like part of what is left if omitted.
            found: whether they were not done anew.
        """
        rest = max(self._total - self._done, 1)
        self._done += units
        self._estimate.advance(self._name, "units", units / rest, seconds, found)
        self.reached("choosing", min(self._done / max(self._total, 1), 1.0), found)
        if time.monotonic() - self._printed > _SECONDS_BETWEEN_LINES:
            self._print_line()

    def expect(self, units: int) -> None:
        """Raise the total by units of work that were not known of before."""
        self._estimate.stretch(self._name, "units", max(self._total + units, 1) / max(self._total, 1))
        self._total += units
        self._show()

    def reached(self, part: str, share: float, found: bool = False) -> None:
        """Take note of what share of a part is done; what came last was `found`, or has taken its time."""
        self._estimate.reached(self._name, part, share, found)
        self._show()

    def shares(self) -> dict[str, float]:
        """What share of each part is done, as a later run may pass it to `begin`."""
        return self._estimate.shares(self._name)

    def left(self) -> str:
        """How long the rest is expected to take, in words; empty when nothing is."""
        return _left(self._estimate.seconds(self._name))

    def say(self, text: str) -> None:
        """Print a line without disturbing the bar."""
        _print(f"{self._whole.place(self._name)}, {text}" if self._whole else text)

    def _show(self) -> None:
        count = f"{self._done}/{self._total}"
        self._bars.update(self._bar, total=self._total, completed=self._done, count=count, left=self.left())
        if self._whole:
            self._whole.show(self._name)

    def _print_line(self) -> None:
        """Say how far it has come, where no bar shows it."""
        if not self._bars.disable:
            return
        self._printed = time.monotonic()
        left, whole = self.left(), f"; all: {self._whole.left()}" if self._whole else ""
        after = f"after {self._printed - self._started:.0f} s" + (f", {left}" if left else "")
        self.say(f"{self._name}: {self._done} of {self._total} done {after}{whole}")


def _left(seconds: float) -> str:
    return f"about {in_words(seconds)} to go" if seconds else ""
