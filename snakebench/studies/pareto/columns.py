"""The tables of studies of the fronts of fixed gaits; parameters of the gaits are further columns."""

from snakebench.report.table import MEASURED
from snakebench.tables import EVALUATION, Columns

_POINT: Columns = {"space": str, "point": int, "speed": float, "power": float, "positive_power": float | None}
_NAMED = ("fastest", "thriftiest", "knee")  # points; a front beyond the reference has no knee
_SEARCHED_AND_SHAPE = ("speed_searched", "power_searched", "swim_frequency", "tail_amplitude", "joint_amplitude")

FRONT_TABLES: dict[str, Columns] = {  # which several studies write
    # The gaits on each front, as verified. Further columns are their parameters, or what else names them.
    "fronts": _POINT
    | {"front": str, "cost_of_transport": float, "positive_cost_of_transport": float | None, "steady": bool}
    | dict.fromkeys(_SEARCHED_AND_SHAPE, float | None),
    # The simple-sum front. Further columns, FLUID_point, are the points of the fluids' fronts that are combined.
    "switching": _POINT,
    # What each front is worth. Further columns, at equal power: speed_at_POWER_W [m/s], positive_power_at_POWER_W [W].
    "indicators": {"space": str, "front": str, "points": int, "beyond": int}
    | {"hypervolume": float, "hypervolume_searched": float}
    | {f"{point}_{name}": float | None for point in _NAMED for name in ("speed", "power", "positive_power")},
}
TABLES: dict[str, Columns] = FRONT_TABLES | {
    # Every gait of the grids in every fluid, as searched.
    "grid": {"space": str, "fluid": str, "status": str, "steady": bool} | dict.fromkeys(MEASURED, float | None),
    # Every gait on a front in the front's fluids, as verified, beside what was searched.
    "verified": {"fluid": str} | EVALUATION | {"speed_searched": float, "power_searched": float},
    # Hypervolume of each search, as searched, and what the best, the median and the worst seed of NSGA-II attain.
    "growth": {"space": str, "objective": str, "method": str, "seed": int, "simulations": int, "hypervolume": float},
    "attainment": {"space": str, "objective": str, "surface": str, "speed": float, "power": float},
}
