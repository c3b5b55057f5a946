"""The swims through courses, and the tables that are made of them."""

from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from itertools import product

import numpy as np
import pandas as pd

from snakebench.collocation.ideal import LimitFront, at_power, ideal_curve
from snakebench.execution import Case, Evaluator
from snakebench.names import ADAPTIVE, CURRENCIES, FINE
from snakebench.scenario import Scenario
from snakebench.studies.adaptation.controls import CONTENDER
from snakebench.studies.adaptation.recovery import Change, course_swim, ideal_swim
from snakebench.studies.adaptation.settings import AdaptationConfig, Course
from snakebench.studies.adaptation.swimmers import Swimmers
from snakebench.studies.protocol import Row, Swim, numerics, variants

_DRAWN = 200  # points of a curve of ideal switching that the table has


def places(config: AdaptationConfig, course: Course) -> dict[str, Scenario]:
    """How each course is swum, by variant."""
    return variants(config.scenario(course.field(), duration=course.duration), config.planar_rate)


def planar(config: AdaptationConfig) -> dict[str, Scenario]:
    """Each course in the planar engine."""
    return {name: places(config, course)["planar"] for name, course in config.courses.items()}


def course_swims(config: AdaptationConfig, everyone: Swimmers) -> Iterator[Swim]:
    """Everyone on every course that they swim."""
    for name, course in config.courses.items():
        for one, (variant, scenario) in product(everyone.on(name), places(config, course).items()):
            labels = {"course": name, **one.labels(), "gait": one.gait, "variant": variant, **numerics(scenario)}
            yield labels, Case(one.controller, scenario)


def through_courses(
    evaluate: Evaluator, config: AdaptationConfig, everyone: Swimmers, steady: Sequence[Row]
) -> dict[str, pd.DataFrame]:
    """The tables `courses`, `recoveries` and `traces`, from everyone's steady swims."""
    known = defaultdict[tuple[object, ...], list[Row]](list)
    for row in steady:
        known[_key(row)].append(row)
    swims = list(course_swims(config, everyone))
    own = [pd.DataFrame(known[_key(labels)]) for labels, _ in swims]
    asked = [
        (case, (fine, _changes(config.courses[str(labels["course"])], rows) if fine else []))
        for (labels, case), rows in zip(swims, own, strict=True)
        for fine in [labels["variant"] == FINE]
    ]
    tables: dict[str, list[Row]] = {"courses": [], "recoveries": [], "traces": []}
    for (labels, case), rows, swim in zip(swims, own, evaluate.measured(course_swim, asked), strict=True):
        tables["courses"].append({**labels, **swim["totals"], "ideal_distance": _own_ideal(case, swim["start"], rows)})
        swimmer = {name: labels.get(name) for name in ("course", *CONTENDER)}
        for table in ("recoveries", "traces"):
            tables[table] += [swimmer | row for row in swim[table]]
    return {name: pd.DataFrame(rows) for name, rows in tables.items()}


def _key(labels: Mapping[str, object]) -> tuple[object, ...]:
    return tuple(labels.get(name) for name in CONTENDER)


def _changes(course: Course, own: pd.DataFrame) -> list[Change]:
    """The sudden changes of a course after which a swimmer's steady speed is known; none where it has no rhythm."""
    by_fluid = own.dropna(subset=["fluid", "swim_frequency"]).set_index("fluid")
    return [
        (before, after, start, end, 1 / float(by_fluid["swim_frequency"][after]), float(by_fluid["speed"][after]))
        for before, after, start, end in course.stretches()
        if after in by_fluid.index
    ]


def _own_ideal(case: Case, start: float, steady: pd.DataFrame) -> float | None:
    """The distance at the swimmer's own steady speed [m], if that is known over viscosity."""
    if steady["fluid"].notna().all():
        return None
    return float(ideal_swim(case.scenario.fluid, case.scenario.duration, start, [steady])[0])


def switching(config: AdaptationConfig, steady: pd.DataFrame) -> Iterator[Row]:
    """Ideal switching between the gaits of each method and seed that are tuned to a fluid, on every course."""
    tuned = steady[steady["tuned_to"].isin(config.fluids) & steady["gait"].isna()]
    searches = tuned.groupby(["method", "seed"], sort=False)
    for (name, course), ((method, seed), of_search) in product(config.courses.items(), searches):
        gaits = [of_gait for _, of_gait in of_search.groupby("tuned_to", sort=False)]
        totals = ideal_swim(course.field(), course.duration, _start(config), gaits)
        means = dict(zip(("speed", "power", "positive_power"), totals / course.duration, strict=True))
        yield {"course": name, "method": method, "seed": seed, "distance": totals[0]} | means


def with_limits(
    config: AdaptationConfig, courses: pd.DataFrame, limits: Mapping[str, LimitFront | None]
) -> tuple[pd.DataFrame, pd.DataFrame]:
    """The courses with the distance of the limit's ideal switching at each swimmer's mean power, and its curves."""
    curves = list[pd.DataFrame]()
    for (name, course), (currency, front) in product(config.courses.items(), limits.items()):
        if front is not None:
            curve = ideal_curve(front, course.field(), course.duration, _start(config))
            here = courses["course"] == name
            power = courses.loc[here, CURRENCIES[currency]].to_numpy(float)
            courses.loc[here, f"ideal_{currency}"] = at_power(curve, power)
            drawn = curve[np.unique(np.linspace(0, len(curve) - 1, _DRAWN).round().astype(int))]
            columns = {"course": name, "currency": currency, "power": drawn[:, 0], "distance": drawn[:, 1]}
            curves.append(pd.DataFrame(columns))
    return courses, pd.concat(curves) if curves else pd.DataFrame()


def traced(traces: pd.DataFrame, everyone: Swimmers, singles: pd.DataFrame) -> pd.DataFrame:
    """The traces of the policies compared over viscosity, and of the single gaits that are shown."""
    policies = {one.method for one in everyone.compared if one.tuned_to == ADAPTIVE}
    kept = traces.merge(singles, "left", ["course", *CONTENDER], indicator=True)["_merge"] == "both"
    return traces[kept.to_numpy() | traces["method"].isin(policies)]


def _start(config: AdaptationConfig) -> float:
    """Where the centre of mass is at rest [m]."""
    return -float(config.robot.link_lengths.sum()) / 2
