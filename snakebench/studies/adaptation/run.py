"""Adaptation study: gaits and policies over viscosity, and in fluids that change in mid-swim (paper, and ours).

Beside what swims stands what an ideal would do that is at every moment at its steady state: a policy that loses nothing
by a change, and gaits that are switched at once to the one that is fastest in the present fluid.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from itertools import chain, product
from typing import Any

import numpy as np
import pandas as pd

from snakebench import metrics
from snakebench.execution import Case, Evaluator
from snakebench.fluid import Fluid, named_fluid
from snakebench.learning.settings import VISCOSITIES
from snakebench.scenario import Scenario
from snakebench.store import ADAPTIVE, INTEGRATED
from snakebench.studies.adaptation.recovery import Change, between_viscosities, course_swim, ideal_swim, ideal_switching
from snakebench.studies.adaptation.settings import AdaptationConfig, Course
from snakebench.studies.config import thinning
from snakebench.studies.contenders import Contender, contenders
from snakebench.studies.outcome import Outcome
from snakebench.studies.planning import Load
from snakebench.studies.swim_rows import Row, Swim, loads_of, numerics, swim_rows
from snakebench.trajectory import Trajectory

_CONTENDER = ("method", "tuned_to", "seed")  # what identifies one in a table


def plan(config: AdaptationConfig) -> list[Load]:
    """What the study evaluates; as many gaits as there are at most."""
    expected = config.expected()
    return loads_of(case for _, case in chain(_steady_swims(config, expected), _course_swims(config, expected)))


def run(config: AdaptationConfig, evaluate: Evaluator) -> Outcome:
    """Swim everything over viscosity, and policies and integrated gaits through the courses.

    Returns:
        Tables and swims:

        - `steady`: every contender in every fluid (named) and over viscosities, in PyBullet at the published rate;
        - `courses`: distance [m], mean speed [m/s] and both powers [W] of every policy and integrated gait in every
          course, in PyBullet at two rates and in planar; `ideal_distance` is what the same swimmer would make if it
          were at every moment at its steady state;
        - `switching`: the same of ideal switching among the gaits of a kind, each tuned to a fluid;
        - `recoveries`: after every sudden change, how many `seconds` until a swimmer is back within 5 % of its own
          steady speed, over whole gait periods, and the share of the time that it is `held` there;
        - `traces`: speed and both powers over time, means over a second around it;
        - `contenders`: what was compared, and where it comes from;
        - COURSE-METHOD: those `shown` swimming, 30 rows a second.

    Raises:
        InvalidValue: when the results of a study to be compared are missing.
    """
    compared = contenders(config, evaluate.results)
    steady_swims, course_swims = list(_steady_swims(config, compared)), list(_course_swims(config, compared))
    evaluate.work.expect(len(steady_swims) + len(course_swims) - sum(load.times for load in plan(config)))
    steady = pd.DataFrame(swim_rows(evaluate, steady_swims))
    tables = {
        "steady": steady,
        **_through_courses(config, evaluate, course_swims, steady),
        "switching": pd.DataFrame(_switching(config, steady)),
        "contenders": pd.DataFrame(one.origin() for one in compared),
    }
    return Outcome(tables, dict(_shown(config, evaluate, compared)))


def _steady_swims(config: AdaptationConfig, compared: Sequence[Contender]) -> Iterator[Swim]:
    """Every contender in the fluids by name and over viscosities."""
    viscosities = np.geomspace(*VISCOSITIES, config.viscosities).tolist()
    media = [
        *((name, named_fluid(name)) for name in config.fluids),
        *((None, Fluid(kinematic_viscosity=viscosity)) for viscosity in viscosities),
    ]
    for one, (name, fluid) in product(compared, media):
        labels = {**one.labels(), "fluid": name, "viscosity": fluid.kinematic_viscosity}
        yield labels, Case(one.controller, config.scenario(fluid))


def _course_swims(config: AdaptationConfig, compared: Sequence[Contender]) -> Iterator[Swim]:
    """Every policy and integrated gait in every course and variant."""
    swimmers = [one for one in compared if one.tuned_to in (ADAPTIVE, INTEGRATED)]
    for (name, course), one in product(config.courses.items(), swimmers):
        for variant, scenario in _variants(config, course).items():
            labels = {"course": name, **one.labels(), "variant": variant, **numerics(scenario)}
            yield labels, Case(one.controller, scenario)


def _variants(config: AdaptationConfig, course: Course) -> dict[str, Scenario]:
    """Where a swim through a course is made."""
    fine = config.scenario(course.field(), duration=course.duration)
    return {
        "finer step": fine,
        "coarser step": fine.but(physics_rate=config.coarser),
        "planar": fine.but(engine="planar", physics_rate=config.planar_rate),
    }


def _through_courses(
    config: AdaptationConfig, evaluate: Evaluator, swims: Sequence[Swim], steady: pd.DataFrame
) -> dict[str, pd.DataFrame]:
    """The tables `courses`, `recoveries` and `traces`."""
    by_contender = dict(iter(steady.groupby([*_CONTENDER])))
    own = [by_contender[tuple(labels[name] for name in _CONTENDER)] for labels, _ in swims]
    asked = [
        (case, (labels["variant"] == "finer step", _changes(config.courses[str(labels["course"])], known)))
        for (labels, case), known in zip(swims, own, strict=True)
    ]
    tables: dict[str, list[Row]] = {"courses": [], "recoveries": [], "traces": []}
    for (labels, (_, place)), known, swim in zip(swims, own, evaluate.measured(course_swim, asked), strict=True):
        ideal, *_ = ideal_swim(place.fluid, place.duration, between_viscosities(known), swim["start"])
        tables["courses"].append({**labels, **_totals(config, swim, place.duration), "ideal_distance": ideal})
        swimmer = {name: labels[name] for name in ("course", *_CONTENDER)}
        for table in ("recoveries", "traces"):
            tables[table] += [swimmer | row for row in swim[table]]
    return {name: pd.DataFrame(rows) for name, rows in tables.items()}


def _totals(config: AdaptationConfig, swim: Mapping[str, Any], duration: float) -> dict[str, object]:
    """Distance, mean speed, powers and costs of transport of a whole swim from rest."""
    speed, power, positive = (total / duration for total in (swim["distance"], swim["work"], swim["positive_work"]))
    mass = config.robot.total_mass
    return {
        "status": "diverged" if swim["diverged"] else "ok",
        "distance": swim["distance"],
        "speed": speed,
        "power": power,
        "positive_power": positive,
        "cost_of_transport": metrics.cost_of_transport(power, speed, mass),
        "positive_cost_of_transport": metrics.positive_cost_of_transport(power, positive, speed, mass),
        "stray": swim["stray"],
    }


def _changes(course: Course, own: pd.DataFrame) -> list[Change]:
    """The sudden changes of a course after which a swimmer's steady speed is known; none where it has no rhythm."""
    by_fluid = own.dropna(subset=["fluid", "swim_frequency"]).set_index("fluid")
    return [
        (before, after, start, end, 1 / float(by_fluid["swim_frequency"][after]), float(by_fluid["speed"][after]))
        for before, after, start, end in course.stretches()
        if after in by_fluid.index
    ]


