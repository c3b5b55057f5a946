"""How long is left: expected lengths of works, corrected by how long what was done of them has taken."""

from __future__ import annotations

import time
from collections import defaultdict
from collections.abc import Callable, Mapping
from dataclasses import dataclass

_TRUST = 60.0  # how much work at the expected pace the expectation counts for [s]


@dataclass
class _Part:
    """A part of a work."""

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

    A part is left in proportion to its expected length. All that is left is stretched by the pace: what was done has
    taken so much longer than expected, one minute at the expected pace included, so that it never jumps. What is found
    and not done anew leaves the pace as it is.

    Args:
        clock: the time [s].
    """

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock, self._last = clock, clock()
        self._works: defaultdict[str, dict[str, _Part]] = defaultdict(dict)
        self._made = self._taken = _TRUST

    def expect(self, work: str, parts: Mapping[str, float], known: Mapping[str, float] | None = None) -> None:
        """Begin a work anew.

        Args:
            work: its name.
            parts: how long each of them takes [s].
            known: what share of them an earlier run has left behind.
        """
        self._last = self._clock()
        self._works[work] = {part: _Part(seconds, (known or {}).get(part, 0.0)) for part, seconds in parts.items()}

    def advance(self, work: str, name: str, share: float, seconds: float | None = None, found: bool = False) -> None:
        """More of a part is done: so many of its expected seconds, or a share of what was left; as `reached`."""
        part = self._works[work].get(name)
        if part and part.expected:
            more = share * (1 - part.reached) if seconds is None else seconds / part.expected
            self.reached(work, name, min(part.reached + more, 1.0), found)

    def reached(self, work: str, name: str, share: float, found: bool = False) -> None:
        """Take note of what share of a part is done; what came last was `found` there, or has taken its time."""
        part, now = self._works[work].get(name), self._clock()
        if part is None or share <= part.reached:
            return
        if not found:
            self._made += (share - part.reached) * part.expected
            self._taken += now - self._last
        part.reached, self._last = share, now

    def stretch(self, work: str, name: str, factor: float) -> None:
        """A part turns out to be so many times as long; what was done of it stays done."""
        if part := self._works[work].get(name):
            part.expected *= factor
            part.reached = min(part.reached / factor, 1.0)

    def finish(self, work: str) -> None:
        """Take note that all of a work is done."""
        for part in self._works[work].values():
            part.reached = 1.0

    def shares(self, work: str) -> dict[str, float]:
        """What share of each part is done, now or by an earlier run."""
        return {name: part.share for name, part in self._works[work].items()}

    def share(self) -> float:
        """What share of all works is done."""
        parts = [part for parts in self._works.values() for part in parts.values()]
        whole = sum(part.expected for part in parts)
        return 1 - sum(part.left for part in parts) / whole if whole else 0.0

    def seconds(self, work: str | None = None) -> float:
        """How long the rest of a work, or of all, is going to take [s]."""
        works = self._works.values() if work is None else [self._works[work]]
        return sum(part.left for parts in works for part in parts.values()) * self._taken / self._made


def in_words(seconds: float) -> str:
    """A duration as people say it."""
    for unit, length in (("h", 3600), ("min", 60)):
        if seconds >= 2 * length:
            return f"{seconds / length:.0f} {unit}"
    return f"{max(seconds, 1):.0f} s"
