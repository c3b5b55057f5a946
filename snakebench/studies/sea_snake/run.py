"""Single-objective study: Optuna's TPE tunes the sea-snake gait to the return J, per fluid and for the mean (paper).

Beside it other samplers search with the same budget, on a quick engine, and what they found is verified (ours).
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterator
from typing import Any, NamedTuple

import pandas as pd

from snakebench.controllers import SeaSnake
from snakebench.errors import InvalidValue
from snakebench.evaluation import Evaluation
from snakebench.execution import Case, Evaluator
from snakebench.fluid import named_fluid
from snakebench.scenario import Scenario
from snakebench.simulation import simulate
from snakebench.studies.config import thinning
from snakebench.studies.indicators import none_valid
from snakebench.studies.planning import Load
from snakebench.studies.samplers import Search, StoredStudies, StoredStudy, check_samplers, choosing_seconds
from snakebench.studies.sea_snake.settings import SeaSnakeConfig
from snakebench.studies.swim_rows import numerics, swim_rows
from snakebench.trajectory import Trajectory

_PARAMETERS = tuple(SeaSnake.SPACE)


class _Tried(NamedTuple):
    """A gait of a search: its number, what it is worth (None unless valid in every fluid), and its swims by fluid."""

    trial: int
    gait: SeaSnake
    value: float | None
    swims: dict[str, Evaluation]

    def described(self) -> dict[str, object]:
        """The columns that tell of the gait."""
        return {"trial": self.trial} | _parameters(self.gait) | {"value": self.value}


_Variants = Callable[
    [SeaSnakeConfig, str], dict[str, Scenario]
]  # where the gaits of a search are tried, "searched" first


def plan(config: SeaSnakeConfig) -> list[Load]:
    """What the study evaluates.

    Raises:
        InvalidValue: when a sampler needs a package that is missing.
    """
    check_samplers(config.compared)
    compared = _loads(config, _compared_variants, len(config.compared), _choosing_seconds(config))
    return [*_loads(config, _variants, 1, 0.0), *(compared if config.compared else [])]


def run(
    config: SeaSnakeConfig, evaluate: Evaluator, stored: StoredStudies | None = None
) -> tuple[dict[str, pd.DataFrame], dict[str, Trajectory]]:
    """Search for every objective and seed, and check each optimum; then compare the samplers, if any are named.

    Args:
        config: what to search for.
        evaluate: who evaluates.
        stored: where every search is shown as an Optuna study, if anywhere.

    Returns:
        Two tables, two more of the comparison, and the runs that the report shows:

        - `trials`: every evaluation of every search, with the objective's value of its gait;
        - `optima`: the best gait of every search in its objective's fluids: as searched, verified with a coarser and
          a finer step, and on a robot that floats neutrally in water;
        - `samplers`: every gait of every search of the comparison, with the objective's value;
        - `winners`: the best gait of each of these searches, as searched and verified, in the columns of `optima`;
        - OBJECTIVE-FLUID: the best gait of all seeds swimming, 60 rows a second.

    Raises:
        InvalidValue: when every gait diverged or was invalid.
        StoreError: when the Optuna studies cannot be written.
    """
    trials = pd.DataFrame(
        {"objective": objective, "seed": seed} | tried.described() | {"fluid": fluid} | swim.model_dump()
        for objective, seed in _searches(config)
        for tried in _search(config, evaluate, "tpe", objective, seed, _variants, stored)
        for fluid, swim in tried.swims.items()
    )
    found = _best(trials, by=["objective", "seed"])
    if not found:
        raise none_valid(config.name, trials)
    optima = pd.DataFrame(row for best in found for row in _checked(config, evaluate, best, _variants))
    trajectories = {
        f"{best['objective']}-{fluid}": simulate(_gait(best), config.verified(fluid)[0]).thinned(
            thinning(config.verify_rate)
        )
        for best in _best(trials, by=["objective"])
        for fluid in config.objectives()[str(best["objective"])]
    }
    compared = _comparison(config, evaluate, stored) if config.compared else {}
    return {"trials": trials, "optima": optima} | compared, trajectories


def _comparison(config: SeaSnakeConfig, evaluate: Evaluator, stored: StoredStudies | None) -> dict[str, pd.DataFrame]:
    """The tables `samplers` and `winners`."""
    tried = pd.DataFrame(
        {"sampler": sampler, "objective": objective, "seed": seed} | tried.described()
        for sampler in config.compared
        for objective, seed in _searches(config)
        for tried in _search(config, evaluate, sampler, objective, seed, _compared_variants, stored)
    )
    found = _best(tried, by=["sampler", "objective", "seed"])
    if not found:
        raise InvalidValue(f"{config.name}: no gait swam validly in the comparison, on {config.compared_engine}")
    winners = pd.DataFrame(row for best in found for row in _checked(config, evaluate, best, _compared_variants))
    return {"samplers": tried, "winners": winners}


def _loads(config: SeaSnakeConfig, variants: _Variants, samplers: int, choosing: float) -> Iterator[Load]:
    """The evaluations of every search by so many samplers, and those of their best gaits."""
    swims = samplers * sum(len(config.objectives()[objective]) for objective, _ in _searches(config))
    for variant, scenario in variants(config, config.fluids[0]).items():
        searched = variant == "searched"
        yield Load("angle", scenario, swims * (config.trials + 1 if searched else 1), choosing if searched else 0.0)


def _choosing_seconds(config: SeaSnakeConfig) -> float:
    return len(_searches(config)) * sum(choosing_seconds(sampler, config.trials) for sampler in config.compared)


def _searches(config: SeaSnakeConfig) -> list[tuple[str, int]]:
    """Objective and seed of every search of a sampler."""
    return [(objective, seed) for objective in config.objectives() for seed in config.seeds]


def _variants(config: SeaSnakeConfig, fluid: str) -> dict[str, Scenario]:
    """Where an optimum is evaluated in a fluid."""
    fine, coarse = config.verified(fluid)
    neutral = config.robot.neutral_diameter(named_fluid("water").density)
    return {
        "searched": config.scenario(fluid),
        "coarser step": coarse,
        "finer step": fine,
        "neutral diameter": fine.but(robot=config.robot.but(diameter=neutral)),
    }


def _compared_variants(config: SeaSnakeConfig, fluid: str) -> dict[str, Scenario]:
    """Where the best gait of a search of the comparison is evaluated in a fluid."""
    fine, coarse = config.verified(fluid)
    return {"searched": config.compared_scenario(fluid), "coarser step": coarse, "finer step": fine}


def _search(
    config: SeaSnakeConfig,
    evaluate: Evaluator,
    sampler: str,
    objective: str,
    seed: int,
    variants: _Variants,
    stored: StoredStudies | None,
) -> Iterator[_Tried]:
    """One search, in batches of fixed size, so that neither workers nor interruptions change its course."""
    scenarios = {fluid: variants(config, fluid)["searched"] for fluid in config.objectives()[objective]}
    shown = _stored(stored, config, sampler, objective, seed, next(iter(scenarios.values()))) if stored else None
    search = Search(sampler, seed, config.batch, {name: config.space[name] for name in _PARAMETERS}, shown)
    for first in range(0, config.trials, config.batch):
        gaits = [SeaSnake(**parameters) for parameters in search.ask(min(config.batch, config.trials - first))]
        evaluations = iter(evaluate([Case(gait, scenario) for gait in gaits for scenario in scenarios.values()]))
        swims = [{fluid: next(evaluations) for fluid in scenarios} for _ in gaits]
        values = [_mean_return(list(of_gait.values())) for of_gait in swims]
        search.tell(values)
        yield from map(_Tried, range(first, first + len(gaits)), gaits, values, swims)


def _stored(
    stored: StoredStudies, config: SeaSnakeConfig, sampler: str, objective: str, seed: int, where: Scenario
) -> StoredStudy:
    """The Optuna study that shows a search; the study's own and the comparison's differ by where they search."""
    return stored.begin(
        f"{config.name}-{objective}-{sampler}-seed{seed}-{where.engine}{where.physics_rate}",
        "return J",
        fluids=list(config.objectives()[objective]),
        profile=config.profile,
        engine=where.engine,
        physics_rate=where.physics_rate,
    )


def _mean_return(evaluations: list[Evaluation]) -> float | None:
    """The objective's value: the mean return, or None unless every evaluation is valid."""
    returns = [one.episode_return for one in evaluations if one.status == "ok" and one.episode_return is not None]
    return sum(returns) / len(returns) if len(returns) == len(evaluations) else None


