"""How far long work has come and how long is left: a bar on a terminal, else a line now and then; on standard error."""

import math
import threading
import time
from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Self

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

from snakebench.errors import StoreError, printable
from snakebench.files import write_file

_SECONDS_BETWEEN_LINES = 10.0
_TRUST = 60.0  # how much work at the expected pace the expectation counts for [s]
_CONSOLE = Console(stderr=True)


def timed(call: Callable[[], object]) -> float:
    """How long a call takes [s]."""
    started = time.perf_counter()
    call()
    return time.perf_counter() - started


@contextmanager
def time_kept(path: Path) -> Iterator[Callable[[], float]]:
    """Add how long a block takes to the seconds in a file, even if the process is killed; yields what tells them."""
    before, started, over = seconds_kept(path) or 0.0, time.monotonic(), threading.Event()

    def taken() -> float:
        return before + time.monotonic() - started

    def keep() -> None:
        ended = False
        while not ended:
            ended = over.wait(_SECONDS_BETWEEN_LINES)  # and a last time
            with suppress(StoreError):
                write_file(path, f"{taken():.1f}\n")

    keeper = threading.Thread(target=keep, daemon=True)
    keeper.start()
    try:
        yield taken
    finally:
        over.set()
        keeper.join()


def seconds_kept(path: Path) -> float | None:
    """What `time_kept` left in a file [s]; None when there is nothing that can be read."""
    try:
        seconds = float(path.read_text(encoding="utf-8"))
        return seconds if math.isfinite(seconds) else None
    except (OSError, ValueError):
        return None


def in_words(seconds: float) -> str:
    """A duration as people say it."""
    for unit, length in (("h", 3600), ("min", 60)):
        if seconds >= 2 * length:
            return f"{seconds / length:.0f} {unit}"
    return f"{max(seconds, 1):.0f} s"


def _print(text: str) -> None:
    _CONSOLE.out(printable(text), highlight=False)


def _left(seconds: float) -> str:
    return f"about {in_words(seconds)} to go" if seconds else ""


def _bars(silent: bool = False) -> Progress:
    fields = ("description", "fields[count]", "fields[left]")
    name, count, left = (TextColumn(f"{{task.{field}}}", markup=False) for field in fields)
    columns = name, BarColumn(), count, TimeElapsedColumn(), left
    return Progress(*columns, console=_CONSOLE, disable=silent or not _CONSOLE.is_terminal)


@dataclass
class _Part:
    expected: float  # length [s]
    known: float  # share that an earlier run has left behind, to be found again
    reached: float = 0.0  # share

    @property
    def share(self) -> float:
        return max(self.reached, self.known)

    @property
    def left(self) -> float:
        return self.expected * (1 - self.share)


class Estimate:
    """What is left of works, each of parts such as evaluations and learning.

    All that is left is stretched by the pace: what was done anew has taken so much longer than expected, one minute at
    the expected pace included, so that it never jumps.
    """

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock, self._last = clock, clock()
        self.works: defaultdict[str, dict[str, _Part]] = defaultdict(dict)
        self._made = self._taken = _TRUST

    def expect(self, work: str, parts: Mapping[str, float], known: Mapping[str, float] | None = None) -> None:
        """Begin a work anew, whose parts take so long [s], with the shares of them that an earlier run left behind."""
        self._last = self._clock()
        self.works[work] = {part: _Part(seconds, (known or {}).get(part, 0.0)) for part, seconds in parts.items()}

    def reached(self, work: str, name: str, share: float, found: bool = False) -> None:
        """Take note of what share of a part is done; what came last was `found` there, or has taken its time."""
        part, now = self.works[work].get(name), self._clock()
        if part is None or share <= part.reached:
            return
        if not found:
            self._made += (share - part.reached) * part.expected
            self._taken += now - self._last
        part.reached, self._last = share, now

    def share(self) -> float:
        """What share of all works is done."""
        parts = [part for parts in self.works.values() for part in parts.values()]
        whole = sum(part.expected for part in parts)
        return 1 - sum(part.left for part in parts) / whole if whole else 0.0

    def seconds(self, work: str | None = None) -> float:
        """How long the rest of a work, or of all, is going to take [s]."""
        works = self.works.values() if work is None else [self.works[work]]
        return sum(part.left for parts in works for part in parts.values()) * self._taken / self._made


class Whole:
    """Works one after another, shown as one, each weighed by the time that it is expected to take."""

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
    """Counts finished units of work of a known total, alone or as a part of a whole; a silent one prints nothing."""

    def __init__(self, name: str, total: int, whole: Whole | None = None, *, silent: bool = False) -> None:
        self._name, self._total, self._done, self._whole, self._silent = name, total, 0, whole, silent
        self._estimate, self._bars = (whole.estimate, whole.bars) if whole else (Estimate(), _bars(silent))
        self._started = self._printed = time.monotonic()
        self._bar = self._bars.add_task(printable(name), total=total, count="", left="")

    def __enter__(self) -> Self:
        self._bars.start()
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        if kind is None:
            for part in self._parts.values():
                part.reached = 1.0
        self._show()
        if self._whole is None:
            self._bars.stop()
        if kind is None:
            self._print_line()

    @property
    def _parts(self) -> dict[str, _Part]:
        return self._estimate.works[self._name]

    def begin(self, units: float, known: Mapping[str, float] | None = None, **parts: float) -> None:
        """Set how long all units, and other parts, are expected to take [s], and what share of them is `known`."""
        self._estimate.expect(self._name, {"units": units} | parts, known)

    def advance(self, units: int = 1, seconds: float | None = None, found: bool = False) -> None:
        """Count units as done, which were expected to take so many seconds, or a like part of what is left."""
        part, rest = self._parts.get("units"), max(self._total - self._done, 1)
        self._done += units
        if part and part.expected:
            more = units / rest * (1 - part.reached) if seconds is None else seconds / part.expected
            self._estimate.reached(self._name, "units", min(part.reached + more, 1.0), found)
        self.reached("choosing", min(self._done / max(self._total, 1), 1.0), found)
        if time.monotonic() - self._printed > _SECONDS_BETWEEN_LINES:
            self._print_line()

    def expect(self, units: int) -> None:
        """Raise the total by units of work that were not known of before; what was done stays done."""
        factor = max(self._total + units, 1) / max(self._total, 1)
        if part := self._parts.get("units"):
            part.expected, part.reached = part.expected * factor, min(part.reached / factor, 1.0)
        self._total += units
        self._show()

    def reached(self, part: str, share: float, found: bool = False) -> None:
        """Take note of what share of a part is done; what came last was `found`, or has taken its time."""
        self._estimate.reached(self._name, part, share, found)
        self._show()

    def shares(self) -> dict[str, float]:
        """What share of each part is done, as a later run may pass it to `begin`."""
        return {name: part.share for name, part in self._parts.items()}

    def left(self) -> str:
        """How long the rest is expected to take, in words; empty when nothing is."""
        return _left(self._estimate.seconds(self._name))

    def say(self, text: str) -> None:
        """Print a line without disturbing the bar."""
        if not self._silent:
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
