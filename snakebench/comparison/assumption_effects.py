"""The assumption ledger with what the largest assumptions are worth, as far as a study has measured it."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from snakebench.comparison.measured import mean_return
from snakebench.comparison.quantities import Measurement, Missing, Results, damage_as_missing, policy
from snakebench.report.assumptions import Assumption, assumptions_of_learning


def ledger_of_assumptions(results: Results) -> list[tuple[Assumption, str]]:
    """Every assumption of the learned policies, and its measured effect; an empty one where none was measured.

    Raises:
        Missing: when there are no learned policies.
    """
    rows = assumptions_of_learning(results.manifest("teacher_student")["config"])
    return [(row, _measured(results, row.about)) for row in rows]


def _measured(results: Results, about: str) -> str:
    effects = []
    for effect in _EFFECTS.get(about, ()):
        try:
            with damage_as_missing(about):
                effects.append(effect(results))
        except Missing:
            continue
    return " ".join(effects)


def _diameter(results: Results) -> str:
    parts = []
    for fluid in results.fluids:
        as_found, slim = (_student(results, robot, 960, fluid) for robot in ("default", "slim"))
        parts.append(_against(slim, as_found, fluid))
    return f"At 0.0686 m the same student swims {', '.join(parts)} (n = {slim.n})."


def _student(results: Results, robot: str, rate: int, fluid: str) -> Measurement:
    """The published student's speed on a robot at a rate of PyBullet."""
    where: dict[str, Any] = {"method": "student", "robot": robot, "fluid": fluid, "engine": "pybullet"}
    where["physics_rate"] = rate
    name = f"student, {robot} robot, {rate} Hz, {fluid}"
    return results.quantity(name, "m/s", "sensitivity", "swims", "speed", **where)


def _relearned(name: str, said: str) -> Callable[[Results], str]:
    def effect(results: Results) -> str:
        parts = []
        for fluid in results.fluids:
            where = {"policy": name, "fluid": fluid, "variant": "finer step"}
            found = results.quantity(f"{name} in {fluid}", "m/s", "relearned", "evaluations", "speed", **where)
            parts.append(_against(found, policy(results, "speed", fluid), fluid))
        return f"{said} {', '.join(parts)} (n = {found.n})."

    return effect


def _rate(results: Results) -> str:
    parts = []
    for fluid in results.fluids:
        fine, finer = (_student(results, "default", rate, fluid) for rate in (960, 1920))
        parts.append(_against(finer, fine, fluid, digits=1))
    return f"At 1920 Hz the student swims {', '.join(parts)} (n = {finer.n})."


def _ablation(name: str, other: str, said: str) -> Callable[[Results], str]:
    def effect(results: Results) -> str:
        means = [mean_return(results, one) for one in (name, other)]
        return f"{said}: return {means[0].text(1)} against {means[1].text(1)} (n = {means[0].n} and {means[1].n})."

    return effect


def _against(found: Measurement, usual: Measurement, fluid: str, digits: int = 0) -> str:
    return f"{100 * (found.mean / usual.mean - 1):+.{digits}f} % in {fluid}"


_EFFECTS: dict[str, tuple[Callable[[Results], str], ...]] = {
    "Diameter": (_diameter, _relearned("student_slim", "Learned anew for it, students swim")),
    "Rates": (
        _rate,
        _relearned("student_15Hz", "Learned at 15 Hz control, students swim"),
        _relearned("student_60Hz", "At 60 Hz"),
    ),
    "Limits": (_ablation("limited_student", "student", "Limited to 4 N m"),),
    "Head velocity": (_ablation("memoryless_viscosity", "memoryless_teacher", "Without it, and without memory"),),
    "PPO beyond the paper's table": (
        _ablation("symmetric_short", "symmetric", "From rollouts of 24 steps the symmetric learner earns"),
        _ablation("teacher_short", "teacher", "The teacher from such rollouts"),
    ),
    "Distillation": (_ablation("literal_student", "student", "To the letter of the paper"),),
}
