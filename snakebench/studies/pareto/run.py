"""Multi-objective study: how fast does a fixed gait swim for its power, per fluid and over all?

The paper does so for sinusoidal torque gaits; others are ours.

Searches on a quick engine propose gaits; every gait that lies on a front is verified in the evaluator; the published
fronts are made of what it measured.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Iterator, Sequence
from itertools import islice, product
from typing import Any

import numpy as np
import pandas as pd

from snakebench.controllers import Gait
from snakebench.execution import Case, Evaluator
from snakebench.physics.joints import Drives
from snakebench.studies.dominance import front, hypervolume
from snakebench.studies.indicators import (
    OBJECTIVES,
    SHAPE,
    assembled,
    attainment_rows,
    front_of,
    front_tables,
    means_by_gait,
    none_valid,
)
from snakebench.studies.pareto.nsga2 import evolved
from snakebench.studies.pareto.settings import ParetoConfig
from snakebench.studies.protocol import Load, Outcome, Row, Swim, swim_rows
from snakebench.studies.search_settings import Space
from snakebench.value import FloatArray

_MEASURED = [*OBJECTIVES, "positive_power", "cost_of_transport", "positive_cost_of_transport"]
_SEARCHED = ["status", "steady", *_MEASURED]
_USUAL_FRONT = 200  # members, for the estimate of time
_MOST_FREQUENCIES = 1000  # of a grid, for the same
_BATCH = 2000  # gaits of a grid evaluated at a time: what is known of more than these takes less memory in a table
_CHECKPOINTS = 40  # of the growth of a search

Member = tuple[Any, ...]  # a fluid and the parameters of a gait


def plan(config: ParetoConfig) -> list[Load]:
    """What the study evaluates; how many gaits will have to be verified is a guess."""
    drives, verified = config.fastest_gaits()[0].drives, config.variants(config.fluids[0])["finer step"]
    return [*_search_loads(config, drives), Load(drives, verified, _guess(config))]


def run(config: ParetoConfig, evaluate: Evaluator) -> Outcome:
    """Search every space, verify what lies on a front, and compare the searches.

    Returns:
        Tables:

        - `grid`: every gait of the grids in every fluid, as searched;
        - `verified`: every gait on a front in the front's fluids, as verified, beside what was searched;
        - `fronts`, `switching`, `indicators`: the fronts of each space by what was verified, of each fluid, integrated
          and simple-sum, and what they are worth, as `front_tables`;
        - `growth`: hypervolume of each search against its number of simulations, as searched;
        - `attainment`: what the best, the median and the worst seed of NSGA-II attain, as searched.

    Raises:
        InvalidValue: when no gait swam validly.
    """
    swims = pd.concat(_searches(config, evaluate), ignore_index=True)
    members = _members(config, swims[swims["survivor"]])
    if not members:
        raise none_valid(config.name, swims)
    verified = _verified(config, evaluate, members, swims)
    tables = {
        "grid": swims.loc[swims["method"] == "grid", ["space", *config.parameters, "fluid", *_SEARCHED]],
        "verified": verified,
        **front_tables(_fronts(config, verified), config.fluids, config.reference, config.powers),
        "growth": pd.DataFrame(_growth(config, swims)),
        "attainment": pd.DataFrame(_attained(config, swims)),
    }
    return Outcome(tables)


def _search_loads(config: ParetoConfig, drives: Drives) -> Iterator[Load]:
    for space in config.spaces.values():
        if config.search != "nsga2":
            swims, gaits = math.prod(config.grid) * len(config.fluids), _slow_to_fast(config, space)
            for k, gait in enumerate(gaits):
                scenario = config.scenario(config.fluids[0], duration=config.settling(gait))
                yield Load(drives, scenario, swims // len(gaits) + (k < swims % len(gaits)))
        if config.search != "grid":
            swims = config.population * config.generations * sum(map(len, config.objectives().values()))
            yield Load(drives, config.scenario(config.fluids[0]), swims * len(config.seeds))


def _slow_to_fast(config: ParetoConfig, space: Space) -> list[Gait]:
    """Gaits for all of a grid, of its frequencies: these decide how long each swims."""
    lowest = {name: low for name, (low, _) in space.items()}
    if "frequency" not in lowest:
        return [config.proposed(lowest.values())]
    count = config.grid[config.parameters.index("frequency")]
    frequencies = np.linspace(*space["frequency"], min(count, _MOST_FREQUENCIES)).tolist()
    return [config.proposed((lowest | {"frequency": frequency}).values()) for frequency in frequencies]


def _guess(config: ParetoConfig) -> int:
    return min(_USUAL_FRONT, math.prod(config.grid)) * len(config.spaces) * sum(map(len, config.objectives().values()))


def _grid(config: ParetoConfig, space: Space) -> Iterator[list[Gait]]:
    """The gaits of a grid, in batches."""
    axes = [np.linspace(*space[name], n).tolist() for name, n in zip(config.parameters, config.grid, strict=True)]
    gaits = map(config.proposed, product(*axes))
    while batch := list(islice(gaits, _BATCH)):
        yield batch


def _searches(config: ParetoConfig, evaluate: Evaluator) -> Iterator[pd.DataFrame]:
    for name, space in config.spaces.items():
        if config.search != "nsga2":
            labels: Row = {"space": name, "method": "grid", "survivor": True}
            for gaits in _grid(config, space):
                yield _swims(config, evaluate, labels, gaits, config.fluids)
        if config.search != "grid":
            for objective, fluids in config.objectives().items():
                for seed in config.seeds:
                    labels = {"space": name, "method": "nsga2", "objective": objective, "seed": seed}
                    yield _evolution(config, evaluate, labels, space, seed, fluids)


def _evolution(
    config: ParetoConfig, evaluate: Evaluator, labels: Row, space: Space, seed: int, fluids: Sequence[str]
) -> pd.DataFrame:
    """Every swim of one search by NSGA-II; `survivor` marks the gaits of its last population."""
    swims = []

    def points(generation: FloatArray) -> FloatArray:
        gaits = [config.proposed(point) for point in generation.tolist()]
        swims.append(_swims(config, evaluate, labels, gaits, fluids))
        return means_by_gait(swims[-1], config.parameters, fluids).to_numpy()

    bounds = np.array([space[name] for name in config.parameters]).T
    survivors = evolved(points, bounds, config.population, config.generations, seed)
    table = pd.concat(swims, ignore_index=True)
    survived = pd.MultiIndex.from_frame(table[config.parameters]).isin([*map(tuple, survivors.tolist())])
    return table.assign(survivor=survived)


def _swims(
    config: ParetoConfig, evaluate: Evaluator, labels: Row, gaits: Sequence[Gait], fluids: Sequence[str]
) -> pd.DataFrame:
    swims: list[Swim] = []
    for gait, fluid in product(gaits, fluids):
        parameters = {name: getattr(gait, name) for name in config.parameters}
        scenario = config.scenario(fluid, duration=config.settling(gait))
        swims.append((labels | parameters | {"fluid": fluid}, Case(gait, scenario)))
    table = pd.DataFrame(swim_rows(evaluate, swims))[[*swims[0][0], *_SEARCHED]]
    return table.astype(dict.fromkeys(_MEASURED, float))  # also where none is defined


def _members(config: ParetoConfig, swims: pd.DataFrame) -> list[Member]:
    """The gaits on the front of each space and objective by what was searched, once for each of the front's fluids."""
    members: dict[Member, None] = {}
    for space, fluids in product(config.spaces.values(), config.objectives().values()):
        means = means_by_gait(_within(swims, space), config.parameters, fluids)
        gaits = means.iloc[front(means.to_numpy())].reset_index()[config.parameters].to_numpy().tolist()
        members |= dict.fromkeys((fluid, *gait) for fluid in fluids for gait in gaits)
    return list(members)


