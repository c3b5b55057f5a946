"""Adaptation study: gaits and policies over viscosity, and in fluids that change in mid-swim (paper, and ours).

Beside what swims stands what an ideal would do that is at every moment at its steady state: a policy that loses nothing
by a change, and gaits that are switched at once to the one that is fastest in the present fluid.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd

from snakebench import metrics
from snakebench.execution import Case, Evaluator
from snakebench.fluid import Fluid, named_fluid
from snakebench.learning.settings import VISCOSITIES
from snakebench.scenario import Scenario
from snakebench.store import ADAPTIVE, INTEGRATED
from snakebench.studies.adaptation.recovery import (
    Change,
    Steady,
    between_viscosities,
    course_swim,
    fastest,
    ideal_swim,
)
from snakebench.studies.adaptation.settings import AdaptationConfig, Course
from snakebench.studies.config import thinning
from snakebench.studies.contenders import SINUSOIDS, Contender, contenders
from snakebench.studies.planning import Load
from snakebench.trajectory import Trajectory


def plan(config: AdaptationConfig) -> list[Load]:
    """What the study evaluates; as many gaits as there are at most."""
    count, scenario = config.expected(), config.scenario(config.fluids[0])
    places = len(config.fluids) + config.viscosities
    loads = [Load("angle", scenario, count["angle"] * places), Load("torque", scenario, count["torque"] * places)]
    swims = _most_on_courses(config)
    for course in config.courses.values():
        loads += [Load("angle", here.but(fluid=course.field()), swims) for here in _variants(config, course).values()]
    return [load for load in loads if load.times]


def run(config: AdaptationConfig, evaluate: Evaluator) -> tuple[dict[str, pd.DataFrame], dict[str, Trajectory]]:
    """Swim everything over viscosity, and policies and integrated gaits through the courses.

    Returns:
        Tables, and the runs that the report shows:

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
        InvalidValue: when what is to be compared was not found yet.
    """
    compared = contenders(config, evaluate.results)
    steady = pd.DataFrame(_steadily(config, evaluate, compared))
    on_courses = [one for one in compared if one.tuned_to in (ADAPTIVE, INTEGRATED)]
    frames = {"steady": steady} | _through_courses(config, evaluate, on_courses, steady)
    frames["switching"] = pd.DataFrame(_switching(config, compared, steady))
    frames["contenders"] = pd.DataFrame(one.origin() for one in compared)
    return {name: table for name, table in frames.items() if len(table)}, dict(_shown(config, evaluate, on_courses))


def _through_courses(
    config: AdaptationConfig, evaluate: Evaluator, on_courses: Sequence[Contender], steady: pd.DataFrame
) -> dict[str, pd.DataFrame]:
    """The tables `courses`, `recoveries` and `traces`."""
    asked = [
        (name, one, variant, scenario)
        for name, course in config.courses.items()
        for one in on_courses
        for variant, scenario in _variants(config, course).items()
    ]
    evaluate.expect(len(asked) - _most_on_courses(config) * 3 * len(config.courses))
    own = [_of(steady, one) for _, one, _, _ in asked]
    swims = evaluate.measured(
        course_swim,
        [
            (Case(one.controller, scenario), (variant == "finer step", _paces(config.courses[name], known)))
            for (name, one, variant, scenario), known in zip(asked, own, strict=True)
        ],
    )
    tables: dict[str, list[dict[str, object]]] = {"courses": [], "recoveries": [], "traces": []}
    for (name, one, variant, scenario), known, swim in zip(asked, own, swims, strict=True):
        about = {"course": name} | one.about()
        ideal, *_ = ideal_swim(scenario.fluid, scenario.duration, between_viscosities(known), swim["start"])
        numerics = {"variant": variant, "engine": scenario.engine, "physics_rate": scenario.physics_rate}
        totals = _totals(config, swim, scenario.duration) | {"ideal_distance": ideal}
        tables["courses"].append(about | numerics | totals)
        for table in ("recoveries", "traces"):
            tables[table] += [about | row for row in swim[table]]
    return {name: pd.DataFrame(rows) for name, rows in tables.items()}


def _most_on_courses(config: AdaptationConfig) -> int:
    found = config.found
    gaits = len(SINUSOIDS) * bool(found.sinusoids) + bool(found.sea_snakes) + bool(found.waveforms) + len(found.gaits)
    return config.n_policies + gaits


def _variants(config: AdaptationConfig, course: Course) -> dict[str, Scenario]:
    """Where a swim through a course is made."""
    fine = config.scenario(course.field(), duration=course.duration)
    return {
        "finer step": fine,
        "coarser step": fine.but(physics_rate=config.coarser),
        "planar": fine.but(engine="planar", physics_rate=config.planar_rate),
    }


def _steadily(config: AdaptationConfig, evaluate: Evaluator, compared: Sequence[Contender]) -> Iterator[dict[str, Any]]:
    """Every contender in the fluids by name and over viscosities."""
    media: list[tuple[str | None, Fluid]] = [(name, named_fluid(name)) for name in config.fluids]
    over = np.geomspace(*VISCOSITIES, config.viscosities).tolist()
    media += [(None, Fluid(kinematic_viscosity=viscosity)) for viscosity in over]
    asked = [(one, name, fluid) for one in compared for name, fluid in media]
    evaluate.expect(len(asked) - sum(config.expected().values()) * len(media))
    cases = [Case(one.controller, config.scenario(fluid)) for one, _, fluid in asked]
    for (one, name, fluid), evaluation in zip(asked, evaluate(cases), strict=True):
        place = {"fluid": name, "viscosity": fluid.kinematic_viscosity}
        yield one.about() | place | evaluation.model_dump()


def _of(steady: pd.DataFrame, one: Contender) -> pd.DataFrame:
    """The steady swims of a contender."""
    about = one.about()
    return steady[np.logical_and.reduce([steady[name] == value for name, value in about.items()])]


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


def _paces(course: Course, own: pd.DataFrame) -> list[Change]:
    """The sudden changes of a course at which a swimmer's pace afterwards is known; none where it has no rhythm."""
    by_fluid = own.dropna(subset=["fluid", "swim_frequency"]).set_index("fluid")
    changes = []
    for before, after, start, end in course.stretches():
        if after in by_fluid.index:
            speed, frequency = by_fluid.loc[[after], ["speed", "swim_frequency"]].to_numpy()[0].tolist()
            changes.append(Change(before, after, start, end, 1 / frequency, speed))
    return changes


