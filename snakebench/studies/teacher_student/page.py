"""The page of the teacher-student study: policies, and how they learned."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import product
from typing import Any

import numpy as np
import pandas as pd

from snakebench.report import paper
from snakebench.report.accuracy import step_changes, step_table
from snakebench.report.animation import swimmer
from snakebench.report.assumptions import learned_viscosities
from snakebench.report.method_names import name_of
from snakebench.report.seed_figure import over_viscosity
from snakebench.report.table import (
    LABELS,
    MEASURED,
    POWERS,
    Table,
    digits3,
    failures,
    first,
    interval_of,
    listed,
    mean,
    over_seeds,
    size,
    summary,
)
from snakebench.robot import Robot
from snakebench.studies.published import Published
from snakebench.studies.teacher_student import figures
from snakebench.studies.teacher_student.servos import limits, robot_of, servo_table

_SHOWN = [(LABELS[name], digits3(name)) for name in (*MEASURED, "swim_frequency", "tail_amplitude", "return")]
_MAIN = ("teacher", "student", "symmetric", "memoryless_teacher")
_LEARNED = (*_MAIN, "asymmetric_critic", "teacher_short", "symmetric_short")
_STRAIGHT = 15.0  # angle to the course within which a policy holds it [°]


def page(study: Published) -> dict[str, Any]:
    """What the page shows."""
    config = study.config
    curves, evaluations, ranged, course, steps = study.tables.values()
    fine = evaluations[evaluations["variant"] == "finer step"]
    order = list(steps["policy"].unique())
    students = [name for name in order if "teacher" in config["policies"][name]]
    trained = [name for name in order if name not in students]
    compared = [name for name in ("teacher", "student", "symmetric") if name in order]
    returns, course = _returns(ranged, config), course.assign(stray=np.degrees(course["stray"]))
    fluids, main = fine["fluid"].unique(), [name for name in order if name in _MAIN] or order
    intervals = [(f"interval of {label}", interval_of(name)) for name, label in (("speed", "v"), ("return", "J"))]
    return {
        "findings": {"fine": fine, "returns": returns},
        "viscosities": learned_viscosities(config),
        "main": summary(fine, {"policy": main, "fluid": fluids}, [("n", size), *_SHOWN, *intervals]),
        "variants": _variants(fine, returns, order),
        "seeds": summary(fine, {"policy": order, "seed": sorted(fine["seed"].unique()), "fluid": fluids}, _SHOWN),
        "paper": _beside_paper(fine[fine["policy"] == "student"], Robot(**config["robot"]).total_mass),
        "papers_returns": paper.RETURNS,
        "retained": _retained(returns, course, students),
        "learning": figures.learning(curves, [name for name in trained if name in _LEARNED] or trained),
        "distillation": figures.distillation(curves, students) if students else None,
        "over_viscosity": over_viscosity(ranged.rename(columns={"policy": "method"}), compared or order),
        "course": _course(course, order),
        "engines": _engines(study, evaluations, order),
        "effort": _effort(steps, config),
        "servos": servo_table(fine, order, config),
        "unsteady": int((~fine["steady"]).sum()),
        "n_swims": len(fine),
        "failed": failures(fine),
        **_bodies(study, fine, order),
    }


def _returns(ranged: pd.DataFrame, config: Mapping[str, Any]) -> pd.DataFrame:
    """Mean return over the range of viscosities, by policy and seed; `share` of that of the teacher, of students."""
    returns = ranged.groupby(["policy", "seed"], sort=False)["return"].mean()
    teachers = {name: policy.get("teacher") for name, policy in config["policies"].items()}
    table = returns.reset_index()
    taught = returns.reindex(pd.MultiIndex.from_arrays([table["policy"].map(teachers), table["seed"]])).to_numpy()
    return table.assign(share=table["return"] / taught)


def _variants(fine: pd.DataFrame, returns: pd.DataFrame, order: Sequence[str]) -> Table:
    """All policies side by side: speed and powers in each fluid, and the return over the range."""
    wide = fine.pivot(index=["policy", "seed"], columns="fluid", values=["speed", *POWERS])
    wide.columns = [" ".join(names) for names in wide.columns]
    columns: list[Any] = [
        (f"{LABELS[name]}, {fluid}", mean(f"{name} {fluid}", 1 if name in POWERS else 3))
        for fluid, name in product(fine["fluid"].unique(), ("speed", *POWERS))
    ]
    table = returns.join(wide, on=["policy", "seed"])
    return summary(table, {"policy": order}, [("n", size), *columns, *over_seeds("return", "J of each seed", ".1f")])


def _beside_paper(students: pd.DataFrame, mass: float) -> Table:
    """The speed, power and cost of transport of the paper's policy in each fluid beside ours."""
    papers = pd.DataFrame(
        {"fluid": fluid, "v": claim.speed, "P": claim.power(mass), "CoT": claim.cost_of_transport}
        for fluid, claim in paper.POLICY.items()
    )
    theirs = [(f"paper: {label}", first(label, form)) for label, form in (("v", ".2f"), ("P", ".1f"), ("CoT", ".2f"))]
    ours = [(f"ours: {LABELS[name]}", mean(name)) for name in ("speed", "power", "cost_of_transport")]
    return summary(students.merge(papers, on="fluid"), ["fluid"], [*theirs, *ours, ("n", size)])


