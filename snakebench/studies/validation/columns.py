"""The tables of the validation study."""

from __future__ import annotations

from snakebench.tables import EVALUATION, Columns

_NUMERICS: Columns = {"engine": str, "physics_rate": int}
TABLES: dict[str, Columns] = {
    "runs": {"gait": str, "drives": str, "fluid": str} | _NUMERICS | EVALUATION,
    "order": {"gait": str, "drives": str} | _NUMERICS | {"error": float},
    "adversaries": {"adversary": str, "fluid": str} | _NUMERICS | EVALUATION | {"end_x": float, "end_y": float},
    "costs": {"drives": str} | _NUMERICS | {"seconds_per_second": float},
}
