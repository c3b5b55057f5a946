"""The paper's claims beside ours: what it says, what we measure, and a verdict by a stated rule.

Claims and their rules are in `claims.toml`; a judge measures, and says which parts of the rule hold. A verdict never
rests on digits alone: the paper's simulator and the robot's diameter in it are not known.
"""

from __future__ import annotations

import re
import tomllib
from collections.abc import Callable, Mapping, Sequence
from functools import cache
from importlib.resources import files
from typing import Any, Literal, NamedTuple

import numpy as np

from snakebench.comparison.measured import (
    gain,
    gain_at_power,
    is_best_at_home,
    mean_return,
    power_over_switching,
    recovery,
    replayed,
    share_of_switching,
    times_the_sea_snakes,
)
from snakebench.comparison.results import Measurement, Missing, Results, combined
from snakebench.errors import printable
from snakebench.report import paper
from snakebench.report.method_names import METHOD_NAMES, name_of
from snakebench.report.table import COSTS, LABELS
from snakebench.store import EXTENDED, PAPER

Verdict = Literal["reproduced", "in part", "not"]

# What Markdown, or GitHub's, reads as more than text: each sign where it means something.
_MARKUP = re.compile(
    r"""[\\`*<>|&~$@]  # escapes, code, emphasis, HTML, cells, entities, strikethrough, formulas, addresses
    | (?<![^\W_])_ | _(?![^\W_])  # emphasis, which does not begin or end within a word
    | (?<=\])[(\[:]  # the address of a link or picture
    | :(?=\S) | (?<=[Ww])\.  # addresses that become links by themselves""",
    re.VERBOSE,
)


class Claim(NamedTuple):
    """A claim, and what became of it; the fields are the columns of the claims' table."""

    claim: str
    paper: str
    ours: str
    n: str
    verdict: Verdict
    rule: str


class Finding(NamedTuple):
    """What a judge found: numbers by label and place, with their digits, and whether each part of the rule holds."""

    measured: Mapping[str, tuple[Mapping[str, Measurement], int]]
    holds: Sequence[bool]


Judge = Callable[[Results, Mapping[str, Any]], Finding]


@cache
def texts() -> dict[str, dict[str, Any]]:
    """The claims as the paper makes them, by id."""
    return tomllib.loads((files(__package__) / "claims.toml").read_text(encoding="utf-8"))


def claims(results: Results) -> tuple[dict[str, Claim], list[str]]:
    """All claims for which there are results, by id, and what is missing for the others, a line each."""
    found, missing = dict[str, Claim](), list[str]()
    for id, text in texts().items():
        try:
            if set(results.fluids) != set(paper.POLICY):
                raise Missing(f"teacher_student: claims are about {', '.join(paper.POLICY)}, not these fluids")
            found[id] = _judged(text, _JUDGES[id](results, text))
        except Missing as error:
            missing.append(str(error))
    return found, list(dict.fromkeys(missing))


def _judged(text: Mapping[str, Any], finding: Finding) -> Claim:
    parts = [part for part in finding.measured.items() if part[1][0]]
    ours = [
        f"{label}: {', '.join(f'{place} {one.text(digits)}' for place, one in numbers.items())}"
        for label, (numbers, digits) in parts
    ]
    counts = sorted({one.n for _, (numbers, _) in parts for one in numbers.values()})
    n = " to ".join(str(count) for count in dict.fromkeys([counts[0], counts[-1]]))
    verdict: Verdict = "reproduced" if all(finding.holds) else "in part" if any(finding.holds) else "not"
    return Claim(text["claim"], text["paper"], "; ".join(ours), n, verdict, text["rule"].format(**text))


def above(measurement: Measurement, bound: float) -> bool:
    """Whether a mean is above a bound with its whole interval."""
    return (measurement.interval or (measurement.mean,))[0] > bound


def below(measurement: Measurement, bound: float) -> bool:
    """Whether a mean is below a bound with its whole interval."""
    return (measurement.interval or (measurement.mean,))[-1] < bound


