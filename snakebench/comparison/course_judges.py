"""The judge of the claim that a policy adapts: the student and single gaits through changing fluids, by one rule."""

from collections.abc import Mapping
from functools import partial
from typing import Any

import numpy as np
import pandas as pd

from snakebench.comparison.bounds import by_sign, shifted
from snakebench.comparison.results import Finding, Judge, Measurement, Numbers, Results
from snakebench.names import ADAPTIVE, FINE
from snakebench.report.table import name_of
from snakebench.studies.adaptation import controls as adaptation


def _adapts(results: Results, text: Mapping[str, Any]) -> Finding:
    """The student and the single gaits nearest below its power, by the same rule."""
    results.rows("adaptation", "courses", method="student", variant=FINE)  # which must be there
    by_errors = by_sign(partial(_compared, results))
    swims = by_errors[0]
    single = {
        f"single {name_of(str(name))}": part.assign(seed=0)  # one gait on each course, of whichever seed
        for name, part in adaptation.controls(swims, "student").groupby("method", sort=False)
    }
    policies = [str(name) for name in swims.loc[swims["tuned_to"] == ADAPTIVE, "method"].unique()]
    learned = {name_of(name): by_sign(partial(_of_method, by_errors, name)) for name in policies}
    swimmers = {"student": _of_method(by_errors, "student", 0)} | single
    parts = {name: {0: part} for name, part in single.items()}
    found = {name: _course_numbers(results, name, part) for name, part in (learned | parts).items()}
    passed = {name: _passed(part, found[name], text) for name, part in swimmers.items()}
    never = {name: _never(part[0]) for name, part in (learned | parts).items()}
    measured, others = dict[str, tuple[Numbers, int]](), [name for name in learned if name not in swimmers]
    for prefix, names in (("", swimmers), ("others, ", others)):
        for key, (label, digits, *_) in _COURSE_NUMBERS.items():
            known = {name: found[name][key] for name in names if key in found[name]}
            if key == "recovery/max":
                known = {name + never[name]: number for name, number in known.items()}
            measured[prefix + label] = known, digits
    holds = [*passed["student"], not any(all(passed[name]) for name in single)]
    return Finding(measured, holds, leading=3)


def _never(swims: pd.DataFrame) -> str:
    """How many seeds do not recover after some change, whose recovery has no length."""
    longest = swims.groupby("seed")["recovery"].max()
    lost = int(np.isinf(longest).sum())
    return f" (without {lost} of {len(longest)} seeds, which never did)" if lost else ""


# Of swims through courses: label and digits in the claim, unit, column of `compared`, and how courses are joined. The
# first three are judged.
_COURSE_NUMBERS = {
    "recovery/max": ("longest recovery of each seed (s)", 2, "s", "recovery", "max"),
    "gain/P": ("gain of distance over the best single gait at equal P (%)", 1, "%", "gain_net", "mean"),
    "of limit/P": ("distance as a share of the limit's ideal switching at equal P (%)", 1, "%", "of_limit_net", "mean"),
    "gain/P+": ("the gain at equal P+ (%)", 1, "%", "gain_positive", "mean"),
    "of limit/P+": ("the share at equal P+ (%)", 1, "%", "of_limit_positive", "mean"),
}


def _compared(results: Results, sign: int) -> pd.DataFrame:
    """Swims of the courses, as if errors made policies better (1) or worse (-1) than single gaits, or as is (0)."""
    courses = results.rows("adaptation", "courses").bounded()
    adaptive = courses["tuned_to"] == ADAPTIVE
    either = {side: shifted(courses, side) for side in (sign, -sign)}
    farther = {side: courses["distance"] * (1 + side * courses["speed_bound"]) for side in either}
    sides = {side: part.assign(distance=farther[side]) for side, part in either.items()}
    moved = sides[sign].where(adaptive, sides[-sign])
    return adaptation.compared(results.study("adaptation").tables | {"courses": moved})


def _of_method(swims: Mapping[int, pd.DataFrame], method: str, sign: int) -> pd.DataFrame:
    return swims[sign][swims[sign]["method"] == method]


def _course_numbers(results: Results, name: str, swims: Mapping[int, pd.DataFrame]) -> dict[str, Measurement]:
    """What is known of the swims of a policy or of single gaits through all courses, by seed and sign of the errors."""
    method = swims[0]["method"].iloc[0]
    rows, found = results.rows("adaptation", "courses", method=method, variant=FINE), dict[str, Measurement]()
    for key, (_, _, unit, column, over) in _COURSE_NUMBERS.items():
        values = {
            sign: part.groupby("seed")[column].agg(over, skipna=over == "max").replace(np.inf, np.nan)
            * (100 if unit == "%" else 1)
            for sign, part in swims.items()
        }
        if values[0].notna().any():
            found[key] = rows.measure(f"{name}/{key}", unit, values, f"{over} of {column} over the courses")
    return found


def _passed(swims: pd.DataFrame, numbers: Mapping[str, Measurement], text: Mapping[str, Any]) -> list[bool]:
    """Which parts of the rule hold; one that is not known does not."""
    back = swims["recovery"].max() <= text["seconds"]
    bounds = {"gain/P": text["gain"], "of limit/P": text["share"]}
    return [bool(back), *(key in numbers and numbers[key].above(bound) for key, bound in bounds.items())]


COURSE_JUDGES: dict[str, Judge] = {"adapts": _adapts}  # by the claim's id
