"""The paper's claims (`claims.toml`) beside what we measure (`judges.py`), and a verdict by a stated rule.

It never rests on digits alone: the paper's simulator and the robot's diameter in it are not known.
"""

import re
import tomllib
from collections.abc import Iterable, Mapping, Sequence
from importlib.resources import files
from typing import Any, NamedTuple

from snakebench.comparison.judges import JUDGES
from snakebench.comparison.results import Finding, Missing, Numbers, Results
from snakebench.errors import printable
from snakebench.report import paper

CLAIMS: dict[str, dict[str, Any]] = tomllib.loads((files(__package__) / "claims.toml").read_text(encoding="utf-8"))

# What Markdown, or GitHub's, reads as more than text: each sign where it means something.
_MARKUP = re.compile(
    r"""[\\`*<>|&~$@]  # escapes, code, emphasis, HTML, cells, entities, strikethrough, formulas, addresses
    | (?<![^\W_])_ | _(?![^\W_])  # emphasis, which does not begin or end within a word
    | (?<=\])[(\[:]  # the address of a link or picture
    | :(?=\S) | (?<=[Ww])\.  # addresses that become links by themselves""",
    re.VERBOSE,
)


class Claim(NamedTuple):
    """A claim, and what became of it; the fields up to `verdict` are the columns of the table."""

    claim: str
    paper: str
    ours: str
    n: str
    verdict: str  # reproduced, in part or not
    beside: str  # further numbers
    rule: str


def claims(results: Results) -> tuple[dict[str, Claim], list[str]]:
    """All claims for which there are results, by id, and what is missing for the others, a line each."""
    found, missing = dict[str, Claim](), list[str]()
    for id, text in CLAIMS.items():
        try:
            if set(results.fluids) != set(paper.POLICY):
                raise Missing(f"teacher_student: claims are about {', '.join(paper.POLICY)}, not these fluids")
            found[id] = _judged(text, JUDGES[id](results, text))
        except Missing as error:
            missing.append(str(error))
    return found, missing


def _judged(text: Mapping[str, Any], finding: Finding) -> Claim:
    parts = [*finding.measured.items()]
    counts = sorted({one.n for _, (numbers, _) in parts for one in numbers.values()})
    if not counts:
        raise Missing(f"no numbers for the claim: {text['claim']}")
    n = " to ".join(str(count) for count in dict.fromkeys([counts[0], counts[-1]]))
    verdict = "reproduced" if all(finding.holds) else "in part" if any(finding.holds) else "not"
    ours, beside = (_listed(part) for part in (parts[: finding.leading], parts[finding.leading :]))
    return Claim(text["claim"], text["paper"], ours, n, verdict, beside, text["rule"].format(**text))


def _listed(parts: Iterable[tuple[str, tuple[Numbers, int]]]) -> str:
    return "; ".join(
        f"{label}: {', '.join(f'{place} {one.text(digits)}' for place, one in numbers.items())}"
        for label, (numbers, digits) in parts
        if numbers
    )


def markdown(judged: Sequence[Claim]) -> str:
    """The claims as a Markdown table up to their verdicts; its cells hold text and nothing else."""
    head = Claim._fields[: Claim._fields.index("verdict") + 1]
    rows = ["| " + " | ".join(map(_cell, one[: len(head)])) + " |" for one in judged]
    return "\n".join([f"| {' | '.join(head)} |", "|---" * len(head) + "|", *rows]) + "\n"


def _cell(text: str) -> str:
    """A text that Markdown shows as it is, on one line."""
    return _MARKUP.sub(lambda sign: f"<span>&#{ord(sign[0])};</span>", printable(text))
