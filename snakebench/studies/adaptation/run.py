"""Adaptation study: gaits and policies over viscosity, and in fluids that change in mid-swim (paper, and ours)."""

from collections.abc import Iterator, Sequence
from itertools import chain, product

import numpy as np
import pandas as pd

from snakebench.execution import Case, Evaluator
from snakebench.fluid import Fluid, named_fluid
from snakebench.learning.settings import VISCOSITIES
from snakebench.scenario import Scenario
from snakebench.store import ADAPTIVE, INTEGRATED
from snakebench.studies.adaptation.recovery import Change, course_swim, ideal_swim
from snakebench.studies.adaptation.settings import AdaptationConfig, Course
from snakebench.studies.config import thinning
from snakebench.studies.contenders import Contender, contenders
from snakebench.studies.protocol import Load, Outcome, Row, Swim, loads_of, numerics, swim_rows
from snakebench.trajectory import Trajectory

_CONTENDER = ("method", "tuned_to", "seed")  # what identifies one in a table


def plan(config: AdaptationConfig) -> list[Load]:
    """What the study evaluates; as many gaits as there are at most."""
    expected = config.expected()
    return loads_of(case for _, case in chain(_steady_swims(config, expected), _course_swims(config, expected)))


def run(config: AdaptationConfig, evaluate: Evaluator) -> Outcome:
    """Evaluate everything over viscosity, and policies and integrated gaits on the courses."""
    compared = contenders(config, evaluate.results)
    steady_swims, course_swims = list(_steady_swims(config, compared)), list(_course_swims(config, compared))
    evaluate.work.expect(len(steady_swims) + len(course_swims) - sum(load.times for load in plan(config)))
    steady = pd.DataFrame(swim_rows(evaluate, steady_swims))
    tables = {
        "steady": steady,
        **_through_courses(evaluate, config, course_swims, steady),
        "switching": pd.DataFrame(_switching(config, steady)),
        "contenders": pd.DataFrame(one.origin() for one in compared),
    }
    return Outcome(tables, _shown(config, evaluate, compared))


def _steady_swims(config: AdaptationConfig, compared: Sequence[Contender]) -> Iterator[Swim]:
    media: list[tuple[str | None, Fluid]] = [(name, named_fluid(name)) for name in config.fluids]
    media += [(None, Fluid(kinematic_viscosity=nu)) for nu in np.geomspace(*VISCOSITIES, config.viscosities).tolist()]
    for one, (name, fluid) in product(compared, media):
        labels = {**one.labels(), "fluid": name, "viscosity": fluid.kinematic_viscosity}
        yield labels, Case(one.controller, config.scenario(fluid))


def _course_swims(config: AdaptationConfig, compared: Sequence[Contender]) -> Iterator[Swim]:
    swimmers = [one for one in compared if one.tuned_to in (ADAPTIVE, INTEGRATED)]
    for (name, course), one in product(config.courses.items(), swimmers):
        for variant, scenario in _variants(config, course).items():
            labels = {"course": name, **one.labels(), "variant": variant, **numerics(scenario)}
            yield labels, Case(one.controller, scenario)


def _variants(config: AdaptationConfig, course: Course) -> dict[str, Scenario]:
    fine = config.scenario(course.field(), duration=course.duration)
    return {
        "finer step": fine,
        "coarser step": fine.but(physics_rate=config.coarser),
        "planar": fine.but(engine="planar", physics_rate=config.planar_rate),
    }


def _through_courses(
    evaluate: Evaluator, config: AdaptationConfig, swims: Sequence[Swim], steady: pd.DataFrame
) -> dict[str, pd.DataFrame]:
    by_contender = dict(iter(steady.groupby([*_CONTENDER])))
    own = [by_contender[tuple(labels[name] for name in _CONTENDER)] for labels, _ in swims]
    asked = [
        (case, (labels["variant"] == "finer step", _changes(config.courses[str(labels["course"])], known)))
        for (labels, case), known in zip(swims, own, strict=True)
    ]
    tables: dict[str, list[Row]] = {"courses": [], "recoveries": [], "traces": []}
    for (labels, (_, place)), known, swim in zip(swims, own, evaluate.measured(course_swim, asked), strict=True):
        ideal, *_ = ideal_swim(place.fluid, place.duration, swim["start"], [known])
        tables["courses"].append({**labels, **swim["totals"], "ideal_distance": ideal})
        swimmer = {name: labels[name] for name in ("course", *_CONTENDER)}
        for table in ("recoveries", "traces"):
            tables[table] += [swimmer | row for row in swim[table]]
    return {name: pd.DataFrame(rows) for name, rows in tables.items()}


def _changes(course: Course, own: pd.DataFrame) -> list[Change]:
    """The sudden changes of a course after which a swimmer's steady speed is known; none where it has no rhythm."""
    by_fluid = own.dropna(subset=["fluid", "swim_frequency"]).set_index("fluid")
    return [
        (before, after, start, end, 1 / float(by_fluid["swim_frequency"][after]), float(by_fluid["speed"][after]))
        for before, after, start, end in course.stretches()
        if after in by_fluid.index
    ]


def _switching(config: AdaptationConfig, steady: pd.DataFrame) -> Iterator[Row]:
    tuned = steady[steady["tuned_to"].isin(config.fluids)]
    start = -float(config.robot.link_lengths.sum()) / 2
    searches = tuned.groupby(["method", "seed"], sort=False)
    for (name, course), ((method, seed), of_search) in product(config.courses.items(), searches):
        gaits = [of_gait for _, of_gait in of_search.groupby("tuned_to", sort=False)]
        totals = ideal_swim(course.field(), course.duration, start, gaits)
        means = dict(zip(("speed", "power", "positive_power"), totals / course.duration, strict=True))
        yield {"course": name, "method": method, "seed": seed, "distance": totals[0]} | means


def _shown(config: AdaptationConfig, evaluate: Evaluator, compared: list[Contender]) -> dict[str, Trajectory]:
    firsts = {one.method: one.controller for one in reversed(compared) if one.tuned_to in (ADAPTIVE, INTEGRATED)}
    every = 2 * thinning(config.verify_rate)
    return {
        f"{name}-{method}": evaluate.trajectory(Case(firsts[method], _variants(config, course)["finer step"]), every)
        for (name, course), method in product(config.courses.items(), config.shown)
        if method in firsts
    }
