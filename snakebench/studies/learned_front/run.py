"""Learned-front study: the fronts of preference-conditioned policies beside those of fixed gaits (ours).

Each policy is evaluated at many prices of power in every fluid; a price is what a gait is to other fronts.
"""

from collections.abc import Callable, Iterator
from itertools import product

import pandas as pd

from snakebench.execution import Case, Evaluator
from snakebench.names import COARSE, FINE
from snakebench.simulation import AnyController
from snakebench.studies import fronts
from snakebench.studies.learned_front.settings import LearnedFrontConfig
from snakebench.studies.protocol import STAND_INS, Load, Outcome, Swim, loads_of, numerics, swim_rows
from snakebench.studies.training_jobs import TrainingJob, learn, learning_load

_COARSER_EVERY = 4  # at every so many prices, half the physics rate tells the error of the step

PolicyAt = Callable[[TrainingJob, float], AnyController]  # a policy at a price of power [1/W]


def plan(config: LearnedFrontConfig) -> list[Load]:
    """What the study evaluates; the learning comes before, and reports its own time."""
    priced = (case for _, case in _at_prices(config, lambda *_: STAND_INS["angle"]))
    jobs = config.training_jobs()
    return [*loads_of(priced), learning_load(jobs, config.variants(jobs[0])[FINE])]


def run(config: LearnedFrontConfig, evaluate: Evaluator) -> Outcome:
    """Train all policies, and evaluate each at many prices of power."""
    learned = learn(config, evaluate)

    def policy_at(job: TrainingJob, price: float) -> AnyController:
        return learned.policies[job.key].at(price)

    swims = pd.DataFrame(swim_rows(evaluate, _at_prices(config, policy_at)))
    tables = {"curves": learned.curves, "steps": learned.steps, "dial": swims, **_tables_of_fronts(config, swims)}
    return Outcome(tables, _shown(config, policy_at), learned.published)


def _at_prices(config: LearnedFrontConfig, policy_at: PolicyAt) -> Iterator[Swim]:
    """Every policy at every price, in every fluid and variant."""
    for job in config.training_jobs():
        for variant, scenario in config.variants(job).items():
            prices = config.prices(job, config.positions)[:: _COARSER_EVERY if variant == COARSE else 1]
            for price, fluid in product(prices, config.fluids):
                labels = {"policy": job.name, "seed": job.seed, "price": price, "fluid": fluid, "variant": variant}
                yield labels | numerics(scenario), Case(policy_at(job, price), scenario.but(fluid=fluid))


def _shown(config: LearnedFrontConfig, policy_at: PolicyAt) -> dict[str, Case]:
    """Swims of the first seed of each policy shown, at a few prices, by name."""
    firsts = {job.name: job for job in reversed(config.training_jobs())}
    return {
        f"{job.name}-{fluid}-{k}": Case(policy_at(job, price), config.variants(job)[FINE].but(fluid=fluid))
        for job in (firsts[name] for name in config.shown if name in firsts)
        for fluid in config.fluids
        for k, price in enumerate(config.prices(job, config.swims))
    }


def _tables_of_fronts(config: LearnedFrontConfig, swims: pd.DataFrame) -> dict[str, pd.DataFrame]:
    by_job = {
        f"{policy} {seed}": fronts.beside_searched(of_job, "planar")
        for (policy, seed), of_job in swims.groupby(["policy", "seed"], sort=False)
    }
    points = fronts.fronts_of(config, by_job, ["price"], [*fronts.SHAPE, "wave_speed"])
    attained = {}
    for (policy, name, currency), part in _by_policy(points).groupby(["method", "front", "currency"], sort=False):
        of_seeds = [seed[fronts.objectives(str(currency))].to_numpy() for _, seed in part.groupby("seed", sort=False)]
        attained[policy, name, currency] = fronts.attainment(of_seeds)
    tables = {name: _by_policy(table) for name, table in fronts.front_tables(config, points).items()}
    return tables | {"attainment": fronts.labelled(attained, ["policy", "front", "currency"])}


def _by_policy(table: pd.DataFrame) -> pd.DataFrame:
    """A table of fronts with columns method and seed, which are one, "POLICY SEED", as `space`."""
    parts = table["space"].str.rsplit(" ", n=1, expand=True)
    return table.assign(method=parts[0], seed=parts[1].astype(int))
