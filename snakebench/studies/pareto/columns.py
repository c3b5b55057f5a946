"""The tables of studies of the fronts of fixed gaits; parameters of the gaits are further columns."""

from snakebench.studies.indicators import MEASURED
from snakebench.tables import EVALUATION, Columns

# The currency is that of the power that a front counts: net, P, or positive, P+.
_POINT: Columns = {"space": str, "currency": str, "point": int, "speed": float, "power": float}
_POINT |= {"positive_power": float | None}
_NAMED = ("fastest", "thriftiest", "knee")  # points; a front beyond the reference has no knee
_SEARCHED: Columns = dict.fromkeys(("speed_searched", "power_searched", "positive_power_searched"), float | None)
_SHAPE: Columns = dict.fromkeys(("swim_frequency", "tail_amplitude", "joint_amplitude"), float | None)

FRONT_TABLES: dict[str, Columns] = {  # which several studies write
    # The gaits on each front, as verified. Further columns are their parameters, or what else names them.
    "fronts": _POINT
    | {"front": str, "cost_of_transport": float, "positive_cost_of_transport": float | None, "steady": bool}
    | _SEARCHED
    | _SHAPE,
    # The simple-sum front. Further columns, FLUID_point, are the points of the fluids' fronts that are combined.
    "switching": _POINT,
    # What each front is worth. Further columns, at equal power of its currency: speed_at_POWER_W [m/s], 0 below its
    # least power and empty beyond its fastest point, power_at_POWER_W and positive_power_at_POWER_W [W].
    "indicators": {"space": str, "front": str, "currency": str, "points": int, "beyond": int}
    | {"hypervolume": float, "hypervolume_searched": float}
    | {f"{point}_{name}": float | None for point in _NAMED for name in ("speed", "power", "positive_power")},
}
_SEARCH: Columns = {"space": str, "objective": str, "currency": str}
TABLES: dict[str, Columns] = FRONT_TABLES | {
    # Every gait of the grids in every fluid, as searched.
    "grid": {"space": str, "fluid": str, "status": str, "steady": bool} | dict.fromkeys(MEASURED, float | None),
    # Every gait on a front in the front's fluids, as verified, beside what was searched.
    "verified": {"fluid": str} | EVALUATION | _SEARCHED,
    # Hypervolume of each search, as searched, and what the best, the median and the worst seed of NSGA-II attain: both
    # of points as they are, as staircases. The power is that of the currency.
    "growth": _SEARCH | {"method": str, "seed": int, "simulations": int, "hypervolume": float},
    "attainment": _SEARCH | {"surface": str, "speed": float, "power": float},
}
