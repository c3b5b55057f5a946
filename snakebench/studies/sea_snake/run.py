"""Single-objective study: Optuna's TPE tunes the sea-snake gait to the return J, per fluid and for the mean (paper).

Beside it other samplers search with the same budget, on a quick engine, and their best gaits are verified (ours).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import product
from typing import Any, NamedTuple

import pandas as pd

from snakebench.controllers import SeaSnake
from snakebench.errors import InvalidValue
from snakebench.evaluation import Evaluation
from snakebench.execution import Case, Evaluator
from snakebench.fluid import named_fluid
from snakebench.scenario import Scenario
from snakebench.studies.config import thinning
from snakebench.studies.indicators import none_valid
from snakebench.studies.protocol import Load, Outcome, numerics, swim_rows
from snakebench.studies.samplers import CHOOSING_SECONDS, Search, StoredStudies, check_samplers
from snakebench.studies.sea_snake.settings import SeaSnakeConfig

_PARAMETERS = list(SeaSnake.SPACE)
_SEARCH = ["sampler", "objective", "seed"]
_GAIT = ["objective", "seed", "trial", *_PARAMETERS, "value"]  # columns of a gait that was tried


def plan(config: SeaSnakeConfig) -> list[Load]:
    """What the study evaluates.

    Raises:
        InvalidValue: when a sampler needs a package that is missing.
    """
    check_samplers(config.compared)
    searches = len(config.objectives()) * len(config.seeds)
    choosing = searches * config.trials**2 * sum(CHOOSING_SECONDS.get(name, 0.0) for name in config.compared)
    compared = _loads(config, _compared_variants(config, config.fluids[0]), len(config.compared), choosing)
    return [*_loads(config, _variants(config, config.fluids[0]), 1, 0.0), *(compared if config.compared else [])]


def run(config: SeaSnakeConfig, evaluate: Evaluator, stored: StoredStudies | None = None) -> Outcome:
    """Search for every objective and seed, and verify each optimum; then compare the samplers, if any are named.

    Args:
        config: what to search for.
        evaluate: evaluates the gaits.
        stored: where every search is shown as an Optuna study, if anywhere.

    Returns:
        Two tables, two more of the comparison, and swims:

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
    own = _Searches(config, evaluate, stored, {fluid: _variants(config, fluid) for fluid in config.fluids})
    trials = own.tried(["tpe"])
    if trials["value"].isna().all():
        raise none_valid(config.name, trials)
    tables = {"trials": trials.drop(columns="sampler"), "optima": own.verified(trials).drop(columns="sampler")}
    if config.compared:
        variants = {fluid: _compared_variants(config, fluid) for fluid in config.fluids}
        others = _Searches(config, evaluate, stored, variants)
        tried = others.tried(config.compared)
        if tried["value"].isna().all():
            raise InvalidValue(f"{config.name}: no gait swam validly in the comparison, on {config.compared_engine}")
        tables |= {"samplers": tried.drop_duplicates([*_SEARCH, "trial"])[["sampler", *_GAIT]]}
        tables |= {"winners": others.verified(tried)}
    shown, every = _shown(config, trials), thinning(config.verify_rate)
    return Outcome(tables, {name: evaluate.trajectory(case, every) for name, case in shown})


def _variants(config: SeaSnakeConfig, fluid: str) -> dict[str, Scenario]:
    """Where an optimum is evaluated in a fluid; gaits are tried where it is "searched"."""
    variants = config.variants(fluid)
    neutral = config.robot.but(diameter=config.robot.neutral_diameter(named_fluid("water").density))
    return variants | {"neutral diameter": variants["finer step"].but(robot=neutral)}


def _compared_variants(config: SeaSnakeConfig, fluid: str) -> dict[str, Scenario]:
    """The same of the best gait of a search of the comparison."""
    searched = config.scenario(fluid, engine=config.compared_engine, physics_rate=config.compared_rate)
    return config.variants(fluid) | {"searched": searched}


def _loads(config: SeaSnakeConfig, variants: dict[str, Scenario], samplers: int, choosing: float) -> Iterator[Load]:
    """The evaluations of every search by so many samplers, and those of their best gaits."""
    swims = samplers * len(config.seeds) * sum(map(len, config.objectives().values()))
    for variant, scenario in variants.items():
        searched = variant == "searched"
        yield Load("angle", scenario, swims * (config.trials + 1 if searched else 1), choosing if searched else 0.0)


