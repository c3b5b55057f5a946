"""Verdicts on claims: what a claim is, the rules that judge it, and how its numbers are said."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from typing import Literal, NamedTuple

import numpy as np

from snakebench.comparison.quantities import Measurement
from snakebench.errors import printable

# What Markdown, or GitHub's, reads as more than text: each sign where it means something.
_MEANT = re.compile(
    r"""[\\`*<>|&~$@]  # escapes, code, emphasis, HTML, cells, entities, strikethrough, formulas, addresses
    | (?<![^\W_])_ | _(?![^\W_])  # emphasis, which does not begin or end within a word
    | (?<=\])[(\[:]  # the address of a link or picture
    | :(?=\S) | (?<=[Ww])\.  # addresses that become links by themselves""",
    re.VERBOSE,
)
Verdict = Literal["reproduced", "in part", "not"]


class Claim(NamedTuple):
    """A claim, and what became of it."""

    claim: str
    paper: str
    ours: str
    n: str
    verdict: Verdict
    why: str  # one sentence: the rule, and what deviates
    page: str  # which study's page tells more


def verdict(holds: Sequence[bool]) -> Verdict:
    """Reproduced if all parts of a claim hold, not if none does."""
    return "reproduced" if all(holds) else "in part" if any(holds) else "not"


def above(quantity: Measurement, bound: float) -> bool:
    """Whether a mean is above a bound with its whole interval."""
    low, _ = quantity.interval or (quantity.mean, quantity.mean)
    return low > bound


def below(quantity: Measurement, bound: float) -> bool:
    """Whether a mean is below a bound with its whole interval."""
    _, high = quantity.interval or (quantity.mean, quantity.mean)
    return high < bound


def ordered(quantities: Sequence[Measurement]) -> bool:
    """Whether values rise from each quantity to the next, for every seed."""
    rows = np.array([one.values for one in quantities])
    return bool((np.diff(rows, axis=0) > 0).all())


def ratio(quantity: Measurement, by: float) -> Measurement:
    """A quantity as a multiple of a number."""
    return quantity._replace(values=tuple(value / by for value in quantity.values), unit="1")


def plus(one: Measurement) -> str:
    """A change in per cent, signed, ± half its interval."""
    return f"{'+' if one.mean >= 0 else ''}{one.text(0)} %"


def each_mean(quantities: Mapping[str, Measurement], form: str) -> str:
    """The mean of each, in a form, in its fluid or at its speed or power."""
    return ", ".join(
        f"{form.format(one.mean)} {'at' if name[0].isdigit() else 'in'} {name}" for name, one in quantities.items()
    )


def path(quantities: Sequence[Measurement]) -> str:
    """From one fluid to the next."""
    return " → ".join(one.text() for one in quantities)


def counts(quantities: Iterable[Measurement]) -> str:
    """Of how many seeds they are."""
    counts = sorted({one.n for one in quantities})
    return " to ".join(str(count) for count in dict.fromkeys([counts[0], counts[-1]]))


def markdown(judged: Sequence[Claim]) -> str:
    """The claims as a Markdown table, whose cells hold text and nothing else."""
    rows = ["| " + " | ".join(map(_cell, one[:5])) + " |" for one in judged]
    return "\n".join(["| claim | paper | ours | n | verdict |", "|---|---|---|---|---|", *rows]) + "\n"


def _cell(text: str) -> str:
    """A text that Markdown shows as it is, on one line."""
    return _MEANT.sub(lambda sign: f"<span>&#{ord(sign[0])};</span>", printable(text))
