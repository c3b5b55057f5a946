"""What the largest assumptions change, as far as a study has measured it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import suppress
from functools import partial

from snakebench.comparison.judges import mean_return
from snakebench.comparison.results import Measurement, Missing, Results
from snakebench.report.assumptions import Assumption, ledger
from snakebench.report.method_names import name_of


def assumptions_with_effects(results: Results) -> list[tuple[Assumption, str]]:
    """Every assumption of the learned policies, and its measured effect; an empty one where none was measured.

    Raises:
        Missing: when there are no learned policies.
    """
    found = []
    for assumption in ledger(results.study("teacher_student").config):
        effects = []
        for effect in _EFFECTS.get(assumption.id, ()):
            with suppress(Missing):
                effects.append(effect(results))
        found.append((assumption, "; ".join(effects)))
    return found


def _same_student(results: Results, label: str, robot: str = "default", rate: int = 960, digits: int = 0) -> str:
    """The speed of the published student on another robot, or at another rate of PyBullet."""

    def speed(fluid: str, robot: str, rate: int) -> Measurement:
        where = {"physics_rate": rate, "method": "student", "robot": robot, "fluid": fluid, "engine": "pybullet"}
        id = f"student/{fluid}/speed, {robot} robot, {rate} Hz"
        return results.rows("sensitivity", "swims", **where).measure(id, "m/s", "speed")

    pairs = {fluid: (speed(fluid, robot, rate), speed(fluid, "default", 960)) for fluid in results.fluids}
    return _changes(label, pairs, digits)


def _relearned(results: Results, label: str, policy: str) -> str:
    """The speed of students that learned under another assumption."""
    fluids = results.fluids
    pairs = {f: (results.policy("speed", f, policy, "relearned"), results.policy("speed", f)) for f in fluids}
    return _changes(label, pairs)


def _changes(label: str, pairs: Mapping[str, tuple[Measurement, Measurement]], digits: int = 0) -> str:
    changes = [f"{fluid} {100 * (new.mean / usual.mean - 1):+.{digits}f}" for fluid, (new, usual) in pairs.items()]
    return f"{label}, change of v [%]: {', '.join(changes)} (n = {next(iter(pairs.values()))[0].n})"


def _returns(results: Results, policy: str, usual: str) -> str:
    """The return of policies that learned under another assumption beside that of the usual ones."""
    new, old = mean_return(results, policy), mean_return(results, usual)
    numbers = f"{new.text(1)} against {old.text(1)} (n = {new.n} and {old.n})"
    return f"return, {name_of(policy)} against {name_of(usual)}: {numbers}"


_EFFECTS: dict[str, tuple[Callable[[Results], str], ...]] = {
    "diameter": (
        partial(_same_student, label="same student at 0.0686 m", robot="slim"),
        partial(_relearned, label="student trained at 0.0686 m", policy="student_slim"),
    ),
    "rates": (
        partial(_same_student, label="same student at 1920 Hz", rate=1920, digits=1),
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
