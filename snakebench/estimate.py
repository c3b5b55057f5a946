"""How long is left: expected lengths of works, corrected by how long what was done of them has taken."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping

_TRUST = 60.0  # how much work at the expected pace the expectation counts for [s]


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
        self._expected: dict[tuple[str, str], float] = {}  # by work and part [s]
        self._reached: dict[tuple[str, str], float] = {}  # shares
        self._known: dict[tuple[str, str], float] = {}  # shares that earlier runs have reached, to be found again
        self._made = self._taken = _TRUST

    def expect(self, work: str, parts: Mapping[str, float], known: Mapping[str, float] | None = None) -> None:
        """Begin a work anew.

        Args:
            work: its name.
            parts: how long each of them takes [s].
            known: what share of them an earlier run has left behind.
        """
        self._last = self._clock()
        for part, seconds in parts.items():
            at = work, part
            self._expected[at], self._reached[at], self._known[at] = seconds, 0.0, (known or {}).get(part, 0.0)

    def reached(self, work: str, part: str, share: float, found: bool = False) -> None:
        """Take note of what share of a part is done; what came last was `found` there, or has taken its time."""
        at, now = (work, part), self._clock()
        if share <= self._reached.get(at, 1.0):
            return
        if not found:
            self._made += (share - self._reached[at]) * self._expected[at]
            self._taken += now - self._last
        self._reached[at], self._last = share, now

    def stretch(self, work: str, part: str, factor: float) -> None:
        """A part turns out to be so many times as long; what was done of it stays done."""
        at = work, part
        if at in self._expected:
            self._expected[at] *= factor
            self._reached[at] = min(self._reached[at] / factor, 1.0)

    def finish(self, work: str) -> None:
        """Take note that all of a work is done."""
        for at in self._of(work):
            self._reached[at] = 1.0

    def shares(self, work: str) -> dict[str, float]:
        """What share of each part is done, now or by an earlier run."""
        return {part: self._share((work, part)) for work, part in self._of(work)}

    def share(self) -> float:
        """What share of all works is done."""
        whole = sum(self._expected.values())
        return 1 - self._left(self._expected) / whole if whole else 0.0

    def seconds(self, work: str | None = None) -> float:
        """How long the rest of a work, or of all, is going to take [s]."""
        return self._left(self._expected if work is None else self._of(work)) * self._taken / self._made

    def _left(self, parts: Mapping[tuple[str, str], float] | Iterator[tuple[str, str]]) -> float:
        return sum(self._expected[at] * (1 - self._share(at)) for at in parts)

    def _share(self, at: tuple[str, str]) -> float:
        return max(self._reached[at], self._known[at])

    def _of(self, work: str) -> Iterator[tuple[str, str]]:
        return (at for at in self._expected if at[0] == work)


def in_words(seconds: float) -> str:
    """A duration as people say it."""
    for unit, length in (("h", 3600), ("min", 60)):
        if seconds >= 2 * length:
            return f"{seconds / length:.0f} {unit}"
    return f"{max(seconds, 1):.0f} s"
