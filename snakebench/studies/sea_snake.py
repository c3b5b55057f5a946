"""Single-objective study: Optuna's TPE tunes the sea-snake gait to the return J, per fluid and for the mean (paper)."""

from __future__ import annotations

from collections.abc import Hashable, Iterator
from typing import Any

import optuna
import pandas as pd
from optuna.trial import TrialState

from snakebench.controllers import SeaSnake
from snakebench.errors import InvalidValue
from snakebench.evaluation import Evaluation, check_rate, simulate
from snakebench.execution import Case, Evaluator
from snakebench.fluid import named_fluid
from snakebench.robot import Robot
from snakebench.studies.config import SeaSnakeConfig
from snakebench.trajectory import Trajectory

_PARAMETERS = ("amplitude", "frequency", "phase")
_CHECKS = 3  # variants in which each optimum is evaluated
_FRAMES_PER_SECOND = 60  # of the trajectories kept for the report


def n_evaluations(config: SeaSnakeConfig) -> int:
    """How many evaluations the study makes."""
    fluids = sum(len(fluids) for fluids in config.objectives().values())
    return len(config.seeds) * fluids * (config.trials + _CHECKS)


def check(config: SeaSnakeConfig) -> None:
    """Make sure that every scenario of the study can be simulated.

    Raises:
        InvalidValue: naming the setting that forbids it.
    """
    for _, rate, robot in _variants(config):
        check_rate(config.scenario(config.fluids[0], rate, robot), "angle")


def run(config: SeaSnakeConfig, evaluate: Evaluator) -> tuple[dict[str, pd.DataFrame], dict[str, Trajectory]]:
    """Search for every objective and seed, and check each optimum.

    Returns:
        Two tables and the runs that the report shows:

        - `trials`: every evaluation of every search, with the objective's value of its gait;
        - `optima`: the best gait of every search in its objective's fluids: as searched, with a finer step, and on a
          robot that floats neutrally in water;
        - OBJECTIVE-FLUID: the best gait of all seeds swimming, 60 rows a second.

    Raises:
        InvalidValue: when every gait diverged or was invalid.
    """
    optuna.logging.set_verbosity(optuna.logging.WARNING)
    trials = pd.DataFrame(
        row
        for objective, fluids in config.objectives().items()
        for seed in config.seeds
        for row in _search(config, evaluate, objective, fluids, seed)
    )
    found = _best(trials, by=["objective", "seed"])
    if not found:
        raise InvalidValue(f"{config.name}: no gait swam validly: {trials['status'].value_counts().to_dict()}")
    optima = pd.DataFrame(
        row
        for best in found
        for row in _checked(config, evaluate, str(best["objective"]), int(best["seed"]), _gait(best))
    )
    trajectories = {
        f"{best['objective']}-{fluid}": simulate(
            _gait(best), config.scenario(fluid, config.check_rate, config.robot)
        ).thinned(max(config.check_rate // _FRAMES_PER_SECOND, 1))
        for best in _best(trials, by=["objective"])
        for fluid in config.objectives()[str(best["objective"])]
    }
    return {"trials": trials, "optima": optima}, trajectories


def _variants(config: SeaSnakeConfig) -> list[tuple[str, int, Robot]]:
    """Name, physics rate and robot with which an optimum is evaluated."""
    neutral = config.robot.neutral_diameter(named_fluid("water").density)
    return [
        ("searched", config.physics_rate, config.robot),
        ("finer step", config.check_rate, config.robot),
        ("neutral diameter", config.check_rate, config.robot.but(diameter=neutral)),
    ]


def _search(
    config: SeaSnakeConfig, evaluate: Evaluator, objective: str, fluids: tuple[str, ...], seed: int
) -> Iterator[dict[str, object]]:
    """One TPE search, in batches of fixed size, so that neither workers nor interruptions change its course."""
    sampler = optuna.samplers.TPESampler(seed=seed, constant_liar=True)
    study = optuna.create_study(direction="maximize", sampler=sampler)
    space: dict[str, optuna.distributions.BaseDistribution] = {
        name: optuna.distributions.FloatDistribution(*config.space[name]) for name in _PARAMETERS
    }
    for first in range(0, config.trials, config.batch):
        asked = [study.ask(space) for _ in range(min(config.batch, config.trials - first))]
        gaits = [SeaSnake(**trial.params) for trial in asked]
        cases = [
            Case(gait, config.scenario(fluid, config.physics_rate, config.robot)) for gait in gaits for fluid in fluids
        ]
        evaluations = iter(evaluate(cases))
        for trial in asked:
            scores = [next(evaluations) for _ in fluids]
            value = _mean_return(scores)
            study.tell(trial, value, state=TrialState.COMPLETE if value is not None else TrialState.FAIL)
            for fluid, score in zip(fluids, scores, strict=True):
                about = {"objective": objective, "seed": seed, "trial": trial.number, **trial.params}
                yield about | {"value": value, "fluid": fluid} | score.model_dump()


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
    config: SeaSnakeConfig, evaluate: Evaluator, objective: str, seed: int, gait: SeaSnake
) -> Iterator[dict[str, object]]:
    """The gait in every variant and every fluid of the objective."""
    scenarios = {
        (fluid, variant): config.scenario(fluid, rate, robot)
        for fluid in config.objectives()[objective]
        for variant, rate, robot in _variants(config)
    }
    evaluations = evaluate([Case(gait, scenario) for scenario in scenarios.values()])
    for ((fluid, variant), scenario), evaluation in zip(scenarios.items(), evaluations, strict=True):
        about = {"objective": objective, "seed": seed, "fluid": fluid, "variant": variant}
        numerics = {"physics_rate": scenario.physics_rate, "diameter": scenario.robot.diameter}
        yield about | numerics | gait.model_dump(include=set(_PARAMETERS)) | evaluation.model_dump()
