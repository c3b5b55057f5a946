"""Fourier study: CMA-ES tunes a free periodic waveform of target angles, per fluid and for all: the open-loop bound.

It maximises the return J, and 10 v - price P at several prices of power, which trace a front of speed and power (ours).
It separates what a learned policy gains by the free waveform, by feedback, and by knowing the fluid.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import chain, product

import pandas as pd

from snakebench.errors import InvalidValue
from snakebench.execution import Case, Evaluator
from snakebench.studies import fronts
from snakebench.studies.config import thinning
from snakebench.studies.fourier.settings import FourierConfig
from snakebench.studies.fourier.waveforms import WORST, Goal, Tuning, before, budget, goals
from snakebench.studies.outcome import Outcome
from snakebench.studies.planning import Load
from snakebench.studies.swim_rows import Row, Swim, numerics, swim_rows

_SEARCH = ["tuned_to", "harmonics", "objective", "price", "seed"]


def plan(config: FourierConfig) -> list[Load]:
    """What the study evaluates, if every budget is enough for a generation."""
    swims = len(config.seeds) * sum(len(fluids) for fluids in config.objectives().values())
    optima = len(goals(config))
    gaits = {"searched": optima + sum(budget(config, goal)[1] for goal in goals(config))}
    return [
        Load("angle", scenario, swims * gaits.get(variant, optima))
        for variant, scenario in config.variants(config.fluids[0]).items()
    ]


def run(config: FourierConfig, evaluate: Evaluator) -> Outcome:
    """Search for every goal in each fluid, and in all of several at once, with every seed; and verify each optimum.

    Returns:
        Tables and the runs that the report shows; `tuned_to` is a fluid, or "integrated" for the mean over all:

        - `growth`: the best value found so far, one row a generation; `gaits` counts those tried, with those of the
          same objective with fewer harmonics, which the search continues;
        - `optima`: the best gait of every search in each of its fluids, as searched and verified with a coarser and a
          finer step, with the objective's value as searched;
        - `gaits`: the Fourier coefficients of these gaits, one row a joint and harmonic;
        - `fronts`, `switching`, `indicators`: of all optima as `front_tables`, whatever they were tuned to;
        - FLUID, integrated-FLUID: the gait of the highest J there, or in all fluids, swimming, 60 rows a second.

    Raises:
        InvalidValue: when no gait of a search swam validly.
    """
    searches, growth = _searched(config, evaluate)
    optima = pd.DataFrame(swim_rows(evaluate, _verified(config, searches)))
    points = fronts.fronts_of(config, {"fourier": fronts.beside_searched(optima, "searched")}, _SEARCH)
    tables = {
        "growth": pd.DataFrame(growth),
        "optima": optima,
        "gaits": pd.DataFrame(row for search in searches for row in _coefficients(search)),
        **fronts.front_tables(config, points),
    }
    shown, every = _shown(config, searches), thinning(config.verify_rate)
    return Outcome(tables, {name: evaluate.trajectory(case, every) for name, case in shown})


def _searched(config: FourierConfig, evaluate: Evaluator) -> tuple[list[Tuning], list[Row]]:
    """All searches, done, and the table `growth`; each starts from the earlier ones of the same objective and seed."""
    by_goal: dict[Goal, list[Tuning]] = {}
    growth: list[Row] = []
    for goal in goals(config):
        earlier = [by_goal[other] for other in before(config, goal)]
        by_goal[goal] = [
            Tuning(config, goal, tuned_to, seed, [searches[place] for searches in earlier])
            for place, (tuned_to, seed) in enumerate(product(config.objectives(), config.seeds))
        ]
        growth += _advance(config, evaluate, by_goal[goal])
    return list(chain.from_iterable(by_goal.values())), growth


def _advance(config: FourierConfig, evaluate: Evaluator, searches: list[Tuning]) -> Iterator[Row]:
    """Let searches of one goal advance together through their budget; large batches keep all workers busy."""
    generations, _ = budget(config, searches[0].goal)
    for _ in range(1 + generations):
        asked = [search.ask() for search in searches]
        evaluations = iter(evaluate([case for cases in asked for case in cases]))
        for search, cases in zip(searches, asked, strict=True):
            search.tell([next(evaluations) for _ in cases])
            yield search.labels() | {"gaits": search.tried, "best": search.value}
    for search in searches:
        if search.value == WORST:
            raise InvalidValue(
                f"{config.name}: no gait swam validly in {' and '.join(search.fluids)}: other fluids, other bounds of"
                " the frequency, more trials or a longer duration are needed"
            )


def _verified(config: FourierConfig, searches: list[Tuning]) -> Iterator[Swim]:
    """The optimum of every search in each of its fluids and every variant."""
    for search in searches:
        for fluid in search.fluids:
            for variant, scenario in config.variants(fluid).items():
                labels = search.labels() | {"value": search.value, "fluid": fluid, "variant": variant}
                yield labels | numerics(scenario), search.case(search.gait(), scenario)


def _coefficients(search: Tuning) -> Iterator[Row]:
    gait = search.gait()
    for harmonic, (cosines, sines) in enumerate(zip(gait.cosine, gait.sine, strict=True), start=1):
        for joint, (cosine, sine) in enumerate(zip(cosines, sines, strict=True), start=1):
            place = {"frequency": gait.frequency, "joint": joint, "harmonic": harmonic}
            yield search.labels() | place | {"cosine": cosine, "sine": sine}


def _shown(config: FourierConfig, searches: list[Tuning]) -> Iterator[tuple[str, Case]]:
    """The gait of the highest return of each objective in its fluids, by name."""
    for tuned_to, fluids in config.objectives().items():
        of_return = [search for search in searches if search.tuned_to == tuned_to and search.goal.price is None]
        best = max(of_return, key=lambda search: search.value)
        for fluid in fluids:
            name = fluid if tuned_to == fluid else f"{tuned_to}-{fluid}"
            yield name, best.case(best.gait(), config.variants(fluid)["finer step"])
