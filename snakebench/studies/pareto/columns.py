"""The tables of studies of the fronts of fixed gaits; parameters of the gaits are further columns."""

from __future__ import annotations

from snakebench.report.table import MEASURED
from snakebench.tables import EVALUATION, Columns

_POINT: Columns = {"space": str, "point": int, "speed": float, "power": float, "positive_power": float | None}
_NAMED = ("fastest", "thriftiest", "knee")  # points; a front beyond the reference has no knee
_SEARCHED_AND_SHAPE = ("speed_searched", "power_searched", "swim_frequency", "tail_amplitude", "joint_amplitude")

FRONT_TABLES: dict[str, Columns] = {  # which several studies write
    # Further columns are the parameters of gaits, or what else names the points of a front.
    "fronts": _POINT
    | {"front": str, "cost_of_transport": float, "positive_cost_of_transport": float | None, "steady": bool}
    | dict.fromkeys(_SEARCHED_AND_SHAPE, float | None),
    # Further columns, FLUID_point, are the points of the fluids' fronts that are combined.
    "switching": _POINT,
    # Further columns, speed_at_POWER_W [m/s] and positive_power_at_POWER_W [W], compare fronts at equal power.
    "indicators": {"space": str, "front": str, "points": int, "beyond": int}
    | {"hypervolume": float, "hypervolume_searched": float}
    | {f"{point}_{name}": float | None for point in _NAMED for name in ("speed", "power", "positive_power")},
}
TABLES: dict[str, Columns] = FRONT_TABLES | {
    "grid": {"space": str, "fluid": str, "status": str, "steady": bool} | dict.fromkeys(MEASURED, float | None),
    "verified": {"fluid": str} | EVALUATION | {"speed_searched": float, "power_searched": float},
    "growth": {"space": str, "objective": str, "method": str, "seed": int, "simulations": int, "hypervolume": float},
    "attainment": {"space": str, "objective": str, "surface": str, "speed": float, "power": float},
}
