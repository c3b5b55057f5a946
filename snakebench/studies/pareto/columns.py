"""The tables of studies of the fronts of fixed gaits; parameters of the gaits are further columns."""

from __future__ import annotations

from snakebench.report.table import MEASURED
from snakebench.studies.front_columns import FRONT_TABLES
from snakebench.tables import EVALUATION, Columns

_GRID: Columns = {"space": str, "fluid": str, "status": str, "steady": bool} | dict.fromkeys(MEASURED, float | None)
TABLES: dict[str, Columns] = {
    **FRONT_TABLES,
    "grid": _GRID,
    "verified": {"fluid": str} | EVALUATION | {"speed_searched": float, "power_searched": float},
    "growth": {"space": str, "objective": str, "method": str, "seed": int, "simulations": int, "hypervolume": float},
    "attainment": {"space": str, "objective": str, "surface": str, "speed": float, "power": float},
}
