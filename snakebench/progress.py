"""How far long work has come: a bar on a terminal, a plain line now and then otherwise; always on standard error."""

from __future__ import annotations

import sys
import time
from types import TracebackType
from typing import Self

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

_SECONDS_BETWEEN_LINES = 10.0
_ENOUGH = 5  # units between two lines to tell the pace


class Work:
    """Counts finished units of work of a known total; a context manager."""

    def __init__(self, name: str, total: int) -> None:
        self._name, self._total, self._done, self._said = name, total, 0, 0
        self._started = self._shown = time.monotonic()
        console = Console(stderr=True)
        columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn())
        self._bar = Progress(*columns, TimeRemainingColumn(), console=console) if console.is_terminal else None
        self._task = self._bar.add_task(name, total=total) if self._bar else None

    def __enter__(self) -> Self:
        if self._bar:
            self._bar.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._bar:
            self._bar.stop()
        elif kind is None:
            self._line()

    def advance(self, units: int = 1) -> None:
        """Count `units` more as done."""
        self._done += units
        if self._bar and self._task is not None:
            self._bar.advance(self._task, units)
        elif time.monotonic() - self._shown > _SECONDS_BETWEEN_LINES:
            self._line()

    def expect(self, units: int) -> None:
        """Raise the total by units of work that were not known of before."""
        self._total += units
        if self._bar and self._task is not None:
            self._bar.update(self._task, total=self._total)

    def say(self, text: str) -> None:
        """Print a line without disturbing the bar."""
        if self._bar:
            self._bar.console.print(text, highlight=False)
        else:
            print(text, file=sys.stderr, flush=True)

    def _line(self) -> None:
        """Say how far the work is, and how long it takes at the pace since the last line."""
        now = time.monotonic()
        lately = self._done - self._said
        seconds = (self._total - self._done) * (now - self._shown) / max(lately, 1)
        left = f", about {seconds:.0f} s to go" if lately >= _ENOUGH and self._done < self._total else ""
        self._shown, self._said = now, self._done
        self.say(f"{self._name}: {self._done} of {self._total} done after {now - self._started:.0f} s{left}")
