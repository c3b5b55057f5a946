"""The tables of the teacher-student study."""

from snakebench.tables import EVALUATION, Columns

_POLICY: Columns = {"policy": str, "seed": int}
_SWIM: Columns = {"viscosity": float, "variant": str, "engine": str, "physics_rate": int} | EVALUATION
TABLES: dict[str, Columns] = {
    "curves": _POLICY | {"steps": int, "return_mean": float | None, "error": float | None},
    "evaluations": _POLICY | {"fluid": str} | _SWIM,
    "range": _POLICY | _SWIM,
    # The largest angle between x and the direction of travel [rad].
    "course": _POLICY | {"fluid": str, "stray": float | None},
    "steps": _POLICY | {"steps": int, "rollout": int | None, "kl": float | None},
}
