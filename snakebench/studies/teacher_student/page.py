"""What the teacher-student page shows: policies and how they learned, to sentences, tables and figures."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from snakebench.report import paper
from snakebench.report.animation import swimmer
from snakebench.report.assumptions import assumptions_of_learning, learned_viscosities
from snakebench.report.tables import (
    TAKEN,
    Table,
    at_vanishing_steps,
    downloads,
    failures,
    in_both_currencies,
    interval,
    number,
)
from snakebench.robot import Robot
from snakebench.store import read_table
from snakebench.studies.teacher_student import figures
from snakebench.studies.teacher_student.servos import limits_said, robot_of, servo_table
from snakebench.trajectory import Trajectory

_NUMBERS = {
    "speed": "v [m/s]",
    **TAKEN,
    "swim_frequency": "f [Hz]",
    "tail_amplitude": "tail [m]",
    "return": "J",
}


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
        "retained": _retained(ranged, course, students, config),
        "learning": figures.learning(curves, [name for name in trained if name in _LEARNED] or trained),
        "distillation": figures.distillation(curves, students) if students else None,
        "over_viscosity": figures.over_viscosity(ranged, compared or order),
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
    for name, what in (named or {name: f"The {_said(name)}" for name in students}).items():
        of_policy = fine[fine["policy"] == name]
        speeds = "; ".join(
            f"{part['speed'].mean():.3f} m/s at {part['power'].mean():.1f} W in {fluid}"
            for fluid, part in of_policy.groupby("fluid", sort=False)
        )
        n = of_policy["seed"].nunique()
        yield f"{what} swims {speeds} (mean of {n} seed{'s' if n > 1 else ''})."
    for name in [name for name in students if name == "student" or not named]:
        shares = _shares(ranged, name, config["policies"][name]["teacher"])
        yield (
            f"Over the range of viscosities the {_said(name)} earns {100 * shares.mean():.1f} % of its teacher's return"
            f" ({_many(100 * shares, '.1f')} by seed)."
        )


def _shares(ranged: pd.DataFrame, student: str, teacher: str) -> pd.Series:
    """The student's share of its teacher's return, both as means over the range of viscosities, by seed."""
    means = ranged.groupby(["policy", "seed"])["return"].mean()
    return (means.loc[student] / means.loc[teacher]).dropna()


def _summary(fine: pd.DataFrame, order: Sequence[str]) -> Table:
    """Mean over seeds of every policy in every fluid, with the interval of the speed and of the return."""
    rows = []
    for name in order:
        for fluid, part in fine[fine["policy"] == name].groupby("fluid", sort=False):
            means = [number(part[column].mean()) for column in _NUMBERS]
            rows.append(
                [
                    f"{_said(name)}, {fluid}",
                    str(len(part)),
                    *means,
                    _interval(part["speed"]),
                    _interval(part["return"]),
                ]
            )
    return Table(
        "Mean over the seeds of each policy in every fluid, at the finer rate, with the 95 % Student-t intervals of the"
        " mean speed and return.",
        ["policy, fluid", "n", *_NUMBERS.values(), "interval of v", "interval of J"],
        rows,
    )


def _variants(fine: pd.DataFrame, ranged: pd.DataFrame, order: Sequence[str]) -> Table:
    """All policies side by side: speed and powers in each fluid, and the return over the range."""
    fluids = list(dict.fromkeys(fine["fluid"]))
    rows = []
    for name in order:
        of_policy = fine[fine["policy"] == name]
        speeds = [_pair(of_policy[of_policy["fluid"] == fluid]) for fluid in fluids]
        returns = ranged[ranged["policy"] == name].groupby("seed")["return"].mean()
        seeds = f"{returns.mean():.1f} ({_many(returns, '.0f')})"
        rows.append([_said(name), str(len(returns)), *speeds, seeds, _interval(returns)])
    return Table(
        "All policies and ablations: mean speed [m/s] at mean powers [W] in each fluid, and return, averaged over the"
        " range of viscosities: mean, each seed, 95 % Student-t interval of the mean.",
        ["policy", "n", *(f"v at P / P+ in {fluid}" for fluid in fluids), "J over the range", "interval"],
        rows,
    )


def _pair(part: pd.DataFrame) -> str:
    return f"{part['speed'].mean():.3f} at {part['power'].mean():.1f} / {part['positive_power'].mean():.1f}"


def _every_seed(fine: pd.DataFrame, order: Sequence[str]) -> Table:
    rows = [
        [f"{_said(name)} {row['seed']}, {row['fluid']}{'' if row['steady'] else ' †'}"]
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
    mass = Robot(**config["robot"]).total_mass
    rows = []
    of_student = fine[fine["policy"] == "student"]
    for fluid, claim in paper.POLICY.items():
        part = of_student[of_student["fluid"] == fluid]
        if len(part):
            rows.append(
                [
                    f"policy in {fluid}: v [m/s], P [W], CoT",
                    f"{claim.speed:.2f}, {claim.power(mass):.1f}, {claim.cost_of_transport:.2f}",
                    ", ".join(number(part[column].mean()) for column in ("speed", "power", "cost_of_transport")),
                    str(len(part)),
                ]
            )
    for name, claimed in paper.RETURNS.items():
        returns = ranged[ranged["policy"] == name].groupby("seed")["return"].mean()
        if len(returns):
            rows.append(
                [
                    f"mean return, {_said(name)}",
                    f"about {claimed}",
                    f"{returns.mean():.1f} ({_many(returns, '.0f')})",
                    str(len(returns)),
                ]
            )
    thin, thick = (of_student[of_student["fluid"] == name]["swim_frequency"] for name in ("water", "oil2"))
    if len(thin) and len(thick):
        ours = f"{thin.mean():.2f} to {thick.mean():.2f} Hz"
        rows.append(
            ["policy's frequency from water to oil2", paper.trend("swim_frequency") + " Hz", ours, str(len(thin))]
        )
    return Table(
        "The paper's figures beside ours, means over seeds in PyBullet. The robot's diameter in its simulator is not"
        " known: trends compare, digits do not. Returns are means over the range of viscosities, ours without the noise"
        " of exploration.",
        ["", "paper", "ours", "n"],
        rows,
    )


def _retained(
    ranged: pd.DataFrame, course: pd.DataFrame, students: Sequence[str], config: dict[str, Any]
) -> Table | None:
    """What each student keeps of its teacher's return, and whether it holds its course."""
    rows = []
    for name in students:
        shares = 100 * _shares(ranged, name, config["policies"][name]["teacher"])
        straight = course[course["policy"] == name]["stray"] <= _STRAIGHT
        rows.append(
            [
                _said(name),
                str(len(shares)),
                _many(shares, ".1f"),
                f"{shares.mean():.1f}",
                interval(shares, ".1f"),
                f"{straight.sum()} of {len(straight)}",
            ]
        )
    head = ["student", "n", "share of each seed [%]", "mean", "95 % interval", "swims within 15° of the course"]
    caption = "Return of each student as a share of its own teacher's, both as means over the range of viscosities."
    return Table(caption, head, rows) if rows else None


