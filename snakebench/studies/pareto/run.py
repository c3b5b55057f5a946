"""Multi-objective study: how fast does a fixed gait swim for its power, per fluid and over all?

The paper does so for sinusoidal torque gaits; others are ours. Searches on a quick engine propose gaits; every gait on
a front is verified in the evaluator; the published fronts are made of what it measured.
"""

import math
from collections.abc import Iterable, Iterator, Sequence
from itertools import islice, product
from statistics import fmean
from typing import Any

import numpy as np
import pandas as pd
from pymoo.algorithms.moo.nsga2 import NSGA2
from pymoo.core.evaluator import Evaluator as CostEvaluator
from pymoo.core.problem import Problem
from pymoo.operators.crossover.sbx import SBX
from pymoo.operators.mutation.pm import PM
from pymoo.operators.sampling.lhs import LHS
from pymoo.problems.static import StaticProblem

from snakebench.execution import Case, Evaluator
from snakebench.names import FINE
from snakebench.studies import fronts, indicators
from snakebench.studies.indicators import MEASURED
from snakebench.studies.pareto.settings import ParetoConfig
from snakebench.studies.protocol import Load, Outcome, swim_rows
from snakebench.studies.search_settings import Space
from snakebench.value import FloatArray

_ON_FRONT = 2 / 3  # exponent of the number of gaits on a front of a grid of so many, for the estimate of time
_MOST_FREQUENCIES = 1000  # of a grid, for the same
_BATCH = 2000  # gaits of a grid evaluated at a time: what is known of more than these takes less memory in a table
_CHECKPOINTS = 40  # of the growth of a search
# Fronts of gaits come in branches that no small step connects: children are spread wider than by pymoo's own 15 and 20.
_SPREAD = 5
_WORST = 1e6  # cost of what may enter no front; far beyond any other

_SEARCH = ["space", "objective", "currency"]

Member = tuple[Any, ...]  # a fluid and the parameters of a gait
Points = dict[tuple[str, str, str, str, int], FloatArray]  # by space, objective, currency, method and seed of a search


def plan(config: ParetoConfig) -> list[Load]:
    """What the study evaluates; how many gaits will have to be verified is a guess."""
    drives, loads, variants = config.fastest_gaits()[0].drives, [], config.variants(config.fluids[0])
    for space in config.spaces.values():
        if config.search != "nsga2":
            scenario = variants["searched"].but(duration=_mean_duration(config, space))
            loads.append(Load(drives, scenario, math.prod(config.grid) * len(config.fluids)))
        if config.search != "grid":
            gaits = config.population * config.generations * len(config.seeds) * len(config.currencies)
            loads.append(Load(drives, variants["searched"], gaits * sum(map(len, config.objectives().values()))))
    return [*loads, Load(drives, variants[FINE], _guess(config))]


def run(config: ParetoConfig, evaluate: Evaluator) -> Outcome:
    """Search every space, verify what lies on a front, and compare the searches."""
    swims = _rounded(config, pd.concat(_searches(config, evaluate), ignore_index=True))
    members = _members(config, swims[swims["survivor"]])
    if not members:
        raise fronts.none_valid(config.name, swims)
    evaluate.work.expect(len(members) - _guess(config))
    gait = ["fluid", *config.parameters]
    searched = swims.drop_duplicates(gait, keep="last")[[*gait, *MEASURED]]
    verified = _rounded(config, _swims(config, evaluate, FINE, members))
    verified = verified.merge(searched, how="left", on=gait, suffixes=("", "_searched"))
    by_space = {name: _within(verified, space) for name, space in config.spaces.items()}
    points = _points_tried(config, swims)
    known = ["space", *config.parameters, "fluid", "status", "steady", *MEASURED]
    tables = {
        "grid": swims.loc[swims["method"] == "grid", known],
        "verified": verified,
        "growth": _growth(config, points),
        "attainment": _attainment(config, points),
    }
    return Outcome(tables | fronts.front_tables(config, fronts.fronts_of(config, by_space, config.parameters)))


def _mean_duration(config: ParetoConfig, space: Space) -> float:
    """How long the gaits of a grid swim in the mean [s]: their frequencies decide."""
    gaits = [{name: low for name, (low, _) in space.items()}]
    if "frequency" in space:
        count = min(config.grid[config.parameters.index("frequency")], _MOST_FREQUENCIES)
        gaits = [gaits[0] | {"frequency": value} for value in np.linspace(*space["frequency"], count).tolist()]
    return fmean(config.settling(config.proposed(gait.values())) for gait in gaits)


def _guess(config: ParetoConfig) -> int:
    fronts_each = len(config.currencies) * sum(map(len, config.objectives().values()))
    return round(math.prod(config.grid) ** _ON_FRONT) * len(config.spaces) * fronts_each


def _searches(config: ParetoConfig, evaluate: Evaluator) -> Iterator[pd.DataFrame]:
    """Every swim of the searches; `survivor` marks the gaits of which fronts are made."""
    for name, space in config.spaces.items():
        if config.search != "nsga2":
            counts = zip(config.parameters, config.grid, strict=True)
            gaits = product(*(np.linspace(*space[parameter], count).tolist() for parameter, count in counts))
            while batch := list(islice(gaits, _BATCH)):
                yield _tried(config, evaluate, batch, config.fluids).assign(space=name, method="grid", survivor=True)
        if config.search != "grid":
            searches = product(config.objectives().items(), config.currencies, config.seeds)
            for (objective, fluids), currency, seed in searches:
                swims = _evolution(config, evaluate, space, fluids, currency, seed)
                yield swims.assign(space=name, method="nsga2", objective=objective, currency=currency, seed=seed)


