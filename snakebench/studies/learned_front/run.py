"""Learned-front study: a policy with a dial between speed and power, its fronts beside those of fixed gaits (ours).

Each policy is evaluated at many positions of its dial in every fluid. Its front in a fluid is made of these swims; the
integrated front of their means over the fluids at one position for all; the simple-sum front of the best combination of
positions, one for each fluid.
"""

from __future__ import annotations

from collections.abc import Iterator

import pandas as pd

from snakebench.errors import InvalidValue
from snakebench.execution import Case, Evaluator
from snakebench.fluid import named_fluid
from snakebench.policy import Policy
from snakebench.scenario import Scenario
from snakebench.simulation import simulate
from snakebench.store import INTEGRATED
from snakebench.studies.config import thinning
from snakebench.studies.fronts import attainment, front
from snakebench.studies.indicators import OBJECTIVES, SHAPE, assembled, eligible, front_tables
from snakebench.studies.learned_front.settings import LearnedFrontConfig
from snakebench.studies.planning import Load
from snakebench.studies.swim_rows import numerics, swim_rows
from snakebench.studies.training_jobs import Learned, Lesson, learn, learning_load
from snakebench.trajectory import Trajectory

_COARSER_EVERY = 4  # at every so many positions of the dial, half the physics rate tells the error of the step


def plan(config: LearnedFrontConfig) -> list[Load]:
    """What the study evaluates; the learning comes before, and tells of its own time."""
    lessons = config.lessons()
    loads = [
        Load("angle", scenario, len(config.fluids) * len(_positions(config, lesson, variant)))
        for lesson in lessons
        for variant, scenario in config.variants(lesson).items()
    ]
    shown = Load("angle", loads[0].scenario, len(config.shown) * len(config.fluids) * config.swims)
    return [*loads, learning_load(lessons, loads[0].scenario), shown]


def run(
    config: LearnedFrontConfig, evaluate: Evaluator
) -> tuple[dict[str, pd.DataFrame], dict[str, Trajectory], dict[str, Policy]]:
    """Learn all policies, and turn the dial of each.

    Returns:
        Tables, the swims that the report shows, and policies:

        - `curves`, `steps`: as of the teacher-student study;
        - `dial`: every policy and seed at every position of its dial in every fluid, in PyBullet and in planar, and at
          every fourth position at half PyBullet's rate;
        - `fronts`, `switching`, `indicators`: of each policy and seed, as `front_tables`, `space` being "POLICY SEED";
          what was "searched" is the planar engine's, in which policies learn;
        - `attainment`: what the best, the median and the worst seed of a policy attain;
        - POLICY-FLUID-K: the first seed swimming at position K of those kept, 60 rows a second;
        - POLICY-SEED: the policies of `published`.

    Raises:
        InvalidValue: when a policy has no dial, or none swam validly.
    """
    learned = learn(config, evaluate)
    dial = pd.DataFrame(_turned(config, evaluate, learned))
    if not eligible(dial[dial["variant"] == "finer step"]).any():
        raise InvalidValue(f"{config.name}: no policy swam forward: {dial['status'].value_counts().to_dict()}")
    fronts = pd.concat([_fronts(config, lesson, dial) for lesson in config.lessons()], ignore_index=True)
    tables = {
        "curves": learned.curves,
        "steps": learned.steps,
        "dial": dial,
        **front_tables(fronts, config.fluids, config.reference, config.powers),
        "attainment": pd.DataFrame(_attained(fronts)),
    }
    return tables, dict(_swims(config, evaluate, learned)), learned.published(config.published)


def _turned(config: LearnedFrontConfig, evaluate: Evaluator, learned: Learned) -> Iterator[dict[str, object]]:
    """Every policy at every position of its dial, in every fluid and variant."""
    yield from swim_rows(
        evaluate,
        (
            (
                {"policy": lesson.name, "seed": lesson.seed, "price": price, "fluid": name, "variant": variant}
                | numerics(scenario),
                Case(learned.policies[lesson.key].at(price), scenario.but(fluid=named_fluid(name))),
            )
            for lesson in config.lessons()
            for variant, scenario in config.variants(lesson).items()
            for price in _positions(config, lesson, variant)
            for name in config.fluids
        ),
    )


def _positions(config: LearnedFrontConfig, lesson: Lesson, variant: str) -> list[float]:
    """The prices at which a variant is run [1/W]."""
    return config.dial(lesson)[:: _COARSER_EVERY if variant == "coarser step" else 1]


def _fronts(config: LearnedFrontConfig, lesson: Lesson, dial: pd.DataFrame) -> pd.DataFrame:
    """The fronts of one policy, as `assembled`; none if it never swam validly."""
    swims = dial[(dial["policy"] == lesson.name) & (dial["seed"] == lesson.seed)]
    fine, planar = (
        swims[swims["variant"] == variant].set_index(["fluid", "price"]) for variant in ("finer step", "planar")
    )
    if not eligible(fine).any():
        return pd.DataFrame()
    searched = {f"{name}_searched": planar[name] for name in OBJECTIVES}
    table = fine.assign(**fine[OBJECTIVES].where(eligible(fine)), **searched)
    kept = [*OBJECTIVES, "positive_power", *searched]
    found = {fluid: table.loc[fluid, [*kept, "steady", *SHAPE, "wave_speed"]] for fluid in config.fluids}
    if len(config.fluids) > 1:
        means = table.groupby("price")[kept].mean(numeric_only=True)
        swam = table.groupby("price")["speed"].count() == len(config.fluids)
        found[INTEGRATED] = means.where(swam).assign(steady=table.groupby("price")["steady"].all())
    best = {name: part.iloc[front(part[OBJECTIVES].to_numpy())].reset_index() for name, part in found.items()}
    return assembled(str(lesson), best, config.fluids, config.robot.total_mass)


def _attained(fronts: pd.DataFrame) -> Iterator[dict[str, object]]:
    """The attainment surfaces over the seeds of each policy."""
    policies = fronts["space"].str.rsplit(" ", n=1).str[0]
    for (policy, name), part in fronts.groupby([policies, "front"], sort=False):
        seeds = [points[OBJECTIVES].to_numpy() for _, points in part.groupby("space", sort=False)]
        for surface, points in attainment(seeds).items():
            for speed, power in points:
                yield {"policy": policy, "front": name, "surface": surface, "speed": speed, "power": power}


def _swims(config: LearnedFrontConfig, evaluate: Evaluator, learned: Learned) -> Iterator[tuple[str, Trajectory]]:
    """Swims of the first seed of each policy shown, at a few positions of its dial."""
    every = thinning(config.verify_rate)
    tasks = {}
    firsts = {lesson.name: lesson for lesson in reversed(config.lessons())}
    for lesson in (firsts[name] for name in config.shown if name in firsts):
        for name in config.fluids:
            scenario = config.variants(lesson)["finer step"].but(fluid=named_fluid(name))
            for k, price in enumerate(config.dial(lesson, config.swims)):
                tasks[f"{lesson.name}-{name}-{k}"] = learned.policies[lesson.key].at(price), scenario, every
    yield from zip(tasks, evaluate.compute(_thinned, tasks.values()), strict=True)


def _thinned(policy: Policy, scenario: Scenario, every: int) -> Trajectory:
    """What a worker does: every `every`-th row of a swim."""
    return simulate(policy, scenario).thinned(every)
