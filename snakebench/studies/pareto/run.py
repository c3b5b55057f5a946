"""Multi-objective study: how fast does a fixed gait swim for its power, per fluid and over all?

The paper does so for sinusoidal torque gaits; others are ours.

Searches on a quick engine propose gaits; every gait that lies on a front is verified in the evaluator; the published
fronts are made of what it measured.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from itertools import islice, product

import numpy as np
import pandas as pd

from snakebench.controllers import Gait
from snakebench.execution import Case, Evaluator
from snakebench.physics.joints import Drives
from snakebench.studies.fronts import front
from snakebench.studies.indicators import (
    OBJECTIVES,
    attained,
    front_tables,
    growth,
    means_by_gait,
    none_valid,
    published_fronts,
    within,
)
from snakebench.studies.pareto.nsga2 import Evolution
from snakebench.studies.pareto.settings import ParetoConfig
from snakebench.studies.planning import Load
from snakebench.studies.search_settings import Space
from snakebench.studies.swim_rows import Row, swim_rows
from snakebench.trajectory import Trajectory

_MEASURED = [*OBJECTIVES, "positive_power", "cost_of_transport", "positive_cost_of_transport"]
_SEARCHED = ["status", "steady", *_MEASURED]
_USUAL_FRONT = 200  # members, for the estimate of time
_MOST_FREQUENCIES = 1000  # of a grid, for the same
_BATCH = 2000  # gaits of a grid evaluated at a time: what is known of more than these takes less memory in a table

Members = dict[tuple[str, str], pd.DataFrame]  # the gaits on a front as searched, by space and objective


def plan(config: ParetoConfig) -> list[Load]:
    """What the study evaluates; how many gaits will have to be verified is a guess."""
    drives = config.proposed([low for low, _ in next(iter(config.spaces.values())).values()]).drives
    return [*_search_loads(config, drives), Load(drives, config.verified(config.fluids[0])[0], _guess(config))]


def run(config: ParetoConfig, evaluate: Evaluator) -> tuple[dict[str, pd.DataFrame], dict[str, Trajectory]]:
    """Search every space, verify what lies on a front, and compare the searches.

    Returns:
        Tables, no trajectories:

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
    members = {
        (space, objective): _members(config, swims, bounds, fluids)
        for space, bounds in config.spaces.items()
        for objective, fluids in config.objectives().items()
    }
    if not any(map(len, members.values())):
        raise none_valid(config.name, swims)
    verified = pd.DataFrame(_verified(config, evaluate, members, swims))
    grid = swims[swims["method"] == "grid"]
    tables = {
        "grid": grid[["space", *config.parameters, "fluid", *_SEARCHED]],
        "verified": verified,
        **front_tables(published_fronts(config, verified), config.fluids, config.reference, config.powers),
        "growth": pd.DataFrame(growth(config, swims)),
        "attainment": pd.DataFrame(attained(config, swims)),
    }
    return {name: table for name, table in tables.items() if len(table)}, {}


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
    """Every swim of every search, in the order of trying."""
    for name, space in config.spaces.items():
        if config.search != "nsga2":
            about: Row = {"space": name, "method": "grid", "kept": True}
            for gaits in _grid(config, space):
                yield _swims(config, evaluate, about, gaits, config.fluids)
        if config.search != "grid":
            for objective, fluids in config.objectives().items():
                for seed in config.seeds:
                    about = {"space": name, "method": "nsga2", "objective": objective, "seed": seed}
                    yield _evolution(config, evaluate, about, seed, space, fluids)


def _evolution(
    config: ParetoConfig, evaluate: Evaluator, about: Row, seed: int, space: Space, fluids: Sequence[str]
) -> pd.DataFrame:
    """Every swim of one search by NSGA-II; `kept` are those of its last population."""
    bounds = np.array([space[name] for name in config.parameters]).T
    search = Evolution(bounds, config.population, config.generations, seed)
    swims = []
    for asked in search.generations():
        new = _swims(config, evaluate, about, [config.proposed(point) for point in asked.tolist()], fluids)
        search.tell(means_by_gait(new, config.parameters, fluids).to_numpy())
        swims.append(new)
    survivors = set(map(tuple, search.survivors().tolist()))
    table = pd.concat(swims, ignore_index=True)
    points = table[config.parameters].itertuples(index=False, name=None)
    return table.assign(kept=[point in survivors for point in points])


def _swims(
    config: ParetoConfig,
    evaluate: Evaluator,
    about: Row,
    gaits: Sequence[Gait],
    fluids: Sequence[str],
) -> pd.DataFrame:
    """How every gait swims in every fluid, as searched."""
    swims = [(gait, fluid) for gait in gaits for fluid in fluids]
    evaluations = evaluate(
        [Case(gait, config.scenario(fluid, duration=config.settling(gait))) for gait, fluid in swims]
    )
    rows = (
        about
        | {name: getattr(gait, name) for name in config.parameters}
        | {"fluid": fluid}
        | evaluation.model_dump(include=set(_SEARCHED))
        for (gait, fluid), evaluation in zip(swims, evaluations, strict=True)
    )
    return pd.DataFrame(rows).astype(dict.fromkeys(_MEASURED, float))  # also where none is defined


def _members(config: ParetoConfig, swims: pd.DataFrame, space: Space, fluids: Sequence[str]) -> pd.DataFrame:
    """The gaits on the front of what the searches hand over within a space, by their mean over the fluids."""
    means = means_by_gait(within(swims[swims["kept"]], space), config.parameters, fluids)
    return means.iloc[front(means.to_numpy())].reset_index()[config.parameters]


def _verified(config: ParetoConfig, evaluate: Evaluator, members: Members, swims: pd.DataFrame) -> Iterator[Row]:
    """Each member once in each of its fluids, in the verifying engine; `_searched` is what the search found."""
    wanted = {
        (fluid, gait): None
        for (_, objective), gaits in members.items()
        for fluid in config.objectives()[objective]
        for gait in gaits.itertuples(index=False, name=None)
    }
    evaluate.expect(len(wanted) - _guess(config))
    columns = ["fluid", *config.parameters, *OBJECTIVES]
    searched = {row[:-2]: row[-2:] for row in swims[columns].itertuples(index=False, name=None)}
    asked = []
    for fluid, parameters in wanted:
        gait = config.proposed(parameters)
        labels = {"fluid": fluid, **dict(zip(config.parameters, parameters, strict=True))}
        asked.append((labels, Case(gait, config.verified(fluid)[0].but(duration=config.settling(gait)))))
    for (fluid, parameters), row in zip(wanted, swim_rows(evaluate, asked), strict=True):
        found = zip(OBJECTIVES, searched[fluid, *parameters], strict=True)
        yield row | {f"{name}_searched": value for name, value in found}