def rising(measurements: Sequence[Measurement]) -> bool:
    """Whether values rise from each measurement to the next, for every seed."""
    return bool((np.diff([one.values for one in measurements], axis=0) > 0).all())


def _beats_each_fluid(results: Results, text: Mapping[str, Any]) -> Finding:
    own = {fluid: gain(results, fluid) for fluid in results.fluids}
    wider = {fluid: gain(results, fluid, EXTENDED) for fluid in results.fluids}
    alike = {fluid: gain_at_power(results, fluid, text["power"]) for fluid in results.fluids}
    measured = {
        "faster at its own power (%)": (own, 0),
        f"preference-conditioned, at {text['power']:g} W": (alike, 0),
        "than sinusoids of a wider range, at its own power": (wider, 0),
    }
    return Finding(measured, [above(one, 0) for one in (*own.values(), *alike.values())])


def _beats_overall(front: str) -> Judge:
    def judge(results: Results, _: Mapping[str, Any]) -> Finding:
        gains = {name_of(space): gain(results, front, space) for space in (PAPER, EXTENDED)}
        return Finding({"faster at its own power (%) than the": (gains, 0)}, [above(gains[name_of(PAPER)], 0)])

    return judge


def _cheaper_than_switching(results: Results, text: Mapping[str, Any]) -> Finding:
    fastest = results.rows("pareto", "switching", space=PAPER)["speed"].max()
    found = {
        column: {
            f"at {speed:g} m/s": ratio
            for speed in text["speeds"]
            if speed <= fastest and (ratio := power_over_switching(results, speed, column))
        }
        for column in ("power", "positive_power")
    }
    measured = {"change of P (%)": (found["power"], 0), "change of P+ (%)": (found["positive_power"], 0)}
    return Finding(measured, [below(one, 0) for one in found["power"].values()])


def _sea_snake(results: Results, _: Mapping[str, Any]) -> Finding:
    ratios = {
        column: {fluid: times_the_sea_snakes(results, column, fluid) for fluid in results.fluids}
        for column in ("speed", *COSTS)
    }
    measured = {f"{LABELS[column].partition(' ')[0]}, ratio": (ratio, 1) for column, ratio in ratios.items()}
    return Finding(measured, [above(one, 1) for column in ("speed", COSTS[0]) for one in ratios[column].values()])


def _own_fluid(results: Results, _: Mapping[str, Any]) -> Finding:
    speed, cost, positive_cost = (results.in_fluids(column) for column in ("speed", *COSTS))
    measured = {"v (m/s)": (speed, 3), "CoT": (cost, 2), "CoT+": (positive_cost, 2)}
    return Finding(measured, [rising([*speed.values()][::-1]), rising([*cost.values()])])


def _frequency(results: Results, _: Mapping[str, Any]) -> Finding:
    frequency = results.in_fluids("swim_frequency")
    first, *_between, last = frequency.values()
    return Finding({"f (Hz)": (frequency, 3)}, [rising([last, first])])


def _tail(results: Results, _: Mapping[str, Any]) -> Finding:
    tail = results.in_fluids("tail_amplitude")
    first, *_between, last = tail.values()
    return Finding({"tail amplitude (m)": (tail, 3)}, [rising([first, last])])


def _torque(results: Results, text: Mapping[str, Any]) -> Finding:
    torque = results.in_fluids("torque_amplitude")
    means = [one.mean for one in torque.values()]
    alike = max(means) <= text["ratio"] * min(means)
    return Finding({"torque (N m)": (torque, 1)}, [alike, all(text["least"] <= mean <= text["most"] for mean in means)])


