"""Teacher-student study: how far policies get that know the fluid, that must infer it, or that never knew (paper).

Policies are learned in planar, which is fast, and judged in PyBullet, the shared evaluator.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pandas as pd

from snakebench import metrics
from snakebench.execution import Case, Evaluator
from snakebench.fluid import Fluid, named_fluid
from snakebench.learning.settings import VISCOSITIES
from snakebench.policy import Policy
from snakebench.scenario import Scenario
from snakebench.simulation import simulate
from snakebench.studies.config import thinning
from snakebench.studies.planning import Load
from snakebench.studies.swim_rows import Row, numerics, swim_rows
from snakebench.studies.teacher_student.settings import TeacherStudentConfig
from snakebench.studies.training_jobs import Key, TrainingJob, learn, learning_load
from snakebench.trajectory import Trajectory


def plan(config: TeacherStudentConfig) -> list[Load]:
    """What the study evaluates; the learning comes before, and tells of its own time."""
    jobs = config.training_jobs()
    loads = [Load("angle", scenario, 1) for job in jobs for _, scenario in _places(config, job)]
    watched = Load("angle", loads[0].scenario, len(jobs) * len(config.fluids))
    return [*loads, learning_load(jobs, loads[0].scenario), watched]


def run(
    config: TeacherStudentConfig, evaluate: Evaluator
) -> tuple[dict[str, pd.DataFrame], dict[str, Trajectory], dict[str, Policy]]:
    """Learn all policies and evaluate each.

    Returns:
        Tables, the swims that the report shows, and policies:

        - `curves`: the log of every training and distillation, one row a checkpoint;
        - `evaluations`: every policy and seed in every fluid, in PyBullet at two rates and in planar;
        - `range`: the same over viscosities, in PyBullet at the finer rate;
        - `course`: how far its direction of travel strays, `stray` [rad], in every fluid, at the finer rate;
        - `steps`: what each policy and seed took to learn, in control steps of all members;
        - POLICY-FLUID: the first seed swimming, 60 rows a second;
        - POLICY-SEED: the policies of `published`.
    """
    learned = learn(config, evaluate)
    jobs = config.training_jobs()
    rows = list(_evaluated(config, evaluate, jobs, learned.policies))
    named = [row for row in rows if row["fluid"] is not None]
    ranged = [{k: cell for k, cell in row.items() if k != "fluid"} for row in rows if row["fluid"] is None]
    strays, swims = _swims(config, evaluate, jobs, learned.policies)
    tables = {
        "curves": learned.curves,
        "evaluations": pd.DataFrame(named),
        "range": pd.DataFrame(ranged),
        "course": pd.DataFrame(strays),
        "steps": learned.steps,
    }
    return tables, swims, learned.published(config.published)


def _places(config: TeacherStudentConfig, job: TrainingJob) -> Iterator[tuple[Row, Scenario]]:
    """Everywhere a policy is evaluated, with its labels: fluid (None for one of the range), viscosity and variant."""
    variants = config.variants(job)
    for name in config.fluids:
        fluid = named_fluid(name)
        for variant, scenario in variants.items():
            place = {"fluid": name, "viscosity": fluid.kinematic_viscosity, "variant": variant}
            yield place, scenario.but(fluid=fluid)
    for viscosity in np.geomspace(*VISCOSITIES, config.viscosities).tolist():
        place = {"fluid": None, "viscosity": viscosity, "variant": "finer step"}
        yield place, variants["finer step"].but(fluid=Fluid(kinematic_viscosity=viscosity))


def _evaluated(
    config: TeacherStudentConfig, evaluate: Evaluator, jobs: list[TrainingJob], policies: dict[Key, Policy]
) -> Iterator[Row]:
    asked = [
        (
            {"policy": job.name, "seed": job.seed} | place | numerics(scenario),
            Case(policies[job.key], scenario),
        )
        for job in jobs
        for place, scenario in _places(config, job)
    ]
    yield from swim_rows(evaluate, asked)


def _swims(
    config: TeacherStudentConfig, evaluate: Evaluator, jobs: list[TrainingJob], policies: dict[Key, Policy]
) -> tuple[list[dict[str, object]], dict[str, Trajectory]]:
    """How far every policy strays in every fluid, and the swims of those shown."""
    strays, swims = list[dict[str, object]](), dict[str, Trajectory]()
    firsts = {job.name: job.key for job in reversed(jobs)}
    asked = [
        (job, place["fluid"], scenario)
        for job in jobs
        for place, scenario in _places(config, job)
        if place["fluid"] is not None and place["variant"] == "finer step"
    ]
    every = thinning(config.verify_rate)
    tasks = ((policies[job.key], scenario, every) for job, _, scenario in asked)
    for (job, fluid, _), (strayed, swim) in zip(asked, evaluate.compute(_stray, tasks), strict=True):
        strays.append({"policy": job.name, "seed": job.seed, "fluid": fluid, "stray": strayed})
        if job.name in config.shown and firsts[job.name] == job.key:
            swims[f"{job.name}-{fluid}"] = swim
    return strays, swims


def _stray(policy: Policy, scenario: Scenario, every: int) -> tuple[float, Trajectory]:
    """What a worker does: how far a policy strays, and every `every`-th row of its swim."""
    swim = simulate(policy, scenario)
    return metrics.stray(swim), swim.thinned(every)