def _switching(config: AdaptationConfig, steady: pd.DataFrame) -> Iterator[Row]:
    """Ideal switching among the gaits of each kind that are tuned to a fluid."""
    tuned = steady[steady["tuned_to"].isin(config.fluids)]
    start = -float(config.robot.link_lengths.sum()) / 2
    for (name, course), (method, of_method) in product(config.courses.items(), tuned.groupby("method", sort=False)):
        gaits = [between_viscosities(of_gait) for _, of_gait in of_method.groupby("tuned_to", sort=False)]
        totals = ideal_swim(course.field(), course.duration, ideal_switching(gaits), start)
        means = dict(zip(("speed", "power", "positive_power"), totals / course.duration, strict=True))
        yield {"course": name, "method": method, "distance": totals[0]} | means


def _shown(
    config: AdaptationConfig, evaluate: Evaluator, compared: Sequence[Contender]
) -> Iterator[tuple[str, Trajectory]]:
    firsts = {one.method: one.controller for one in reversed(compared) if one.tuned_to in (ADAPTIVE, INTEGRATED)}
    for (name, course), method in product(config.courses.items(), config.shown):
        if method in firsts:
            case = Case(firsts[method], _variants(config, course)["finer step"])
            yield f"{name}-{method}", evaluate.trajectory(case, 2 * thinning(config.verify_rate))