def _course(course: pd.DataFrame, order: Sequence[str]) -> Table:
    """How far each policy strays, by fluid: the worst seed and all."""
    fluids = list(dict.fromkeys(course["fluid"]))
    rows = []
    for name in order:
        part = course[course["policy"] == name]
        degrees = [np.degrees(part[part["fluid"] == fluid]["stray"]) for fluid in fluids]
        rows.append([_said(name), *(f"{angles.max():.0f}° ({_many(angles, '.0f')})" for angles in degrees)])
    return Table(
        "Largest angle between x and the direction of travel over any 5 s of a swim of 30 s: the worst seed, and each.",
        ["policy", *fluids],
        rows,
    )


def _engines(evaluations: pd.DataFrame, order: Sequence[str], manifest: Mapping[str, Any]) -> Table:
    """How much return and speed change from the engine that policies learn in to PyBullet."""
    by = {variant: part.set_index(["policy", "seed", "fluid"]) for variant, part in evaluations.groupby("variant")}
    rows = []
    for name in order:
        cells = []
        learned = by["planar"].loc[[name]]
        if (learned["return"] <= 0).any():
            continue
        for variant in ("coarser step", "finer step"):
            found = by[variant].loc[[name]]
            sums = [table.groupby("seed")["return"].sum() for table in (found, learned)]
            changes = [sums[0] / sums[1], found["return"] / learned["return"], found["speed"] / learned["speed"]]
            cells += [_widest(100 * (change - 1)) for change in changes]
        fine, coarse = (by[variant].loc[[name], "return"] for variant in ("finer step", "coarser step"))
        limit = at_vanishing_steps(fine, coarse, manifest)
        rows.append([_said(name), *cells, _widest(100 * (limit / learned["return"] - 1))])
    head = ["ΣJ", "J", "v"]
    return Table(
        "Change from the planar engine to PyBullet [%], the largest of all seeds and fluids, at the coarser rate and at"
        " the finer one, of the policies that earn something in every fluid. ΣJ is the sum over all fluids, J and v"
        " are of a single one; a small J makes its own change large. Extrapolated to vanishing steps, what is left of"
        " the change is not PyBullet's step.",
        [
            "policy",
            *(f"{column}, coarser" for column in head),
            *(f"{column}, finer" for column in head),
            "J, extrapolated",
        ],
        rows,
    )


def _effort(steps: pd.DataFrame, config: dict[str, Any]) -> Table:
    rows = []
    for name, part in steps.groupby("policy", sort=False):
        settings = config["policies"][name]
        what = f"from {_said(settings['teacher'])}" if "teacher" in settings else "by PPO"
        if settings.get("feels") == ["sensors"] and "critic" not in settings and "teacher" not in settings:
            what += ", privileged critic"
        what += limits_said(robot_of(config, str(name)))
        feels = ", ".join(settings.get("feels", ["sensors"] if "teacher" in settings else ["sensors", "privileged"]))
        rows.append(
            [
                _said(str(name)),
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


def _widest(changes: pd.Series) -> str:
    known = changes.dropna().to_numpy()
    return f"{known[np.abs(known).argmax()]:+.1f}" if len(known) else "–"


def _interval(values: pd.Series) -> str:
    return interval(values.dropna(), ".4g")


def _many(values: pd.Series, digits: str) -> str:
    return ", ".join(f"{value:{digits}}" for value in values)


def _said(name: str) -> str:
    return name.replace("_", " ")