def _best(trials: pd.DataFrame, by: list[str]) -> list[dict[Hashable, Any]]:
    """The row of the best gait in each group of trials that holds a valid one; the first of equals."""
    ranked = trials.dropna(subset="value").sort_values("value", ascending=False, kind="stable")
    return ranked.groupby(by).head(1).sort_index().to_dict("records")


def _gait(row: dict[Hashable, Any]) -> SeaSnake:
    return SeaSnake(**{name: row[name] for name in _PARAMETERS})


def _checked(
    config: SeaSnakeConfig, evaluate: Evaluator, best: dict[Hashable, Any], variants: _Variants
) -> Iterator[dict[str, object]]:
    """The best gait of a search in every variant and every fluid of its objective."""
    gait = _gait(best)
    search = {name: best[name] for name in ("sampler", "objective", "seed") if name in best}
    asked = [
        (
            search
            | {"fluid": fluid, "variant": variant, **numerics(scenario), "diameter": scenario.robot.diameter}
            | _parameters(gait),
            Case(gait, scenario),
        )
        for fluid in config.objectives()[best["objective"]]
        for variant, scenario in variants(config, fluid).items()
    ]
    yield from swim_rows(evaluate, asked)


def _parameters(gait: SeaSnake) -> dict[str, float]:
    return gait.model_dump(include=set(_PARAMETERS))