def _verified(
    config: ParetoConfig, evaluate: Evaluator, members: Sequence[Member], swims: pd.DataFrame
) -> pd.DataFrame:
    evaluate.work.expect(len(members) - _guess(config))
    columns = ["fluid", *config.parameters]
    asked: list[Swim] = []
    for fluid, *parameters in members:
        gait = config.proposed(parameters)
        scenario = config.variants(fluid)["finer step"].but(duration=config.settling(gait))
        asked.append((dict(zip(columns, (fluid, *parameters), strict=True)), Case(gait, scenario)))
    searched = swims.drop_duplicates(columns, keep="last")[[*columns, *OBJECTIVES]]
    verified = pd.DataFrame(swim_rows(evaluate, asked))
    return verified.merge(searched, how="left", on=columns, suffixes=("", "_searched"))


def _within(swims: pd.DataFrame, space: Space) -> pd.DataFrame:
    """The swims of gaits whose parameters lie within the bounds of a space."""
    return swims[np.logical_and.reduce([swims[name].between(*bounds) for name, bounds in space.items()])]


def _fronts(config: ParetoConfig, verified: pd.DataFrame) -> pd.DataFrame:
    """The fronts of each space by all that was verified within it, as `assembled`."""
    parts = []
    for space, bounds in config.spaces.items():
        swims = _within(verified, bounds)
        fronts = {
            objective: front_of(swims, config.parameters, fluids, SHAPE if len(fluids) == 1 else ())
            for objective, fluids in config.objectives().items()
        }
        parts.append(assembled(space, fronts, config.fluids, config.robot.total_mass))
    return pd.concat(parts, ignore_index=True)


def _growth(config: ParetoConfig, swims: pd.DataFrame) -> Iterator[Row]:
    """Hypervolume of each search, as searched, after so many simulations; a grid's gaits are tried in random order."""
    for labels, n_fluids, points in _by_search(config, swims):
        for count in np.unique(np.linspace(1, len(points), _CHECKPOINTS + 1).astype(int)):
            worth = hypervolume(points[:count], config.reference)
            yield {**labels, "simulations": count * n_fluids, "hypervolume": worth}


def _attained(config: ParetoConfig, swims: pd.DataFrame) -> Iterator[Row]:
    """The attainment surfaces of the seeds of NSGA-II, as searched."""
    fronts = defaultdict(list)
    for labels, _, points in _by_search(config, swims[swims["method"] == "nsga2"]):
        fronts[labels["space"], labels["objective"]].append(points[front(points)])
    for (space, objective), of_seeds in fronts.items():
        yield from attainment_rows(of_seeds, space=space, objective=objective)


def _by_search(config: ParetoConfig, swims: pd.DataFrame) -> Iterator[tuple[Row, int, FloatArray]]:
    """Labels, number of fluids, and points in the order of trying of each search for an objective."""
    for space, (objective, fluids) in product(config.spaces, config.objectives().items()):
        for method, tried in swims[swims["space"] == space].groupby("method"):
            for seed in config.seeds:
                searched = tried if method == "grid" else tried.query("objective == @objective and seed == @seed")
                points = means_by_gait(searched, config.parameters, fluids).to_numpy()
                if method == "grid":
                    points = np.random.default_rng(seed).permutation(points)
                yield {"space": space, "objective": objective, "method": method, "seed": seed}, len(fluids), points
