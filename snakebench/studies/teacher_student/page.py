"""What the teacher-student page shows: policies and how they learned, to sentences, tables and figures."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from snakebench.report import paper
from snakebench.report.animation import swimmer
from snakebench.report.assumptions import assumptions_of_learning, learned_viscosities
from snakebench.report.method_names import name_of
from snakebench.report.seed_figure import over_viscosity
from snakebench.report.summary import first, over_seeds, seeds, size, step_and_engine, summary
from snakebench.report.tables import (
    TAKEN,
    Table,
    downloads,
    failures,
    in_both_currencies,
    interval,
    number,
)
from snakebench.robot import Robot
from snakebench.studies.teacher_student import figures
from snakebench.studies.teacher_student.servos import limits_said, robot_of, servo_table
from snakebench.tables import read_table
from snakebench.trajectory import Trajectory

_NUMBERS = {
    "speed": "v [m/s]",
    **TAKEN,
    "swim_frequency": "f [Hz]",
    "tail_amplitude": "tail [m]",
    "return": "J",
}
_BOUNDED = {"speed": "v", "return": "J"}  # whose intervals are shown
_MAIN = ("teacher", "student", "symmetric", "memoryless_teacher")
_LEARNED = (*_MAIN, "asymmetric_critic", "teacher_short", "symmetric_short")
_TOLD = {  # whom the answer is about; without any of them, the students
    "teacher": "The teacher, which knows the fluid and its own velocity,",
    "student": "The student, which feels only its joints and its head's turning,",
    "symmetric": "The same learner without privileged information",
}
_STRAIGHT = np.radians(15)


def page(directory: Path, manifest: dict[str, Any]) -> dict[str, Any]:
    """Everything the teacher-student page shows."""
    config = manifest["config"]
    curves, evaluations, ranged, course, steps = (
        read_table(directory / f"{name}.csv") for name in ("curves", "evaluations", "range", "course", "steps")
    )
    evaluations = in_both_currencies(evaluations)
    fine = evaluations[evaluations["variant"] == "finer step"]
    order = list(dict.fromkeys(steps["policy"]))
    students = [name for name in order if "teacher" in config["policies"][name]]
    trained = [name for name in order if name not in students]
    swims = {name: _swims(directory, name, config["fluids"]) for name in config["shown"] if name in order}
    shown = swims.get("student") or next(iter(swims.values()), {})
    first = fine[(fine["policy"] == ("student" if "student" in swims else next(iter(swims), "")))]
    frequencies = {
        str(fluid): float(part["swim_frequency"].iloc[0])
        for fluid, part in first.groupby("fluid")
        if part["swim_frequency"].notna().iloc[0]
    }
    compared = [name for name in ("teacher", "student", "symmetric") if name in order]
    return {
        "manifest": manifest,
        "config": config,
        "viscosities": learned_viscosities(config),
        "answers": list(_answers(fine, ranged, students, config)),
        "swimmers": [swimmer(f"{name} in {fluid}", swim) for name in swims for fluid, swim in swims[name].items()],
        "summary": _summary(fine, [name for name in order if name in _MAIN] or order),
        "variants": _variants(fine, ranged, order),
        "seeds": _every_seed(fine, order),
        "paper": _beside_paper(fine, ranged, config),
        "retained": _retained(ranged, course, students, config) if students else None,
        "learning": figures.learning(curves, [name for name in trained if name in _LEARNED] or trained),
        "distillation": figures.distillation(curves, students) if students else None,
        "over_viscosity": over_viscosity(
            in_both_currencies(ranged).rename(columns={"policy": "method"}), compared or order
        ),
        "torques": figures.torques(shown) if shown else None,
        "snapshots": figures.snapshots({f: s for f, s in shown.items() if f in frequencies}, frequencies)
        if frequencies
        else None,
        "course": _course(course, order),
        "engines": _engines(evaluations, order, manifest),
        "effort": _effort(steps, config),
        "servos": servo_table(fine, order, config),
        "unsteady": int((~fine["steady"]).sum()),
        "n_swims": len(fine),
        "failed": failures(fine),
        "downloads": downloads(directory, "evaluations", "range", "curves", "course"),
        "assumptions": assumptions_of_learning(config),
    }


def _swims(directory: Path, name: str, fluids: Sequence[str]) -> dict[str, Trajectory]:
    return {fluid: Trajectory.load(directory / "trajectories" / f"{name}-{fluid}.npz") for fluid in fluids}


def _answers(
    fine: pd.DataFrame, ranged: pd.DataFrame, students: Sequence[str], config: dict[str, Any]
) -> Iterator[str]:
    """The findings, a sentence each."""
    named = {name: what for name, what in _TOLD.items() if name in set(fine["policy"])}
    for name, what in (named or {name: f"The {name_of(name)}" for name in students}).items():
        of_policy = fine[fine["policy"] == name]
        speeds = "; ".join(
            f"{part['speed'].mean():.3f} m/s at {part['power'].mean():.1f} W in {fluid}"
            for fluid, part in of_policy.groupby("fluid", sort=False)
        )
        n = of_policy["seed"].nunique()
        yield f"{what} swims {speeds} (mean of {n} seed{'s' if n > 1 else ''})."
    for name in [name for name in students if name == "student" or not named]:
        shares = _shares(ranged, name, config)
        yield (
            f"Over the range of viscosities the {name_of(name)} earns {100 * shares.mean():.1f} % of its teacher's"
            f" return ({seeds(100 * shares, '.1f')} by seed)."
        )


def _shares(ranged: pd.DataFrame, student: str, config: dict[str, Any]) -> pd.Series:
    """The student's share of its teacher's return, both as means over the range of viscosities, by seed."""
    means = ranged.groupby(["policy", "seed"])["return"].mean()
    return (means.loc[student] / means.loc[config["policies"][student]["teacher"]]).dropna()


def _summary(fine: pd.DataFrame, order: Sequence[str]) -> Table:
    """Mean over seeds of every policy in every fluid, with the interval of the speed and of the return."""
    means = [(head, partial(_mean, column)) for column, head in _NUMBERS.items()]
    intervals = [(f"interval of {head}", partial(_interval, column)) for column, head in _BOUNDED.items()]
    return summary(
        "Mean over the seeds of each policy in every fluid, at the finer rate, with the 95 % Student-t intervals of the"
        " mean speed and return.",
        fine,
        {"policy": order, "fluid": fine["fluid"].unique()},
        [("n", size), *means, *intervals],
    )


def _mean(column: str, part: pd.DataFrame) -> str:
    return number(part[column].mean())


def _interval(column: str, part: pd.DataFrame) -> str:
    return interval(part[column].dropna(), ".4g")


def _variants(fine: pd.DataFrame, ranged: pd.DataFrame, order: Sequence[str]) -> Table:
    """All policies side by side: speed and powers in each fluid, and the return over the range."""
    pairs = fine.groupby(["policy", "fluid"]).apply(_pair).unstack("fluid")
    fluids = [(f"v at P / P+ in {fluid}", first(fluid)) for fluid in fine["fluid"].unique()]
    return summary(
        "All policies and ablations: mean speed [m/s] at mean powers [W] in each fluid, and return, averaged over the"
        " range of viscosities: mean, each seed, 95 % Student-t interval of the mean.",
        _returns(ranged).join(pairs, on="policy"),
        {"policy": order},
        [("n", size), *fluids, ("J over the range", _each_return), ("interval", partial(_interval, "return"))],
    )


def _returns(ranged: pd.DataFrame) -> pd.DataFrame:
    """Mean return over the range of viscosities, by policy and seed."""
    return ranged.groupby(["policy", "seed"], sort=False)["return"].mean().reset_index()


def _each_return(part: pd.DataFrame) -> str:
    return f"{part['return'].mean():.1f} ({seeds(part['return'], '.0f')})"


def _pair(part: pd.DataFrame) -> str:
    return f"{part['speed'].mean():.3f} at {part['power'].mean():.1f} / {part['positive_power'].mean():.1f}"


def _every_seed(fine: pd.DataFrame, order: Sequence[str]) -> Table:
    rows = [
        [f"{name_of(name)} {row['seed']}, {row['fluid']}{'' if row['steady'] else ' †'}"]
        + [number(row[column]) for column in _NUMBERS]
        for name in order
        for row in fine[fine["policy"] == name].sort_values("seed", kind="stable").to_dict("records")
    ]
    return Table(
        "Every seed, at the finer rate. † had not settled, or its velocity has no three even peaks, as is usual for a"
        " policy: measured over whole periods of its second half.",
        ["policy seed, fluid", *_NUMBERS.values()],
        rows,
    )


def _beside_paper(fine: pd.DataFrame, ranged: pd.DataFrame, config: dict[str, Any]) -> Table:
    """What the paper claims, and the same of ours."""
    return Table(
        "The paper's figures beside ours, means over seeds in PyBullet. The robot's diameter in its simulator is not"
        " known: trends compare, digits do not. Returns are means over the range of viscosities, ours without the noise"
        " of exploration.",
        ["", "paper", "ours", "n"],
        list(_papers_rows(fine[fine["policy"] == "student"], ranged, Robot(**config["robot"]).total_mass)),
    )


def _papers_rows(students: pd.DataFrame, ranged: pd.DataFrame, mass: float) -> Iterator[list[str]]:
    """What the paper claims and ours: speed, power and cost in each fluid, returns, and the trend of the frequency."""
    for fluid, claim in paper.POLICY.items():
        if len(part := students[students["fluid"] == fluid]):
            theirs = f"{claim.speed:.2f}, {claim.power(mass):.1f}, {claim.cost_of_transport:.2f}"
            ours = ", ".join(_mean(column, part) for column in ("speed", "power", "cost_of_transport"))
            yield [f"policy in {fluid}: v [m/s], P [W], CoT", theirs, ours, size(part)]
    returns = _returns(ranged)
    for name, claimed in paper.RETURNS.items():
        if len(part := returns[returns["policy"] == name]):
            yield [f"mean return, {name_of(name)}", f"about {claimed}", _each_return(part), size(part)]
    thin, thick = (students[students["fluid"] == name]["swim_frequency"] for name in ("water", "oil2"))
    if len(thin) and len(thick):
        ours = f"{thin.mean():.2f} to {thick.mean():.2f} Hz"
        yield ["policy's frequency from water to oil2", paper.trend("swim_frequency") + " Hz", ours, str(len(thin))]


def _retained(ranged: pd.DataFrame, course: pd.DataFrame, students: Sequence[str], config: dict[str, Any]) -> Table:
    """What each student keeps of its teacher's return, and whether it holds its course."""
    parts = [pd.DataFrame({"policy": name, "share": 100 * _shares(ranged, name, config)}) for name in students]
    straight = (course["stray"] <= _STRAIGHT).groupby(course["policy"]).agg(lambda held: f"{held.sum()} of {len(held)}")
    return summary(
        "Return of each student as a share of its own teacher's, both as means over the range of viscosities.",
        pd.concat(parts).join(straight.rename("straight"), on="policy"),
        {"policy": students},
        [
            ("n", size),
            *over_seeds("share", "share of each seed [%]", ".1f"),
            ("swims within 15° of the course", first("straight")),
        ],
        head="student",
    )


