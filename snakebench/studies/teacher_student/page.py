"""The page of the teacher-student study: policies, and how they learned."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd

from snakebench.names import FINE
from snakebench.report import learning_figure, paper, table
from snakebench.report.accuracy import step_changes, step_table
from snakebench.report.assumptions import learned_viscosities
from snakebench.report.seed_figure import over_viscosity
from snakebench.report.table import Table, digits3, every, first, largest, name_of, size, summary, under_labels
from snakebench.studies.published import Published
from snakebench.studies.published_fronts import same_settings
from snakebench.studies.teacher_student import figures

_SHOWN = under_labels(digits3, (*table.MEASURED, "swim_frequency", "tail_amplitude", "return"))
_USUAL = "teacher_student"  # the study of the paper's policies
_MAIN = ("teacher", "student", "symmetric", "memoryless_teacher")
_LIMITS = {"torque_limit": "N m", "speed_limit": "rad/s"}  # of robots
_SERVOS = {  # the heads of columns, and how seeds are taken together
    "command_torque_rms": ("RMS torque [N m]", "mean"),
    "command_torque_peak": ("peak torque [N m]", "max"),
    "joint_speed_peak": ("peak joint speed [rad/s]", "max"),
    "heat": ("heat [N² m²]", "mean"),
}


def page(study: Published) -> dict[str, Any]:
    """What the page shows."""
    config = study.config
    curves, evaluations, ranged, course, steps = study.tables.values()
    fine = table.of_valid(evaluations[evaluations["variant"] == FINE])
    order = list(steps["policy"].unique())
    students = [name for name in order if "teacher" in config["policies"][name]]
    trained = [name for name in order if name not in students]
    by = {"policy": order, "fluid": list(fine["fluid"].unique())}
    returns, course = _returns(ranged, config), course.assign(stray=np.degrees(course["stray"]))
    intervals = [(f"interval of {label}", table.interval_of(name)) for name, label in (("speed", "v"), ("return", "J"))]
    return {
        "findings": {"fine": fine, "returns": returns},
        "viscosities": learned_viscosities(config),
        "main": summary(fine, by, [("n", size), *_SHOWN, *intervals]),
        "returns": _return_table(returns, order),
        "usual": _usual_returns(study),
        "seeds": summary(fine, {"policy": order, "seed": sorted(fine["seed"].unique()), "fluid": by["fluid"]}, _SHOWN),
        "paper": _beside_paper(fine[fine["policy"] == "student"], study.robot.total_mass),
        "papers_returns": paper.RETURNS,
        "learning": learning_figure.learning(curves, trained),
        "distillation": learning_figure.distillation(curves, students) if students else None,
        "over_viscosity": over_viscosity(table.of_valid(ranged).rename(columns={"policy": "method"}), order),
        "course": summary(course, by, [("largest", largest("stray", ".0f")), ("each seed", every("stray", ".0f"))]),
        "engines": _engines(evaluations, order),
        "effort": _effort(steps, config),
        "servos": _servo_table(fine, by),
        **table.validity(fine),
        **_bodies(study, fine, order),
    }


def _returns(ranged: pd.DataFrame, config: Mapping[str, Any]) -> pd.DataFrame:
    """Mean return over the range of viscosities, by policy and seed; `share` of that of the teacher, of students."""
    returns = ranged.groupby(["policy", "seed"], sort=False)["return"].mean()
    teachers = {name: policy.get("teacher") for name, policy in config["policies"].items()}
    own = returns.reset_index()
    taught = returns.reindex(pd.MultiIndex.from_arrays([own["policy"].map(teachers), own["seed"]])).to_numpy()
    return own.assign(share=own["return"] / taught)


def _return_table(returns: pd.DataFrame, order: Sequence[str]) -> Table:
    shares = [("share of each seed [%]", every("percent", ".1f")), ("mean share [%]", table.share("share"))]
    columns = [("n", size), *table.over_seeds("return", "J of each seed", ".1f"), *shares]
    return summary(returns.assign(percent=100 * returns["share"]), {"policy": order}, columns)


def _usual_returns(study: Published) -> Table | None:
    """Returns of the policies of `teacher_student`, which the policies of another study are compared with."""
    usual = study.beside(_USUAL)
    if usual is None or usual.directory == study.directory or not same_settings(usual, study):
        return None
    returns = _returns(usual.tables["range"], usual.config)
    return _return_table(returns, [name for name in _MAIN if name in set(returns["policy"])])


def _beside_paper(students: pd.DataFrame, mass: float) -> Table:
    papers = pd.DataFrame(
        {"fluid": fluid, "v [m/s]": claim.speed, "P [W]": claim.power(mass), "CoT": claim.cost_of_transport}
        for fluid, claim in paper.POLICY.items()
    )
    forms = {"v [m/s]": ".2f", "P [W]": ".1f", "CoT": ".2f"}
    theirs = [(f"paper: {label}", first(label, form)) for label, form in forms.items()]
    ours = [(f"ours: {table.LABELS[name]}", table.mean(name)) for name in ("speed", "power", "cost_of_transport")]
    return summary(students.merge(papers, on="fluid"), ["fluid"], [*theirs, *ours, ("n", size)])


def _servo_table(fine: pd.DataFrame, by: Mapping[str, Sequence[str]]) -> Table:
    columns = [
        (head, lambda part, name=name, how=how: table.number(part[name].agg(how)))
        for name, (head, how) in _SERVOS.items()
    ]
    return summary(fine, by, [("n", size), *columns])


def _engines(evaluations: pd.DataFrame, order: Sequence[str]) -> Table:
    """How much return and speed depend on the step and the engine, of policies that earn something in every fluid."""
    learned = evaluations[evaluations["variant"] == "planar"].groupby("policy")["return"].min()
    sums = evaluations.groupby(["policy", "seed", "variant"])["return"].transform("sum")
    compared = {"sum": "ΣJ", "return": "J", "speed": "v"}
    changes = step_changes(evaluations.assign(sum=sums), ["policy", "seed", "fluid"], compared)
    return step_table(changes, {"policy": [name for name in order if learned[name] > 0]})


def _effort(steps: pd.DataFrame, config: Mapping[str, Any]) -> Table:
    def learned(policy: str) -> dict[str, str]:
        own = config["policies"][policy]
        kind = "distillation" if "teacher" in own else "imitation" if "demonstrations" in own else "training"
        settings = config.get(kind, {}) | own
        teacher = settings.get("teacher")
        observed = settings.get("feels", ["sensors"] if teacher else ["sensors", "privileged"])
        robot = config["robot"] | settings.get("robot", {})
        limits = [f"up to {robot[limit]:g} {unit}" for limit, unit in _LIMITS.items() if robot.get(limit)]
        critic = ", privileged critic" if observed == ["sensors"] and not teacher and "critic" not in settings else ""
        return {
            "learned": (f"from {name_of(teacher)}" if teacher else "by PPO") + critic,
            "observed": ", ".join(observed),
            "memory": "none" if settings.get("lstm") == [] else "LSTM",
            "limits": ", ".join(limits) or "none",
        }

    settings = pd.DataFrame({name: learned(name) for name in steps["policy"].unique()}).T
    both = steps.assign(millions=steps["steps"] / 1e6).join(settings, on="policy")
    columns = [(name, first(name)) for name in map(str, settings)]
    columns += [("million steps", first("millions", "g")), ("rollout", first("rollout", "g")), ("KL", first("kl", "g"))]
    return summary(both, ["policy"], [*columns, ("n", size)])


def _bodies(study: Published, fine: pd.DataFrame, order: Sequence[str]) -> dict[str, Any]:
    """Swims of the first seed of each policy shown: animations, and torques and bodies of the student or the first."""
    shown = [name for name in study.config["shown"] if name in order]
    places = {name: {fluid: f"{name}-{fluid}" for fluid in study.config["fluids"]} for name in shown}
    chosen = "student" if "student" in shown else next(iter(shown), "")
    own = {fluid: swim for fluid, file in places.get(chosen, {}).items() if (swim := study.swim(file))}
    first_seed = fine[fine["policy"] == chosen].drop_duplicates("fluid").set_index("fluid")
    frequencies: dict[Any, float] = first_seed["swim_frequency"].dropna().to_dict()
    rhythmic = {fluid: swim for fluid, swim in own.items() if fluid in frequencies}
    return {
        "chosen": name_of(chosen),
        "swimmers": study.swimmers({file: f"{name} in {at}" for name in shown for at, file in places[name].items()}),
        "torques": figures.torques(own) if own else None,
        "snapshots": figures.snapshots(rhythmic, frequencies) if rhythmic else None,
    }