def _fixed_sinusoid(results: Results, _: Mapping[str, Any]) -> Finding:
    where: dict[str, Any] = {"gait": "calibration", "engine": "pybullet", "physics_rate": 960, "by": "gait"}
    tails = {
        fluid: results.measure(
            f"fixed sinusoid/{fluid}/tail", "m", "validation", "runs", "tail_amplitude", fluid=fluid, **where
        )
        for fluid in results.fluids
    }
    return Finding({"tail amplitude (m)": (tails, 3)}, [rising([*tails.values()][::-1])])


def _privilege(results: Results, text: Mapping[str, Any]) -> Finding:
    known = results.study("teacher_student").tables["range"]["policy"].unique()
    names = ["teacher", "symmetric", *(name for name in known if name.startswith("symmetric_short"))]
    returns = {name_of(name): mean_return(results, name) for name in names}
    teacher, symmetric = returns["teacher"], returns["symmetric"]
    lower = symmetric.mean < text["share"] * teacher.mean
    return Finding({"return": (returns, 1)}, [above(teacher, symmetric.mean), lower])


def _imitation(results: Results, text: Mapping[str, Any]) -> Finding:
    both = {name: mean_return(results, name) for name in ("student", "teacher")}
    share = combined("student/share of its teacher's return", both, lambda own, taught: 100 * own / taught, "%")
    results.measurements.append(share)
    return Finding({"share of its teacher's return (%)": ({"student": share}, 1)}, [above(share, text["share"])])


def _best_at_home(*columns: str) -> Judge:
    def judge(results: Results, _: Mapping[str, Any]) -> Finding:
        first, last = results.fluids[0], results.fluids[-1]
        measured, holds = dict[str, Any](), list[bool]()
        for column in columns:
            best = {fluid: is_best_at_home(results, fluid, column) for fluid in results.fluids}
            pairs = {f"{a}'s in {b}": replayed(results, a, b, column) for a, b in ((first, last), (last, first))}
            label = LABELS[column].partition(" ")[0]
            measured |= {f"seeds for which it is so by {label} (%)": (best, 0), label: (pairs, 2)}
            holds += [one.mean == 100 for one in best.values()] if column == columns[0] else []
        return Finding(measured, holds)

    return judge


def _adapts(results: Results, text: Mapping[str, Any]) -> Finding:
    longest = recovery(results, "max")
    known = set(results.study("adaptation").tables["switching"]["method"])
    shares = {name_of(kind): share_of_switching(results, kind) for kind in METHOD_NAMES if kind in known}
    measured = {
        "recovery (s)": ({"mean": recovery(results, "mean"), "longest of each seed": longest}, 2),
        "distance as a share of ideal switching (%), between gaits of the": (shares, 0),
    }
    back = max(longest.values) <= text["seconds"]
    return Finding(measured, [back, *(above(share, text["share"]) for share in shares.values())])


_JUDGES: dict[str, Judge] = {
    "beats-each-fluid": _beats_each_fluid,
    "beats-integrated": _beats_overall("integrated"),
    "beats-switching": _beats_overall("simple-sum"),
    "cheaper-than-switching": _cheaper_than_switching,
    "sea-snake": _sea_snake,
    "own-fluid": _own_fluid,
    "frequency": _frequency,
    "tail": _tail,
    "torque": _torque,
    "fixed-sinusoid": _fixed_sinusoid,
    "privilege": _privilege,
    "imitation": _imitation,
    "fastest-at-home": _best_at_home("speed"),
    "cheapest-at-home": _best_at_home(*COSTS),
    "adapts": _adapts,
}


def markdown(judged: Sequence[Claim]) -> str:
    """The claims as a Markdown table without their rules; its cells hold text and nothing else."""
    head = Claim._fields[:-1]
    rows = ["| " + " | ".join(map(_cell, one[:-1])) + " |" for one in judged]
    return "\n".join([f"| {' | '.join(head)} |", "|---" * len(head) + "|", *rows]) + "\n"


def _cell(text: str) -> str:
    """A text that Markdown shows as it is, on one line."""
    return _MARKUP.sub(lambda sign: f"<span>&#{ord(sign[0])};</span>", printable(text))
