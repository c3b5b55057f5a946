"""How far long work has come: a bar on a terminal, a plain line now and then otherwise; always on standard error."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterable, Mapping
from types import TracebackType
from typing import Any, Self

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, ProgressColumn, TextColumn, TimeElapsedColumn

from snakebench.errors import printable
from snakebench.estimate import Estimate, in_words

_SECONDS_BETWEEN_LINES = 10.0
_CONSOLE = Console(stderr=True)  # one for all, so that one bar can be drawn below another


def timed(call: Callable[[], object]) -> float:
    """How long a call takes [s]."""
    started = time.perf_counter()
    call()
    return time.perf_counter() - started


def _say(text: str) -> None:
    """Print a line without disturbing a bar."""
    if _CONSOLE.is_terminal:
        _CONSOLE.print(printable(text), highlight=False, markup=False, emoji=False)
    else:
        print(printable(text), file=sys.stderr, flush=True)


class _Bar:
    """A bar on a terminal, nothing elsewhere: a name, the bar, `counted`, the time, and what is left in words."""

    def __init__(self, name: str, total: float, counted: ProgressColumn) -> None:
        name_shown, left = (TextColumn(f"{{task.{field}}}", markup=False) for field in ("description", "fields[left]"))
        columns = name_shown, BarColumn(), counted, TimeElapsedColumn(), left
        self._bar = Progress(*columns, console=_CONSOLE) if _CONSOLE.is_terminal else None
        self._task = self._bar.add_task(printable(name), total=total, left="") if self._bar else None

    def start(self) -> None:
        if self._bar:
            self._bar.start()

    def stop(self) -> None:
        if self._bar:
            self._bar.stop()

    def show(self, **fields: Any) -> bool:
        """Draw it anew; whether there is one."""
        if self._bar and self._task is not None:
            self._bar.update(self._task, **fields)
        return self._bar is not None


class Whole:
    """Works one after another, shown as one, each weighed by the time that it is expected to take; a context manager.

    Args:
        names: of the works, in their order.

    Attributes:
        estimate: of how long they take.
    """

    def __init__(self, names: Iterable[str]) -> None:
        self._names, self.estimate = list(names), Estimate()
        self._bar = _Bar("all", 1.0, TextColumn("{task.percentage:>3.0f}%"))

    def __enter__(self) -> Self:
        self._bar.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._bar.stop()

    def show(self, name: str) -> None:
        """Draw the bar anew, in the work of that name."""
        self._bar.show(description=f"all, {self.place(name)}", completed=self.estimate.share(), left=self.left())

    def left(self) -> str:
        """How long all that is not done is expected to take, in words."""
        return _left(self.estimate.seconds()) or "done"

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
        self._name, self._total, self._done, self._whole = name, total, 0, whole
        self._estimate = whole.estimate if whole else Estimate()
        self._expected = self._spent = 0.0  # of all units, and of those done, at the expected pace [s]
        self._started = self._said = time.monotonic()
        self._bar = _Bar(name, total, MofNCompleteColumn())

    def __enter__(self) -> Self:
        self._bar.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if kind is None:
            self._estimate.finish(self._name)
        shown = self._show()
        self._bar.stop()
        if kind is None and not shown:
            self._line()

    def begin(self, units: float, known: Mapping[str, float] | None = None, **parts: float) -> None:
        """Tell how long all units, and other parts, are expected to take [s], and what share of them is `known`."""
        self._expected, self._spent = units, 0.0
        self._estimate.expect(self._name, {"units": units} | parts, known)

    def advance(self, units: int = 1, seconds: float | None = None, found: bool = False) -> None:
        """Count `units` more as done.

        Args:
            units: how many.
            seconds: that they were expected to take; a like part of what is left if omitted.
            found: whether they were not done anew.
        """
        rest = (self._expected - self._spent) / max(self._total - self._done, 1)
        self._spent += units * rest if seconds is None else seconds
        self._done += units
        if self._expected:
            self.reached("units", min(self._spent / self._expected, 1.0), found)
        self.reached("choosing", min(self._done / max(self._total, 1), 1.0), found)
        if not self._show() and time.monotonic() - self._said > _SECONDS_BETWEEN_LINES:
            self._line()

    def expect(self, units: int) -> None:
        """Raise the total by units of work that were not known of before."""
        factor = max(self._total + units, 1) / max(self._total, 1)
        self._estimate.stretch(self._name, "units", factor)
        self._expected, self._total = self._expected * factor, self._total + units
        self._bar.show(total=self._total)

    def reached(self, part: str, share: float, found: bool = False) -> None:
        """Take note of what share of a part is done; what came last was `found`, or has taken its time."""
        self._estimate.reached(self._name, part, share, found)
        self._show()

    def shares(self) -> dict[str, float]:
        """What share of each part is done, as `begin` may be told by a later run."""
        return self._estimate.shares(self._name)

    def left(self) -> str:
        """How long the rest is expected to take, in words; empty when nothing is."""
        return _left(self._estimate.seconds(self._name))

    def say(self, text: str) -> None:
        """Print a line without disturbing the bar."""
        _say(f"{self._whole.place(self._name)}, {text}" if self._whole else text)

    def _show(self) -> bool:
        if self._whole:
            self._whole.show(self._name)
        return self._bar.show(completed=self._done, left=self.left())

    def _line(self) -> None:
        self._said = time.monotonic()
        left, whole = self.left(), f"; all: {self._whole.left()}" if self._whole else ""
        after = f"after {self._said - self._started:.0f} s" + (f", {left}" if left else "")
        self.say(f"{self._name}: {self._done} of {self._total} done {after}{whole}")


def _left(seconds: float) -> str:
    return f"about {in_words(seconds)} to go" if seconds else ""
