"""What claims are judged by: gains, costs, returns and times of the policies, each followed to its table."""

from __future__ import annotations

from typing import Literal

import pandas as pd

from snakebench.comparison.gain_ledger import front_rows
from snakebench.comparison.results import FINE, Measurement, Results
from snakebench.report.equal_power import fastest_within
from snakebench.store import PAPER
from snakebench.studies.published_fronts import OVERALL

_STUDENT = r"^student "  # at the beginning of `space`, in tables of preference-conditioned policies


def mean_return(results: Results, name: str) -> Measurement:
    """The return of policies of the paper's reward, by seed, averaged over the range of viscosities."""
    return results.measure(f"{name}/return", "1", "teacher_student", "range", "return", policy=name)


def gain(results: Results, place: str, space: str = PAPER) -> Measurement:
    """How much faster the student is than a front of sinusoids at the power of each seed [%].

    `place` is a fluid, or "integrated" or "simple-sum", against which the means over the fluids are held.
    """
    fluids = results.fluids if place in OVERALL else [place]
    table, where = front_rows(place)
    points = results.rows("pareto", table, space=space, **where)

    def values(part: pd.DataFrame) -> pd.Series:
        swims = part[part["fluid"].isin(fluids)].groupby("seed")[["speed", "power"]].mean()
        return pd.Series({seed: 100 * (v / _highest(points, p) - 1) for seed, (v, p) in swims.T.items()})

    front = f"pareto/{table}, space = {space}" + (f", front = {place}" if where else "")
    what = f"{', '.join(fluids)}: speed over the highest for at most its power in {front}, less 1"
    id = f"student/{place}/gain over {space}"
    return results.measure(id, "%", "teacher_student", "evaluations", values, what, policy="student", **FINE)


def _highest(points: pd.DataFrame, power: float) -> float:
    """The highest speed within a power [m/s]; NaN where there is none."""
    return float(fastest_within(points, power)["speed"].max())


def gain_at_power(results: Results, fluid: str, power: float) -> Measurement:
    """How much faster the preference-conditioned student is than the paper's sinusoids, both at a power [%]."""
    bound = _highest(results.rows("pareto", "fronts", space=PAPER, front=fluid), power)

    def values(part: pd.DataFrame) -> pd.Series:
        own = part[part["space"].str.contains(_STUDENT)]
        return 100 * (fastest_within(own, power, ["space"]).set_index("space")["speed"].sort_index() / bound - 1)

    what = f"space = student SEED: highest speed for at most {power:g} W over that of pareto/fronts, space = paper"
    id = f"preference-conditioned student/{fluid}/gain over {PAPER} at {power:g} W"
    return results.measure(id, "%", "learned_front", "fronts", values, what, front=fluid)


def power_over_switching(results: Results, speed: float, column: str) -> Measurement | None:
    """A power of the preference-conditioned student over that of ideal switching, each of its least P for a mean speed.

    In %; None where results of version 1.0 do not have it.
    """

    def least(part: pd.DataFrame) -> float:
        return float(part[part["speed"] >= speed].nsmallest(1, "power")[column].max())

    bound = least(results.rows("pareto", "switching", space=PAPER))
    if pd.isna(bound) or results.rows("learned_front", "switching")[column].isna().all():
        return None

    def values(part: pd.DataFrame) -> pd.Series:
        own = part[part["space"].str.contains(_STUDENT)].groupby("space")
        return own[list({"speed", "power", column})].apply(lambda points: 100 * (least(points) / bound - 1))

    what = f"space = student SEED: {column} of the least power for at least {speed:g} m/s over that of pareto/switching"
    id = f"preference-conditioned student/simple-sum/{column} at {speed:g} m/s"
    return results.measure(id, "%", "learned_front", "switching", values, what)


def times_the_sea_snakes(results: Results, column: str, fluid: str) -> Measurement:
    """A figure of the policy in a fluid as a multiple of that of the sea snake tuned to it."""
    where = {"objective": fluid, "fluid": fluid} | FINE
    gait = results.measure(f"sea snake/{fluid}/{column}", "", "sea_snake", "optima", column, **where)
    own = results.policy(column, fluid)
    return own._replace(values=tuple(value / gait.mean for value in own.values), unit="1")


def is_best_at_home(results: Results, fluid: str, column: str) -> Measurement:
    """Whether a fluid's own gait, replayed, is the best there by a figure, by seed [%]."""

    def values(part: pd.DataFrame) -> pd.Series:
        by_seed = part.pivot(index="seed", columns="gait_of", values=column).dropna(how="all")
        best = by_seed.idxmax(axis=1) if column == "speed" else by_seed.idxmin(axis=1)
        return 100 * (best == fluid).astype(float)

    what = f"whether gait_of = {fluid} is {'the fastest' if column == 'speed' else 'the lowest'} by {column}"
    where = {"method": "student", "loop": "open", "fluid": fluid} | FINE
    return results.measure(f"own gait/{fluid}/best by {column}", "%", "cross", "matrix", values, what, **where)


def replayed(results: Results, gait: str, fluid: str, column: str) -> Measurement:
    """A figure of the gait of a fluid replayed in another."""
    where = {"method": "student", "loop": "open", "fluid": fluid, "gait_of": gait} | FINE
    unit = "m/s" if column == "speed" else "1"
    return results.measure(f"gait of {gait}/{fluid}/{column}", unit, "cross", "matrix", column, **where)


def recovery(results: Results, how: Literal["mean", "max"]) -> Measurement:
    """How long the student takes to be back at its steady speed, in the mean or at most, by seed [s]."""

    def values(part: pd.DataFrame) -> pd.Series:
        return part.groupby("seed")["seconds"].agg(how)

    what = {"mean": "the mean of each seed's", "max": "the longest of each seed's"}[how]
    return results.measure(f"student/recovery/{how}", "s", "adaptation", "recoveries", values, what, method="student")


def share_of_switching(results: Results, kind: str) -> Measurement:
    """How far the student gets against ideal switching between gaits of a kind, in the mean over the courses [%]."""
    by_course = results.rows("adaptation", "switching", method=kind).set_index("course")["distance"]

    def values(part: pd.DataFrame) -> pd.Series:
        return (100 * part["distance"] / part["course"].map(by_course)).groupby(part["seed"]).mean()

    what = f"distance over that of adaptation/switching, method = {kind}; mean over the courses"
    id = f"student/distance/share of switching, {kind}"
    return results.measure(id, "%", "adaptation", "courses", values, what, method="student", **FINE)
