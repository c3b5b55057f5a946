"""The columns of the tables of fronts, which several studies write."""

from __future__ import annotations

from snakebench.tables import Columns

_POINT: Columns = {"space": str, "point": int, "speed": float, "power": float, "positive_power": float | None}
_KNOWN: Columns = {"points": int, "hypervolume": float, "hypervolume_searched": float, "beyond": int}
_NAMED = ("fastest", "thriftiest", "knee")  # points; a front beyond the reference has no knee
_SHAPE = ("swim_frequency", "tail_amplitude", "joint_amplitude")  # not of means over fluids
_SEARCHED = ("speed_searched", "power_searched")

FRONT_TABLES: dict[str, Columns] = {
    # Further columns are the parameters of gaits, or what else names the points of a front.
    "fronts": _POINT
    | {"front": str, "cost_of_transport": float, "positive_cost_of_transport": float | None, "steady": bool}
    | dict.fromkeys((*_SEARCHED, *_SHAPE), float | None),
    # Further columns, FLUID_point, are the points of the fluids' fronts that are combined.
    "switching": _POINT,
    # Further columns, speed_at_POWER_W [m/s] and positive_power_at_POWER_W [W], compare fronts at equal power.
    "indicators": {"space": str, "front": str}
    | _KNOWN
    | {f"{point}_{name}": float | None for point in _NAMED for name in ("speed", "power", "positive_power")},
}