class _Searches(NamedTuple):
    """Searches in the same scenarios, and the verification of the gaits that they find."""

    config: SeaSnakeConfig
    evaluate: Evaluator
    stored: StoredStudies | None
    variants: dict[str, dict[str, Scenario]]  # by fluid

    def tried(self, samplers: Sequence[str]) -> pd.DataFrame:
        """Every swim of every search by these samplers."""
        return pd.DataFrame(
            {"sampler": sampler, "objective": objective, "seed": seed} | row
            for sampler, objective, seed in product(samplers, self.config.objectives(), self.config.seeds)
            for row in self._search(sampler, objective, seed)
        )

    def _search(self, sampler: str, objective: str, seed: int) -> Iterator[dict[str, Any]]:
        """One search, in batches of fixed size, so that neither workers nor interruptions change its course."""
        config = self.config
        fluids = config.objectives()[objective]
        scenarios = [self.variants[fluid]["searched"] for fluid in fluids]
        shown, here = None, numerics(scenarios[0])  # where the study's own searches and the comparison's differ
        if self.stored:
            name = f"{config.name}-{objective}-{sampler}-seed{seed}-{here['engine']}{here['physics_rate']}"
            shown = self.stored.begin(name, "return J", fluids=list(fluids), profile=config.profile, **here)
        search = Search(sampler, seed, config.batch, config.space, shown)
        for start in range(0, config.trials, config.batch):
            asked = search.ask(min(config.batch, config.trials - start))
            cases = [Case(SeaSnake(**gait), scenario) for gait in asked for scenario in scenarios]
            swims = self.evaluate(cases)
            by_gait = [swims[k : k + len(fluids)] for k in range(0, len(swims), len(fluids))]
            values = [_mean_return(of_gait) for of_gait in by_gait]
            search.tell(values)
            for trial, (gait, value, of_gait) in enumerate(zip(asked, values, by_gait, strict=True), start):
                for fluid, swim in zip(fluids, of_gait, strict=True):
                    yield {"trial": trial} | gait | {"value": value, "fluid": fluid} | swim.row()

    def verified(self, trials: pd.DataFrame) -> pd.DataFrame:
        """The best gait of each search in every variant and every fluid of its objective."""
        swims = []
        for best in _best(trials, _SEARCH):
            search, gait = ({name: best[name] for name in names} for names in (_SEARCH, _PARAMETERS))
            for fluid in self.config.objectives()[best["objective"]]:
                for variant, scenario in self.variants[fluid].items():
                    where = {"fluid": fluid, "variant": variant, **numerics(scenario)}
                    labels = search | where | {"diameter": scenario.robot.diameter} | gait
                    swims.append((labels, Case(SeaSnake(**gait), scenario)))
        return pd.DataFrame(swim_rows(self.evaluate, swims))


def _best(trials: pd.DataFrame, by: list[str]) -> list[dict[str, Any]]:
    """The row of the best gait in each group of trials that holds a valid one; the first of equals."""
    ranked = trials.dropna(subset="value").sort_values("value", ascending=False, kind="stable")
    rows: list[Any] = ranked.groupby(by).head(1).sort_index().to_dict("records")
    return rows


def _mean_return(evaluations: Sequence[Evaluation]) -> float | None:
    """The objective's value: the mean return, or None unless every evaluation is valid."""
    returns = [one.episode_return for one in evaluations if one.status == "ok" and one.episode_return is not None]
    return sum(returns) / len(returns) if len(returns) == len(evaluations) else None


def _shown(config: SeaSnakeConfig, trials: pd.DataFrame) -> Iterator[tuple[str, Case]]:
    """The best gait of all seeds for every objective in its fluids, by name."""
    for best in _best(trials, ["objective"]):
        gait = SeaSnake(**{name: best[name] for name in _PARAMETERS})
        for fluid in config.objectives()[best["objective"]]:
            yield f"{best['objective']}-{fluid}", Case(gait, config.variants(fluid)["finer step"])
