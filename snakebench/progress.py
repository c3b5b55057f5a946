"""How far long work has come: a bar on a terminal, a plain line now and then otherwise; always on standard error."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterable
from types import TracebackType
from typing import Self

from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    TaskProgressColumn,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)

from snakebench.errors import printable

_SECONDS_BETWEEN_LINES = 10.0
_ENOUGH = 5  # units between two lines to tell the pace
_CONSOLE = Console(stderr=True)  # one for all, so that one bar can be drawn below another


def timed(call: Callable[[], object]) -> float:
    """How long a call takes [s]."""
    started = time.perf_counter()
    call()
    return time.perf_counter() - started


def in_words(seconds: float) -> str:
    """A duration as people say it."""
    for unit, length in (("h", 3600), ("min", 60)):
        if seconds >= 2 * length:
            return f"{seconds / length:.0f} {unit}"
    return f"{max(seconds, 1):.0f} s"


def _say(text: str) -> None:
    """Print a line without disturbing a bar."""
    if _CONSOLE.is_terminal:
        _CONSOLE.print(printable(text), highlight=False, markup=False, emoji=False)
    else:
        print(printable(text), file=sys.stderr, flush=True)


def _words(field: str) -> TextColumn:
    """A column of a bar that shows a field of its task as it is."""
    return TextColumn(f"{{task.{field}}}", markup=False)


class Whole:
    """Works one after another, shown as one, each weighed by the time that it is expected to take; a context manager.

    Args:
        names: of the works, in their order.
    """

    def __init__(self, names: Iterable[str]) -> None:
        self._names = list(names)
        self._expected = dict.fromkeys(self._names, (0.0, 0.0))
        self._left = dict.fromkeys(self._names, 0.0)
        columns = (_words("description"), BarColumn(), TaskProgressColumn(), TimeElapsedColumn())
        left = _words("fields[left]")
        self._bar = Progress(*columns, left, console=_CONSOLE) if _CONSOLE.is_terminal else None
        self._task = self._bar.add_task("all", total=None, left="") if self._bar else None

    def __enter__(self) -> Self:
        if self._bar:
            self._bar.start()
        return self

    def __exit__(self, *_: object) -> None:
        if self._bar:
            self._bar.stop()

    def expect(self, name: str, counted: float, aside: float = 0.0) -> None:
        """Weigh a work by how long its units take, and what is done aside from them [s]."""
        self._expected[name] = counted, aside
        self.reached(name, 0.0, 0.0)

    def reached(self, name: str, counted: float, aside: float) -> None:
        """Take note of what shares of a work are done: of its units, and of what is done aside from them."""
        units, others = self._expected[name]
        self._left[name] = units * (1 - counted) + others * (1 - aside)
        if self._bar and self._task is not None:
            total, left = sum(map(sum, self._expected.values())), sum(self._left.values())
            about = f"all, {self.place(name)}"
            self._bar.update(self._task, description=about, total=total, completed=total - left, left=self.left())

    def left(self) -> str:
        """How long all that is not done is expected to take, in words."""
        seconds = sum(self._left.values())
        return f"about {in_words(seconds)} to go" if seconds else "done"

    def place(self, name: str) -> str:
        """Which of the works it is."""
        return f"{self._names.index(name) + 1} of {len(self._names)}"

    def say(self, text: str) -> None:
        """Print a line without disturbing the bars."""
        _say(text)


class Work:
    """Counts finished units of work of a known total; a context manager.

    Args:
        name: of the work.
        total: units of it.
        whole: what it is a part of.
    """

    def __init__(self, name: str, total: int, whole: Whole | None = None) -> None:
        self._name, self._total, self._done, self._said = name, total, 0, 0
        self._whole, self._aside = whole, 0.0
        self._started = self._shown = time.monotonic()
        columns = (_words("description"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn())
        self._bar = Progress(*columns, TimeRemainingColumn(), console=_CONSOLE) if _CONSOLE.is_terminal else None
        self._task = self._bar.add_task(printable(name), total=total) if self._bar else None

    def __enter__(self) -> Self:
        if self._bar:
            self._bar.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._whole and kind is None:
            self._whole.reached(self._name, 1.0, 1.0)
        if self._bar:
            self._bar.stop()
        elif kind is None:
            self._line()

    def advance(self, units: int = 1) -> None:
        """Count `units` more as done."""
        self._done += units
        self._tell()
        if self._bar and self._task is not None:
            self._bar.advance(self._task, units)
        elif time.monotonic() - self._shown > _SECONDS_BETWEEN_LINES:
            self._line()

    def expect(self, units: int) -> None:
        """Raise the total by units of work that were not known of before."""
        self._total += units
        if self._bar and self._task is not None:
            self._bar.update(self._task, total=self._total)

    def aside(self, share: float) -> None:
        """Take note of what share is done of the work that is not counted in units."""
        self._aside = share
        self._tell()

    def say(self, text: str) -> None:
        """Print a line without disturbing the bar."""
        _say(f"{self._whole.place(self._name)}, {text}" if self._whole else text)

    def _tell(self) -> None:
        if self._whole:
            self._whole.reached(self._name, min(self._done / max(self._total, 1), 1.0), self._aside)

    def _line(self) -> None:
        """Say how far the work is, and how long it takes at the pace since the last line."""
        now = time.monotonic()
        lately = self._done - self._said
        seconds = (self._total - self._done) * (now - self._shown) / max(lately, 1)
        left = f", about {seconds:.0f} s to go" if lately >= _ENOUGH and self._done < self._total else ""
        whole = f"; all: {self._whole.left()}" if self._whole else ""
        self._shown, self._said = now, self._done
        self.say(f"{self._name}: {self._done} of {self._total} done after {now - self._started:.0f} s{left}{whole}")