def _switching(
    config: AdaptationConfig, compared: Sequence[Contender], steady: pd.DataFrame
) -> Iterator[dict[str, object]]:
    """Ideal switching among the gaits of each kind that are tuned to a fluid."""
    tuned: dict[str, dict[str, Steady]] = {}
    for one in compared:
        if one.tuned_to in config.fluids:
            tuned.setdefault(one.method, {})[one.tuned_to] = between_viscosities(_of(steady, one))
    start = -float(config.robot.link_lengths.sum()) / 2
    for name, course in config.courses.items():
        for method, gaits in tuned.items():
            totals = ideal_swim(course.field(), course.duration, fastest(gaits), start)
            speed, power, positive = (total / course.duration for total in totals)
            means = {"speed": speed, "power": power, "positive_power": positive}
            yield {"course": name, "method": method, "distance": totals[0]} | means


def _shown(
    config: AdaptationConfig, evaluate: Evaluator, on_courses: Sequence[Contender]
) -> Iterator[tuple[str, Trajectory]]:
    """The swims that the report plays."""
    firsts = {one.method: one for one in reversed(on_courses)}
    for name, course in config.courses.items():
        for method in (one for one in config.shown if one in firsts):
            case = Case(firsts[method].controller, _variants(config, course)["finer step"])
            yield f"{name}-{method}", evaluate.trajectory(case, 2 * thinning(config.verify_rate))
