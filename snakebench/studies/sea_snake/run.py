"""Single-objective study: Optuna's TPE tunes the sea-snake gait to the return J, per fluid and for the mean (paper).

Beside it other samplers search with the same budget, on a quick engine, and their best gaits are verified (ours).
"""

from collections.abc import Iterator, Sequence
from itertools import product
from typing import Any

import pandas as pd

from snakebench.controllers import SeaSnake
from snakebench.errors import InvalidValue
from snakebench.evaluation import Evaluation
from snakebench.execution import Case, Evaluator
from snakebench.fluid import named_fluid
from snakebench.names import FINE
from snakebench.scenario import Scenario
from snakebench.studies.fronts import none_valid
from snakebench.studies.protocol import Load, Outcome, numerics, swim_rows
from snakebench.studies.samplers import CHOOSING_SECONDS, Search, StoredStudies, check_samplers
from snakebench.studies.sea_snake.settings import SeaSnakeConfig

_PARAMETERS = list(SeaSnake.SPACE)
_SEARCH = ["sampler", "objective", "seed"]


def plan(config: SeaSnakeConfig) -> list[Load]:
    """What the study evaluates, if every sampler can be used here."""
    check_samplers(config.compared)
    compared = _loads(config.comparison(), config.compared, neutral=False) if config.compared else []
    return [*_loads(config, ["tpe"], neutral=True), *compared]


def run(config: SeaSnakeConfig, evaluate: Evaluator, stored: StoredStudies | None = None) -> Outcome:
    """Search for every objective and seed, verify each optimum, and compare samplers; `stored` shows all searches."""
    trials = _tried(config, evaluate, ["tpe"], stored)
    if trials["value"].isna().all():
        raise none_valid(config.name, trials)
    optima = _verified(config, evaluate, trials, neutral=True)
    tables = {"trials": trials.drop(columns="sampler"), "optima": optima.drop(columns="sampler")}
    if config.compared:
        comparison = config.comparison()
        tried = _tried(comparison, evaluate, config.compared, stored)
        if tried["value"].isna().all():
            raise InvalidValue(f"{config.name}: no gait swam validly in the comparison, on {config.compared_engine}")
        tables["samplers"] = tried.drop_duplicates([*_SEARCH, "trial"])[[*_SEARCH, "trial", *_PARAMETERS, "value"]]
        tables["winners"] = _verified(comparison, evaluate, tried, neutral=False)
    shown = {}
    for best in _best(trials, ["objective"]):
        for fluid in config.objectives()[best["objective"]]:
            gait = SeaSnake(**{name: best[name] for name in _PARAMETERS})
            shown[f"{best['objective']}-{fluid}"] = Case(gait, config.variants(fluid)[FINE])
    return Outcome(tables, shown, frames=60)


def _variants(config: SeaSnakeConfig, fluid: str, *, neutral: bool) -> dict[str, Scenario]:
    """Where an optimum is evaluated; with a robot of `neutral` buoyancy in water, if asked for."""
    variants = config.variants(fluid)
    robot = config.robot.but(diameter=config.robot.neutral_diameter(named_fluid("water").density))
    return variants | ({"neutral diameter": variants[FINE].but(robot=robot)} if neutral else {})


def _loads(config: SeaSnakeConfig, samplers: Sequence[str], *, neutral: bool) -> list[Load]:
    swims = len(samplers) * len(config.seeds) * sum(map(len, config.objectives().values()))
    each = sum(CHOOSING_SECONDS.get(name, 0.0) for name in samplers) * config.trials**2
    choosing = len(config.objectives()) * len(config.seeds) * each
    variants = _variants(config, config.fluids[0], neutral=neutral)
    verified = [Load("angle", scenario, swims) for scenario in variants.values()]
    return [Load("angle", variants["searched"], swims * config.trials, choosing), *verified]


def _tried(
    config: SeaSnakeConfig, evaluate: Evaluator, samplers: Sequence[str], stored: StoredStudies | None
) -> pd.DataFrame:
    return pd.DataFrame(
        {"sampler": sampler, "objective": objective, "seed": seed} | row
        for sampler, objective, seed in product(samplers, config.objectives(), config.seeds)
        for row in _search(config, evaluate, sampler, objective, seed, stored)
    )


def _search(
    config: SeaSnakeConfig, evaluate: Evaluator, sampler: str, objective: str, seed: int, stored: StoredStudies | None
) -> Iterator[dict[str, Any]]:
    """One search, in batches of fixed size, so that neither workers nor interruptions change its course."""
    scenarios = {fluid: config.variants(fluid)["searched"] for fluid in config.objectives()[objective]}
    shown, here = None, {"engine": config.engine, "physics_rate": config.physics_rate}
    if stored:
        name = f"{config.name}-{objective}-{sampler}-seed{seed}-{config.engine}{config.physics_rate}"
        shown = stored.begin(name, "return J", fluids=list(scenarios), profile=config.profile, **here)
    search = Search(sampler, seed, config.batch, config.space, shown)
    for start in range(0, config.trials, config.batch):
        asked = search.ask(min(config.batch, config.trials - start))
        swims = iter(evaluate([Case(SeaSnake(**gait), there) for gait in asked for there in scenarios.values()]))
        by_gait = [{fluid: next(swims) for fluid in scenarios} for _ in asked]
        values = [_mean_return(list(by_fluid.values())) for by_fluid in by_gait]
        search.tell(values)
        for trial, (gait, value, by_fluid) in enumerate(zip(asked, values, by_gait, strict=True), start):
            for fluid, swim in by_fluid.items():
                yield {"trial": trial, **gait, "value": value, "fluid": fluid, **swim.row()}


def _mean_return(swims: Sequence[Evaluation]) -> float | None:
    """The objective's value: the mean return, or None unless every swim is valid."""
    returns = [swim.episode_return for swim in swims if swim.status == "ok" and swim.episode_return is not None]
    return sum(returns) / len(returns) if len(returns) == len(swims) else None


def _verified(config: SeaSnakeConfig, evaluate: Evaluator, trials: pd.DataFrame, *, neutral: bool) -> pd.DataFrame:
    """The best gait of each search in every variant and every fluid of its objective."""
    swims = []
    for best in _best(trials, _SEARCH):
        search, gait = ({name: best[name] for name in names} for names in (_SEARCH, _PARAMETERS))
        for fluid in config.objectives()[best["objective"]]:
            for variant, scenario in _variants(config, fluid, neutral=neutral).items():
                where = {"fluid": fluid, "variant": variant, **numerics(scenario), "diameter": scenario.robot.diameter}
                swims.append((search | where | gait, Case(SeaSnake(**gait), scenario)))
    return pd.DataFrame(swim_rows(evaluate, swims))


def _best(trials: pd.DataFrame, by: list[str]) -> list[dict[str, Any]]:
    """The row of the best gait in each group of trials that holds a valid one; the first of equals."""
    ranked = trials.dropna(subset="value").sort_values("value", ascending=False, kind="stable")
    rows: list[Any] = ranked.groupby(by).head(1).sort_index().to_dict("records")
    return rows
