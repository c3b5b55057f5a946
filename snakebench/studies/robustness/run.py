"""Robustness: policies and gaits on robots that differ from their description, one perturbation at a time and all."""

from collections.abc import Iterator, Sequence

import numpy as np
import pandas as pd

from snakebench.channel import perturbed
from snakebench.execution import Case, Evaluator
from snakebench.manifest import MANIFEST
from snakebench.names import ADAPTIVE, INTEGRATED
from snakebench.perturbation import Perturbations, drawn, one_of
from snakebench.studies.contenders import Contender, Contenders, check_distinct, contenders
from snakebench.studies.protocol import Load, Outcome, Swim, loads_of, swim_rows
from snakebench.studies.robustness.areas import NOMINAL, areas
from snakebench.studies.robustness.columns import SHOWN
from snakebench.studies.robustness.settings import RobustnessConfig
from snakebench.tables import EVALUATION

_DIGITS = 9  # of a swept value
_DRAWS = 0  # seed of the combinations


def plan(config: RobustnessConfig) -> list[Load]:
    """What the study evaluates, as if nothing were perturbed, which takes as long; as many gaits as there are."""
    compared = config.expected()
    cases = (Case(one.controller, config.scenario(fluid)) for one, fluid in _places(config, compared))
    return [
        load._replace(times=load.times * times, scenario=load.scenario.but(engine=engine))
        for load in loads_of(cases)
        for engine, times in (
            (config.engine, len(_sweeps(config))),
            (config.verify, config.combinations + len(config.targets)),
        )
        if times
    ]


def run(config: RobustnessConfig, evaluate: Evaluator) -> Outcome:
    """Sweep each perturbation, evaluate random combinations of all, and what should be borne."""
    compared = contenders(config, evaluate.results)
    if config.robust and (evaluate.results / config.robust / MANIFEST).exists():
        robust = Contenders(policies=config.robust, sinusoids="", sea_snakes="", waveforms="")
        compared += contenders(config.but(contenders=robust, pilots=config.robust_pilots), evaluate.results)
        check_distinct(compared)
    draws = _draws(config)
    cases = {"sweeps": _sweeps(config), "combinations": draws, "targets": _targets(config)}
    engines = dict.fromkeys(cases, config.verify) | {"sweeps": config.engine}
    swims = {name: list(_swims(config, compared, part, engines[name])) for name, part in cases.items()}
    evaluate.work.expect(sum(map(len, swims.values())) - sum(load.times for load in plan(config)))
    swum = {name: pd.DataFrame(swim_rows(evaluate, part)) for name, part in swims.items()}
    shown = {name: table.drop(columns=set(EVALUATION) - set(SHOWN), errors="ignore") for name, table in swum.items()}
    tables = shown | {
        "draws": pd.DataFrame(labels | p.model_dump(include=set(config.ranges)) for labels, p in draws),
        "areas": areas(shown["sweeps"]),
        "contenders": pd.DataFrame(one.origin() for one in compared),
    }
    return Outcome(tables)


def _sweeps(config: RobustnessConfig) -> list[tuple[dict[str, object], Perturbations]]:
    """Every perturbation alone, and none; a dead joint is a whole number."""
    rows: list[tuple[dict[str, object], Perturbations]] = [({"perturbation": NOMINAL, "value": 0.0}, Perturbations())]
    for name, (low, high) in config.ranges.items():
        values = np.linspace(low, high, config.steps).round(0 if name == "dead_joint" else _DIGITS)
        for value in np.unique(values).tolist():
            rows.append(({"perturbation": name, "value": value}, one_of(name, value)))
    return rows


def _draws(config: RobustnessConfig) -> list[tuple[dict[str, object], Perturbations]]:
    """Random combinations; each depends on its own number only."""
    ranges = {name: bounds for name, bounds in config.ranges.items() if name not in config.alone}
    numbers = range(config.combinations)
    return [({"draw": k}, drawn(ranges, np.random.default_rng([_DRAWS, k]))) for k in numbers]


def _targets(config: RobustnessConfig) -> list[tuple[dict[str, object], Perturbations]]:
    """What should be borne, by name."""
    return [({"target": name}, target.together()) for name, target in config.targets.items()]


def _swims(
    config: RobustnessConfig,
    compared: Sequence[Contender],
    cases: Sequence[tuple[dict[str, object], Perturbations]],
    engine: str,
) -> Iterator[Swim]:
    """Every contender where it belongs, under every perturbation.

    What is random is the same for the first seed of every contender, and another for its second.
    """
    seeds = {one.method: sorted({other.seed for other in compared if other.method == one.method}) for one in compared}
    for one, fluid in _places(config, compared):
        scenario = config.scenario(fluid, engine=engine)
        for labels, p in cases:
            own = p.but(seed=(p.seed + seeds[one.method].index(one.seed)) % 2**32)
            yield one.labels() | {"fluid": fluid} | labels, Case(*perturbed(one.controller, scenario, own))


def _places(config: RobustnessConfig, compared: Sequence[Contender]) -> Iterator[tuple[Contender, str]]:
    """A policy in every fluid; a gait for all fluids as well, or else, where its kind has none, in its own fluid."""
    for_all = {one.method for one in compared if one.tuned_to == INTEGRATED and one.method}
    for one in compared:
        everywhere = one.tuned_to in (ADAPTIVE, INTEGRATED)
        for fluid in config.fluids if everywhere else (one.tuned_to,):
            if everywhere or one.method not in for_all:
                yield one, fluid
