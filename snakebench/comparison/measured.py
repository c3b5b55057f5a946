"""What claims are judged by: gains, costs, returns and times of the policies, each followed to its table."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

import pandas as pd

from snakebench.comparison.gain_ledger import front_rows
from snakebench.comparison.quantities import Measurement, Results, policy
from snakebench.comparison.verdicts import ratio
from snakebench.report.equal_power import fastest_within
from snakebench.report.tables import in_both_currencies
from snakebench.store import PAPER
from snakebench.studies.published_fronts import OVERALL

FINE = {"variant": "finer step"}
SHORT = "symmetric_short"  # the symmetric learner with the rollouts of the library that the paper names
_POWERS = {"power": "least power", "positive_power": "P+ of the least power"}


def mean_return(results: Results, name: str) -> Measurement:
    """The return of policies of the paper's reward, by seed, averaged over the range of viscosities."""

    def values(part: pd.DataFrame) -> pd.Series:
        return part.groupby("seed")["return"].mean()

    what = "mean return over the viscosities"
    return results.derived(f"return of {name}", "1", "teacher_student", "range", values, what, policy=name)


def gain(results: Results, place: str, space: str = PAPER) -> Measurement:
    """How much faster the student is than a front of sinusoids at the power of each seed [%].

    `place` is a fluid, or "integrated" or "simple-sum", against which the means over the fluids are held.
    """
    fluids = results.fluids if place in OVERALL else [place]
    table, where = front_rows(place)
    points = results.rows("pareto", table, space=space, **where)

    def values(part: pd.DataFrame) -> pd.Series:
        swims = part[part["fluid"].isin(fluids)].groupby("seed")[["speed", "power"]].mean()
        return pd.Series({k: 100 * (v / _highest(points, p) - 1) for k, (v, p) in swims.T.items()})

    held = f"against pareto/{table}, space = {space}" + (f", front = {place}" if where else "")
    what = f"{', '.join(fluids)}: speed over the highest for at most its power, less 1; {held}"
    name = f"student against {space}, {place}: gain"
    return results.derived(name, "%", "teacher_student", "evaluations", values, what, policy="student", **FINE)


def _highest(points: pd.DataFrame, power: float) -> float:
    """The highest speed within a power [m/s]; NaN where there is none."""
    return float(fastest_within(points, power)["speed"].max())


def gain_with_dial(results: Results, fluid: str, power: float) -> Measurement:
    """How much faster the student with a dial is than the paper's sinusoids, both at a power [%]."""
    points = results.rows("pareto", "fronts", space=PAPER, front=fluid)
    bound = _highest(points, power)

    def values(part: pd.DataFrame) -> pd.Series:
        own = part[part["space"].str.startswith("student ")]
        return 100 * (fastest_within(own, power, ["space"]).set_index("space")["speed"].sort_index() / bound - 1)

    what = f"space = student SEED: highest speed for at most {power:g} W over that of pareto/fronts, space = paper"
    name = f"student with a dial against paper, {fluid}, at {power:g} W: gain"
    return results.derived(name, "%", "learned_front", "fronts", values, what, front=fluid)


def power_over_switching(results: Results, speed: float, column: str) -> Measurement:
    """A power of the student with a dial over that of ideal switching, each of its least P for a mean speed [%]."""

    def least(part: pd.DataFrame) -> float:
        return float(part[part["speed"] >= speed].nsmallest(1, "power")[column].max())

    bound = least(in_both_currencies(results.rows("pareto", "switching", space=PAPER)))

    def values(part: pd.DataFrame) -> pd.Series:
        own = part[part["space"].str.startswith("student ")]
        return own.groupby("space")[["speed", *dict.fromkeys(["power", column])]].apply(
            lambda points: 100 * (least(points) / bound - 1)
        )

    power = _POWERS[column]
    what = f"space = student SEED: {power} for at least {speed:g} m/s over that of pareto/switching, less 1"
    name = f"student with a dial against paper, simple-sum: {column.replace('_', ' ')} at {speed:g} m/s"
    return results.derived(name, "%", "learned_front", "switching", values, what)


