"""What the largest assumptions change, as far as a study has measured it."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

from snakebench.comparison.measured import mean_return
from snakebench.comparison.results import FINE, Measurement, Missing, Results
from snakebench.report.assumptions import Assumption, ledger
from snakebench.report.method_names import name_of

Effect = Callable[[Results], str]


def assumptions_with_effects(results: Results) -> list[tuple[Assumption, str]]:
    """Every assumption of the learned policies, and its measured effect; an empty one where none was measured.

    Raises:
        Missing: when there are no learned policies.
    """
    return [(row, "; ".join(_measured(results, row.id))) for row in ledger(results.study("teacher_student").config)]


def _measured(results: Results, id: str) -> list[str]:
    effects = []
    for effect in _EFFECTS.get(id, ()):
        try:
            effects.append(effect(results))
        except Missing:
            continue
    return effects


def _other_swims(results: Results, label: str, robot: str, rate: int, digits: int) -> str:
    """The speed of the same student on another robot or at another rate."""
    pairs = {
        fluid: (_student(results, robot, rate, fluid), _student(results, "default", 960, fluid))
        for fluid in results.fluids
    }
    return _changes(label, pairs, digits)


def _student(results: Results, robot: str, rate: int, fluid: str) -> Measurement:
    """The published student's speed on a robot at a rate of PyBullet."""
    where = {"method": "student", "robot": robot, "fluid": fluid, "engine": "pybullet"}
    id = f"student/{fluid}/speed, {robot} robot, {rate} Hz"
    return results.measure(id, "m/s", "sensitivity", "swims", "speed", physics_rate=rate, **where)


def _relearned(results: Results, label: str, policy: str) -> str:
    """The speed of students that learned under another assumption."""
    pairs = {}
    for fluid in results.fluids:
        where = {"policy": policy, "fluid": fluid} | FINE
        own = results.measure(f"{policy}/{fluid}/speed", "m/s", "relearned", "evaluations", "speed", **where)
        pairs[fluid] = own, results.policy("speed", fluid)
    return _changes(label, pairs)


def _changes(label: str, pairs: dict[str, tuple[Measurement, Measurement]], digits: int = 0) -> str:
    changes = [f"{fluid} {100 * (new.mean / usual.mean - 1):+.{digits}f}" for fluid, (new, usual) in pairs.items()]
    return f"{label}, change of v [%]: {', '.join(changes)} (n = {next(iter(pairs.values()))[0].n})"


def _returns(results: Results, policy: str, usual: str) -> str:
    """The return of policies that learned under another assumption beside that of the usual ones."""
    own, other = mean_return(results, policy), mean_return(results, usual)
    numbers = f"{own.text(1)} against {other.text(1)} (n = {own.n} and {other.n})"
    return f"return, {name_of(policy)} against {name_of(usual)}: {numbers}"


_EFFECTS: dict[str, tuple[Effect, ...]] = {
    "diameter": (
        partial(_other_swims, label="same student at 0.0686 m", robot="slim", rate=960, digits=0),
        partial(_relearned, label="student trained at 0.0686 m", policy="student_slim"),
    ),
    "rates": (
        partial(_other_swims, label="same student at 1920 Hz", robot="default", rate=1920, digits=1),
        partial(_relearned, label="student trained at 15 Hz control", policy="student_15Hz"),
        partial(_relearned, label="at 60 Hz", policy="student_60Hz"),
    ),
    "limits": (partial(_returns, policy="limited_student", usual="student"),),
    "head-velocity": (partial(_returns, policy="memoryless_viscosity", usual="memoryless_teacher"),),
    "ppo": (
        partial(_returns, policy="symmetric_short", usual="symmetric"),
        partial(_returns, policy="teacher_short", usual="teacher"),
    ),
    "distillation": (partial(_returns, policy="literal_student", usual="student"),),
}
