"""Teacher-student study: privileged and proprioceptive policies, learned in planar, evaluated in PyBullet (paper)."""

from collections.abc import Iterator
from itertools import product

import numpy as np
import pandas as pd

from snakebench import metrics
from snakebench.execution import Case, Evaluator
from snakebench.fluid import Fluid, named_fluid
from snakebench.learning.settings import VISCOSITIES
from snakebench.names import FINE
from snakebench.scenario import Scenario
from snakebench.studies.protocol import Load, Outcome, Row, Swim, numerics, swim_rows
from snakebench.studies.teacher_student.settings import TeacherStudentConfig
from snakebench.studies.training_jobs import TrainingJob, learn, learning_load
from snakebench.trajectory import Trajectory


def plan(config: TeacherStudentConfig) -> list[Load]:
    """What the study evaluates; the learning comes before, and tells of its own time."""
    jobs = config.training_jobs()
    loads = [Load("angle", scenario, 1) for job in jobs for _, scenario in _places(config, job)]
    watched = Load("angle", loads[0].scenario, len(jobs) * len(config.fluids))
    return [*loads, learning_load(jobs, loads[0].scenario), watched]


def run(config: TeacherStudentConfig, evaluate: Evaluator) -> Outcome:
    """Train all policies, and evaluate each in every fluid and over the range of viscosities."""
    learned = learn(config, evaluate)
    swims: list[Swim] = [
        ({"policy": job.name, "seed": job.seed} | place | numerics(scenario), Case(learned.policies[job.key], scenario))
        for job in config.training_jobs()
        for place, scenario in _places(config, job)
    ]
    rows = pd.DataFrame(swim_rows(evaluate, swims))
    fine = [(labels, case) for labels, case in swims if labels["fluid"] and labels["variant"] == FINE]
    strays = evaluate.measured(_stray, [(case, ()) for _, case in fine])
    course = pd.DataFrame([dict(labels) for labels, _ in fine], columns=["policy", "seed", "fluid"])
    tables = {
        "curves": learned.curves,
        "evaluations": rows[rows["fluid"].notna()],
        "range": rows[rows["fluid"].isna()].drop(columns="fluid"),
        "course": course.assign(stray=strays),
        "steps": learned.steps,
    }
    firsts = {f"{labels['policy']}-{labels['fluid']}": case for labels, case in reversed(fine)}
    names = [f"{name}-{fluid}" for name in config.shown for fluid in config.fluids]
    return Outcome(tables, {name: firsts[name] for name in names if name in firsts}, learned.published, frames=60)


def _places(config: TeacherStudentConfig, job: TrainingJob) -> Iterator[tuple[Row, Scenario]]:
    """Everywhere a policy is evaluated, with its labels: fluid (None for one of the range), viscosity and variant."""
    variants = config.variants(job)
    for name, (variant, scenario) in product(config.fluids, variants.items()):
        fluid = named_fluid(name)
        place = {"fluid": name, "viscosity": fluid.kinematic_viscosity, "variant": variant}
        yield place, scenario.but(fluid=fluid)
    for viscosity in np.geomspace(*VISCOSITIES, config.viscosities).tolist():
        place = {"fluid": None, "viscosity": viscosity, "variant": FINE}
        yield place, variants[FINE].but(fluid=Fluid(kinematic_viscosity=viscosity))


def _stray(swim: Trajectory, _: Scenario) -> float:
    """How far a policy strays, for `Evaluator.measured`."""
    return metrics.stray(swim)