def _retained(returns: pd.DataFrame, course: pd.DataFrame, students: Sequence[str]) -> Table:
    """What each student keeps of its teacher's return, and whether it holds its course."""
    straight = (course["stray"] <= _STRAIGHT).groupby(course["policy"]).agg(lambda held: f"{held.sum()} of {len(held)}")
    table = returns.assign(percent=100 * returns["share"]).dropna(subset="share")
    shares = over_seeds("percent", "share of each seed [%]", ".1f")
    columns = [("n", size), *shares, ("within 15° [runs]", first("straight"))]
    return summary(table.join(straight.rename("straight"), on="policy"), {"policy": students}, columns)


def _course(course: pd.DataFrame, order: Sequence[str]) -> Table:
    """How far each policy strays, by fluid: the worst seed and all."""
    fluids = course["fluid"].unique()
    by_seed = course.pivot(index=["policy", "seed"], columns="fluid", values="stray").reset_index()
    cells = [
        (fluid, lambda part, fluid=fluid: f"{part[fluid].max():.0f} ({listed(part[fluid], '.0f')})") for fluid in fluids
    ]
    return summary(by_seed, {"policy": order}, cells)


def _engines(study: Published, evaluations: pd.DataFrame, order: Sequence[str]) -> Table:
    """How much return and speed depend on the step and the engine, of policies that earn something in every fluid."""
    learned = evaluations[evaluations["variant"] == "planar"].groupby("policy")["return"].min()
    sums = evaluations.groupby(["policy", "seed", "variant"])["return"].transform("sum")
    compared = {"sum": "ΣJ", "return": "J", "speed": "v"}
    changes = step_changes(evaluations.assign(sum=sums), ["policy", "seed", "fluid"], compared, study.manifest)
    return step_table(changes, {"policy": [name for name in order if learned[name] > 0]})


def _effort(steps: pd.DataFrame, config: Mapping[str, Any]) -> Table:
    """The settings of each policy, and how many control steps it learned from."""

    def learned(policy: str) -> dict[str, str]:
        settings = config["policies"][policy]
        teacher = settings.get("teacher")
        observed = settings.get("feels", ["sensors"] if teacher else ["sensors", "privileged"])
        critic = ", privileged critic" if observed == ["sensors"] and not teacher and "critic" not in settings else ""
        return {
            "learned": (f"from {name_of(teacher)}" if teacher else "by PPO") + critic,
            "observed": ", ".join(observed),
            "memory": "none" if settings.get("lstm") == [] else "LSTM",
            "limits": limits(robot_of(config, policy)),
        }

    settings = pd.DataFrame({name: learned(name) for name in steps["policy"].unique()}).T
    table = steps.assign(millions=steps["steps"] / 1e6).join(settings, on="policy")
    effort = [("million steps", first("millions", "g")), ("rollout", first("rollout")), ("KL", first("kl", "g"))]
    return summary(table, ["policy"], [*((name, first(name)) for name in map(str, settings)), *effort, ("n", size)])


def _bodies(study: Published, fine: pd.DataFrame, order: Sequence[str]) -> dict[str, Any]:
    """Swims of the first seed of each policy shown: animations, and torques and bodies of the student or the first."""
    shown = [name for name in study.config["shown"] if name in order]
    swims = {
        name: {fluid: swim for fluid in study.config["fluids"] if (swim := study.swim(f"{name}-{fluid}"))}
        for name in shown
    }
    chosen = "student" if "student" in shown else next(iter(shown), "")
    first_seed = fine[fine["policy"] == chosen].drop_duplicates("fluid").set_index("fluid")
    frequencies: dict[Any, float] = first_seed["swim_frequency"].dropna().to_dict()
    own = swims.get(chosen, {})
    rhythmic = {fluid: swim for fluid, swim in own.items() if fluid in frequencies}
    return {
        "swimmers": [swimmer(f"{name} in {fluid}", swim) for name in shown for fluid, swim in swims[name].items()],
        "torques": figures.torques(own) if own else None,
        "snapshots": figures.snapshots(rhythmic, frequencies) if rhythmic else None,
    }