def _course(course: pd.DataFrame, order: Sequence[str]) -> Table:
    """How far each policy strays, by fluid: the worst seed and all."""
    degrees = course.assign(stray=np.degrees(course["stray"]))
    fluids = list(dict.fromkeys(course["fluid"]))
    by_seed = degrees.pivot(index=["policy", "seed"], columns="fluid", values="stray").reset_index()
    return summary(
        "Largest angle between x and the direction of travel over any 5 s of a swim of 30 s: the worst seed, and each.",
        by_seed,
        {"policy": order},
        [(fluid, partial(_strays, fluid)) for fluid in fluids],
    )


def _strays(fluid: str, part: pd.DataFrame) -> str:
    return f"{part[fluid].max():.0f}° ({seeds(part[fluid], '.0f')})"


def _engines(evaluations: pd.DataFrame, order: Sequence[str], manifest: Mapping[str, Any]) -> Table:
    """How much return and speed depend on the step and the engine, of policies that earn something in every fluid."""
    learned = evaluations[evaluations["variant"] == "planar"].groupby("policy")["return"].min()
    sums = evaluations.groupby(["policy", "seed", "variant"])["return"].transform("sum")
    return step_and_engine(
        evaluations.assign(sum=sums),
        {"policy": [name for name in order if learned[name] > 0]},
        ["seed", "fluid"],
        {"sum": "ΣJ", "return": "J", "speed": "v"},
        manifest,
        ", of all seeds and fluids, of the policies that earn something in every fluid. ΣJ is the sum over all fluids,"
        " J and v are of a single one; a small J makes its own change large",
    )


