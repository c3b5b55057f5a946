"""Learned-front study: the fronts of preference-conditioned policies beside those of fixed gaits (ours).

Each policy is evaluated at many prices of power in every fluid. Its front in a fluid is made of these swims; the
integrated front of their means over the fluids at one price for all; the simple-sum front of the best combination of
prices, one for each fluid.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from itertools import product

import pandas as pd

from snakebench.errors import InvalidValue
from snakebench.execution import Case, Evaluator
from snakebench.simulation import AnyController
from snakebench.store import INTEGRATED
from snakebench.studies.config import thinning
from snakebench.studies.indicators import (
    OBJECTIVES,
    SHAPE,
    assembled,
    attainment_rows,
    beside_searched,
    eligible,
    front_of,
    front_tables,
)
from snakebench.studies.learned_front.settings import LearnedFrontConfig
from snakebench.studies.protocol import STAND_INS, Load, Outcome, Row, Swim, loads_of, numerics, swim_rows
from snakebench.studies.search_settings import objectives
from snakebench.studies.training_jobs import TrainingJob, learn, learning_load

_COARSER_EVERY = 4  # at every so many prices, half the physics rate tells the error of the step

ControllerOf = Callable[[TrainingJob, float], AnyController]  # a policy at a price of power [1/W]


def plan(config: LearnedFrontConfig) -> list[Load]:
    """What the study evaluates; the learning comes before, and reports its own time."""
    priced = (case for _, case in _at_prices(config, lambda *_: STAND_INS["angle"]))
    jobs = config.training_jobs()
    return [*loads_of(priced), learning_load(jobs, config.variants(jobs[0])["finer step"])]


def run(config: LearnedFrontConfig, evaluate: Evaluator) -> Outcome:
    """Train all policies, and evaluate each at many prices of power.

    Returns:
        Tables, the swims that the report shows, and policies:

        - `curves`, `steps`: as of the teacher-student study;
        - `dial`: every policy and seed at every price in every fluid, in PyBullet and in planar, and at
          every fourth position at half PyBullet's rate;
        - `fronts`, `switching`, `indicators`: of each policy (`method`) and `seed`, as `front_tables`, `space` being
          both, "POLICY SEED"; what was "searched" is the planar engine's, in which policies learn;
        - `attainment`: what the best, the median and the worst seed of a policy attain;
        - POLICY-FLUID-K: the first seed swimming at position K of `swims`, 60 rows a second;
        - POLICY-SEED: the policies of `published`.

    Raises:
        InvalidValue: when a policy is not preference-conditioned, or none swam validly.
    """
    learned = learn(config, evaluate)

    def policy_at(job: TrainingJob, price: float) -> AnyController:
        return learned.policies[job.key].at(price)

    swims = pd.DataFrame(swim_rows(evaluate, _at_prices(config, policy_at)))
    if not eligible(swims[swims["variant"] == "finer step"]).any():
        raise InvalidValue(f"{config.name}: no policy swam forward: {swims['status'].value_counts().to_dict()}")
    tables = {"curves": learned.curves, "steps": learned.steps, "dial": swims, **_tables_of_fronts(config, swims)}
    shown, every = _shown(config, policy_at), thinning(config.verify_rate)
    trajectories = {name: evaluate.trajectory(case, every) for name, case in shown.items()}
    return Outcome(tables, trajectories, learned.published)


def _at_prices(config: LearnedFrontConfig, controller_of: ControllerOf) -> Iterator[Swim]:
    """Every policy at every price, in every fluid and variant."""
    for job in config.training_jobs():
        for variant, scenario in config.variants(job).items():
            prices = config.prices(job)[:: _COARSER_EVERY if variant == "coarser step" else 1]
            scenarios = {fluid: scenario.but(fluid=fluid) for fluid in config.fluids}
            for price, (fluid, here) in product(prices, scenarios.items()):
                place = {"price": price, "fluid": fluid, "variant": variant, **numerics(here)}
                yield {"policy": job.name, "seed": job.seed, **place}, Case(controller_of(job, price), here)


def _shown(config: LearnedFrontConfig, controller_of: ControllerOf) -> dict[str, Case]:
    """Swims of the first seed of each policy shown, at a few prices, by name."""
    firsts = {job.name: job for job in reversed(config.training_jobs())}
    return {
        f"{job.name}-{name}-{k}": Case(controller_of(job, price), config.variants(job)["finer step"].but(fluid=name))
        for job in (firsts[name] for name in config.shown if name in firsts)
        for name in config.fluids
        for k, price in enumerate(config.prices(job, config.swims))
    }


def _tables_of_fronts(config: LearnedFrontConfig, swims: pd.DataFrame) -> dict[str, pd.DataFrame]:
    jobs = config.training_jobs()
    fronts = pd.concat([_fronts(config, job, swims) for job in jobs], ignore_index=True)
    labels = pd.DataFrame([{"space": str(job), "method": job.name, "seed": job.seed} for job in jobs])
    tables = front_tables(fronts, config.fluids, config.reference, config.powers)
    attained: list[Row] = []
    for (policy, name), part in fronts.merge(labels, on="space").groupby(["method", "front"], sort=False):
        seeds = [points[OBJECTIVES].to_numpy() for _, points in part.groupby("seed", sort=False)]
        attained += attainment_rows(seeds, policy=policy, front=name)
    labelled = {name: table.merge(labels, how="left", on="space") for name, table in tables.items()}
    return {**labelled, "attainment": pd.DataFrame(attained)}


def _fronts(config: LearnedFrontConfig, job: TrainingJob, swims: pd.DataFrame) -> pd.DataFrame:
    """The fronts of one policy, as `assembled`; none if it never swam validly."""
    swims = beside_searched(swims[(swims["policy"] == job.name) & (swims["seed"] == job.seed)], "planar")
    if not eligible(swims).any():
        return pd.DataFrame()
    fronts = {
        name: front_of(swims, ["price"], fluids, [*SHAPE, "wave_speed"] if len(fluids) == 1 else [])
        for name, fluids in objectives(config.fluids, INTEGRATED).items()
    }
    return assembled(str(job), fronts, config.fluids, config.robot.total_mass)
