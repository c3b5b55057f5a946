"""The tables of the learned-front study."""

from __future__ import annotations

from snakebench.studies.pareto.columns import FRONT_TABLES
from snakebench.tables import EVALUATION, Columns

_POLICY: Columns = {"policy": str, "seed": int}
TABLES: dict[str, Columns] = {
    **FRONT_TABLES,
    "fronts": FRONT_TABLES["fronts"] | {"price": float, "wave_speed": float | None},
    "curves": _POLICY | {"steps": int, "return_mean": float | None, "error": float | None},
    "steps": _POLICY | {"steps": int, "rollout": int, "kl": float | None},
    "dial": _POLICY | {"price": float, "fluid": str, "variant": str, "engine": str, "physics_rate": int} | EVALUATION,
    "attainment": {"policy": str, "front": str, "surface": str, "speed": float, "power": float},
}