def _effort(steps: pd.DataFrame, config: dict[str, Any]) -> Table:
    rows = []
    for name, part in steps.groupby("policy", sort=False):
        settings = config["policies"][name]
        what = f"from {name_of(settings['teacher'])}" if "teacher" in settings else "by PPO"
        if settings.get("feels") == ["sensors"] and "critic" not in settings and "teacher" not in settings:
            what += ", privileged critic"
        what += limits_said(robot_of(config, str(name)))
        feels = ", ".join(settings.get("feels", ["sensors"] if "teacher" in settings else ["sensors", "privileged"]))
        rows.append(
            [
                name_of(str(name)),
                what,
                feels,
                "none" if settings.get("lstm") == [] else "LSTM",
                f"{part['steps'].iloc[0] / 1e6:g}",
                f"{part['rollout'].iloc[0]}",
                f"{part['kl'].iloc[0]:g}" if part["kl"].notna().all() else "–",
                f"{len(part)}",
            ]
        )
    head = ["policy", "learned", "actor feels", "memory", "million steps", "rollout", "KL", "n"]
    caption = (
        "The policies, and what each took to learn: control steps of all robots together, those of a rollout, as far as"
        " gradients reach back, and the change per update that the learning rate follows."
    )
    return Table(caption, head, rows)