def _evolution(
    config: ParetoConfig, evaluate: Evaluator, space: Space, fluids: Sequence[str], currency: str, seed: int
) -> pd.DataFrame:
    """Every swim of one search by NSGA-II, by the power of a currency; `survivor` marks its last population."""
    low, high = np.array([space[name] for name in config.parameters]).T
    problem, swims = Problem(n_var=len(low), n_obj=2, xl=low, xu=high), []
    crossover, mutation = SBX(prob=0.9, eta=_SPREAD), PM(prob=0.9, eta=_SPREAD)
    algorithm = NSGA2(pop_size=config.population, sampling=LHS(), crossover=crossover, mutation=mutation)
    algorithm.setup(problem, termination=("n_gen", config.generations), seed=seed, verbose=False)
    while algorithm.has_next():
        asked = algorithm.ask()
        swims.append(_tried(config, evaluate, asked.get("X").tolist(), fluids))
        points = fronts.means_by_gait(swims[-1], config.parameters, fluids, currency).to_numpy()
        costs = np.nan_to_num(points * (-1, 1), nan=_WORST)
        CostEvaluator().eval(StaticProblem(problem, F=costs), asked)
        algorithm.tell(infills=asked)
    table = pd.concat(swims, ignore_index=True)
    survivors = map(tuple, algorithm.pop.get("X").tolist())
    return table.assign(survivor=pd.MultiIndex.from_frame(table[config.parameters]).isin([*survivors]))


def _tried(
    config: ParetoConfig, evaluate: Evaluator, gaits: Iterable[Sequence[float]], fluids: Sequence[str]
) -> pd.DataFrame:
    """What is known of gaits that a search tries, by their parameters, in each fluid."""
    members = [(fluid, *gait) for gait, fluid in product(gaits, fluids)]
    swims = _swims(config, evaluate, "searched", members)[["fluid", *config.parameters, "status", "steady", *MEASURED]]
    return swims.astype(dict.fromkeys(MEASURED, float))  # also where none is defined


def _swims(config: ParetoConfig, evaluate: Evaluator, variant: str, members: Sequence[Member]) -> pd.DataFrame:
    scenarios, names = {fluid: config.variants(fluid)[variant] for fluid in config.fluids}, config.parameters
    swims = []
    for fluid, *parameters in members:
        gait = config.proposed(parameters)
        labels = {"fluid": fluid, **dict(zip(names, parameters, strict=True))}
        swims.append((labels, Case(gait, scenarios[fluid].but(duration=config.settling(gait)))))
    return pd.DataFrame(swim_rows(evaluate, swims))


def _rounded(config: ParetoConfig, swims: pd.DataFrame) -> pd.DataFrame:
    """Swims with what is measured to six digits, a tenth of the engine's error: tables of grids take half the space."""
    names = [str(name) for name in swims.select_dtypes("float") if name not in config.parameters]
    return swims.assign(**{name: swims[name].map("{:.6g}".format).astype(float) for name in names})


def _within(swims: pd.DataFrame, space: Space) -> pd.DataFrame:
    return swims[np.logical_and.reduce([swims[name].between(*bounds) for name, bounds in space.items()])]


def _members(config: ParetoConfig, swims: pd.DataFrame) -> list[Member]:
    """The gaits on each front by what was searched, in every space and currency, once for each of its fluids."""
    members: dict[Member, None] = {}
    for space, fluids, currency in product(config.spaces.values(), config.objectives().values(), config.currencies):
        means = fronts.means_by_gait(_within(swims, space), config.parameters, fluids, currency)
        gaits = means.iloc[fronts.front(means.to_numpy())].reset_index()[config.parameters].to_numpy().tolist()
        members |= dict.fromkeys((fluid, *gait) for fluid in fluids for gait in gaits)
    return list(members)


def _points_tried(config: ParetoConfig, swims: pd.DataFrame) -> Points:
    """The points of each search in the order of trying; of a grid in random order."""
    found: Points = {}
    every = product(config.spaces, config.objectives().items(), config.currencies)
    for space, (objective, fluids), currency in every:
        for method, tried in swims[swims["space"] == space].groupby("method"):
            for seed in config.seeds:
                search = "objective == @objective and currency == @currency and seed == @seed"
                own = tried if method == "grid" else tried.query(search)
                points = fronts.means_by_gait(own, config.parameters, fluids, currency).to_numpy()
                if method == "grid":
                    points = np.random.default_rng(seed).permutation(points)
                found[space, objective, currency, str(method), seed] = points
    return found


def _growth(config: ParetoConfig, searches: Points) -> pd.DataFrame:
    """Hypervolume of each search after so many simulations: of its points as they are, so that it never falls."""
    parts = {}
    for key, points in searches.items():
        counts = np.unique(np.linspace(1, len(points), _CHECKPOINTS + 1).astype(int))
        volumes = [indicators.hypervolume(points[:count], config.reference, widest=1) for count in counts]
        simulations = counts * len(config.objectives()[key[1]])
        parts[key] = pd.DataFrame({"simulations": simulations, "hypervolume": volumes})
    return fronts.labelled(parts, [*_SEARCH, "method", "seed"])


def _attainment(config: ParetoConfig, searches: Points) -> pd.DataFrame:
    surfaces = {}
    for key in product(config.spaces, config.objectives(), config.currencies):
        of_seeds = [points for search, points in searches.items() if search[:4] == (*key, "nsga2")]
        surfaces[key] = fronts.attainment([points[fronts.front(points)] for points in of_seeds])
    return fronts.labelled(surfaces, _SEARCH)
