"""Adaptation study: gaits and policies over viscosity, and in fluids that change in mid-swim (paper, and ours)."""

from collections.abc import Iterator
from itertools import chain, product
from pathlib import Path

import numpy as np
import pandas as pd

from snakebench.collocation.ideal import LimitFront, limit_front
from snakebench.execution import Case, Evaluator
from snakebench.fluid import Fluid, named_fluid
from snakebench.learning.settings import VISCOSITIES
from snakebench.manifest import MANIFEST
from snakebench.names import ADAPTIVE, CURRENCIES, FINE
from snakebench.policy import Policy
from snakebench.studies.adaptation import courses, swimmers
from snakebench.studies.adaptation.controls import CONTENDER, controls
from snakebench.studies.adaptation.settings import AdaptationConfig
from snakebench.studies.adaptation.swimmers import Swimmers
from snakebench.studies.adaptation.worth import worth, worth_swims
from snakebench.studies.contenders import contenders, read_limit
from snakebench.studies.protocol import Load, Outcome, Row, Swim, loads_of, swim_rows

_BOUND = 1.0  # on the target angles of the limit that is compared: that of policies [rad]


def plan(config: AdaptationConfig) -> list[Load]:
    """What the study evaluates, with about as many single gaits as there will be."""
    everyone = swimmers.expected(config)
    planar = (Case(one.controller, place) for one, place in product(everyone.tried, courses.planar(config).values()))
    return loads_of(chain(planar, (case for _, case in _swims(config, everyone))))


def run(config: AdaptationConfig, evaluate: Evaluator) -> Outcome:
    """Evaluate everything over viscosity, and policies and single gaits on the courses."""
    limits = limit_fronts(config, evaluate.results)
    everyone = _swimmers(config, evaluate)
    steady_rows = list(swim_rows(evaluate, _steady_swims(config, everyone)))
    steady = pd.DataFrame(steady_rows)
    swum = courses.through_courses(evaluate, config, everyone, steady_rows)
    fine = swum["courses"][swum["courses"]["variant"] == FINE]
    singles = controls(fine, config.pilots[0])[["course", *CONTENDER]]  # that are shown
    swum["courses"], ideal = courses.with_limits(config, swum["courses"], limits)
    swum["traces"] = courses.traced(swum["traces"], everyone, singles)
    swims = pd.DataFrame(swim_rows(evaluate, worth_swims(config, everyone.tried)))
    tables = {
        "steady": steady,
        **swum,
        "ideal": ideal,
        "switching": pd.DataFrame(courses.switching(config, steady)),
        "worth": pd.DataFrame(worth(config, swims, limits)),
        "contenders": pd.DataFrame(_origins(everyone)),
    }
    return Outcome(tables, dict(_shown(config, everyone, singles)))


def limit_fronts(config: AdaptationConfig, results: Path) -> dict[str, LimitFront | None]:
    """The fronts of the limit by currency; None where there are no results of it."""
    if not config.limit or not (results / config.limit / MANIFEST).exists():
        return dict.fromkeys(CURRENCIES)
    limit, _gaits, _settings = read_limit(config, results, config.limit)
    return {currency: limit_front(limit, currency, _BOUND) for currency in CURRENCIES}


def _swimmers(config: AdaptationConfig, evaluate: Evaluator) -> Swimmers:
    """Everyone, from the published results of other studies; candidates are chosen in the planar engine."""
    results, places = evaluate.results, courses.planar(config)
    compared, preferred = contenders(config, results), swimmers.preferred(config, results)
    tried = swimmers.candidates(config, results)
    everyone = Swimmers(compared, preferred, tried, swimmers.chosen(evaluate, tried, places))
    needed = len(tried) * len(places) + len(list(_swims(config, everyone)))
    evaluate.work.expect(needed - sum(load.times for load in plan(config)))
    return everyone


def _swims(config: AdaptationConfig, everyone: Swimmers) -> Iterator[Swim]:
    yield from _steady_swims(config, everyone)
    yield from courses.course_swims(config, everyone)
    yield from worth_swims(config, everyone.tried)


def _steady_swims(config: AdaptationConfig, everyone: Swimmers) -> Iterator[Swim]:
    named: list[tuple[str | None, Fluid]] = [(name, named_fluid(name)) for name in config.fluids]
    range_ = [(None, Fluid(kinematic_viscosity=nu)) for nu in np.geomspace(*VISCOSITIES, config.viscosities).tolist()]
    asked = chain(product(everyone.compared, [*named, *range_]), product(everyone.further(), named))
    for one, (name, fluid) in asked:
        labels = {**one.labels(), "gait": one.gait, "fluid": name, "viscosity": fluid.kinematic_viscosity}
        yield labels, Case(one.controller, config.scenario(fluid))


def _origins(everyone: Swimmers) -> Iterator[Row]:
    """What identifies everyone, whose results they are from, and the prices of preference-conditioned policies."""
    for one in (*everyone.compared, *everyone.further()):
        policy = one.controller if isinstance(one.controller, Policy) else None
        price = policy.price if policy and policy.card.prices else None
        yield one.origin() | {"gait": one.gait, "price": price}


def _shown(config: AdaptationConfig, everyone: Swimmers, singles: pd.DataFrame) -> Iterator[tuple[str, Case]]:
    """Swims of the first seed of policies, and of the single gait of a method that is shown on the course."""
    for (name, course), method in product(config.courses.items(), config.shown):
        numbers = singles.loc[(singles["course"] == name) & (singles["method"] == method), "gait"]
        of_method = [one for one in everyone.on(name) if one.method == method]
        wanted = [one for one in of_method if one.tuned_to == ADAPTIVE or one.gait is None or one.gait in set(numbers)]
        if wanted:
            yield f"{name}-{method}", Case(wanted[0].controller, courses.places(config, course)[FINE])