def costs_in_fluids(results: Results, column: str) -> list[Measurement]:
    """A cost of transport of the student in every fluid."""
    return [policy(results, column, fluid) for fluid in results.fluids]


def times_the_sea_snakes(results: Results, column: str, fluid: str) -> Measurement:
    """What the policy has of a figure in a fluid, as a multiple of the sea snake's that was tuned to it."""
    where = {"objective": fluid, "fluid": fluid} | FINE
    gait = results.quantity(f"sea snake in {fluid}: {column}", "", "sea_snake", "optima", column, **where)
    return ratio(policy(results, column, fluid), gait.mean)


def short_learners(results: Results) -> list[str]:
    """The learners from short rollouts."""
    names = results.table("teacher_student", "range")["policy"].unique()
    return [str(name) for name in names if str(name).startswith(SHORT)]


def replayed(results: Results, column: str) -> tuple[dict[str, Measurement], dict[str, Measurement]]:
    """By fluid, for how many seeds its own gait is the best one there by a figure; and the figure, far from its own."""
    own, wrong = dict[str, Measurement](), dict[tuple[str, str], Measurement]()
    fast = column == "speed"
    for fluid in results.fluids:

        def first(part: pd.DataFrame, fluid: str = fluid) -> pd.Series:
            by_seed = part.pivot(index="seed", columns="gait_of", values=column).dropna(how="all")
            return ((by_seed.idxmax(axis=1) if fast else by_seed.idxmin(axis=1)) == fluid).astype(float)

        where = {"method": "student", "loop": "open", "fluid": fluid} | FINE
        what = f"whether gait_of = {fluid} is {'the fastest' if fast else 'the lowest'} by {column}"
        own[fluid] = results.derived(f"own gait in {fluid}: {column}", "1", "cross", "matrix", first, what, **where)
        for gait in (name for name in results.fluids if name != fluid):
            name, unit = f"gait of {gait} in {fluid}: {column}", "m/s" if fast else "1"
            wrong[gait, fluid] = results.quantity(name, unit, "cross", "matrix", column, gait_of=gait, **where)
    return own, {f"{a}'s in {b}": wrong[a, b] for a, b in farthest_pairs(results.fluids) if (a, b) in wrong}


def recovery(results: Results, how: Literal["mean", "max"]) -> Measurement:
    """How long the student takes to be back at its steady speed, in the mean or at most, by seed [s]."""

    def values(part: pd.DataFrame) -> pd.Series:
        return part.groupby("seed")["seconds"].agg(how)

    what = {"mean": "the mean of each seed's", "max": "the longest of each seed's"}[how]
    name = {"mean": "student: mean seconds to be back", "max": "student: seconds to be back"}[how]
    return results.derived(name, "s", "adaptation", "recoveries", values, what, method="student")


def switched(results: Results) -> set[str]:
    """The kinds of gaits between which ideal switching was computed."""
    return set(results.table("adaptation", "switching")["method"])


def share_of_switching(results: Results, kind: str) -> Measurement:
    """How far the student gets against ideal switching between gaits of a kind, in the mean over the courses [%]."""
    by_course = results.rows("adaptation", "switching", method=kind).set_index("course")["distance"]

    def values(part: pd.DataFrame) -> pd.Series:
        return (100 * part["distance"] / part["course"].map(by_course)).groupby(part["seed"]).mean()

    what = f"distance over that of adaptation/switching, method = {kind}; mean over the courses"
    name = f"student: distance against ideal switching, {kind}"
    return results.derived(name, "%", "adaptation", "courses", values, what, method="student", **FINE)


def farthest_pairs(fluids: Sequence[str]) -> list[tuple[str, str]]:
    """The two farthest pairs of gait and fluid."""
    return [(fluids[0], fluids[-1]), (fluids[-1], fluids[0])]
