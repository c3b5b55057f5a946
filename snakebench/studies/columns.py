"""Columns of tables that several studies write or read."""

from snakebench.tables import Columns

CONTENDER: Columns = {"method": str, "tuned_to": str, "seed": int}
ORIGIN: Columns = CONTENDER | {"study": str, "commit": str | None, "digest": str | None}
# A search for free waveforms is tuned to a fluid, or "integrated" to the mean over all. Its objective is the "return",
# or speed less a "price" of P or a "positive price" of P+.
WAVEFORM: Columns = {"tuned_to": str, "harmonics": int, "objective": str, "price": float | None, "seed": int}

# The currency is that of the power that a front counts: net, P, or positive, P+.
_POINT: Columns = {"space": str, "currency": str, "point": int, "speed": float, "power": float}
_POINT |= {"positive_power": float}
_NAMED = ("fastest", "thriftiest", "knee")  # points; a front beyond the reference has no knee
SEARCHED: Columns = dict.fromkeys(("speed_searched", "power_searched", "positive_power_searched"), float | None)
_SHAPE: Columns = dict.fromkeys(("swim_frequency", "tail_amplitude", "joint_amplitude"), float | None)

FRONT_TABLES: dict[str, Columns] = {  # which several studies write
    # The gaits on each front, as verified. Further columns are their parameters, or what else names them.
    "fronts": _POINT
    | {"front": str, "cost_of_transport": float, "positive_cost_of_transport": float, "steady": bool}
    | SEARCHED
    | _SHAPE,
    # The simple-sum front. Further columns, FLUID_point, are the points of the fluids' fronts that are combined.
    "switching": _POINT,
    # What each front is worth. Further columns, at equal power of its currency: speed_at_POWER_W [m/s], 0 below its
    # least power and empty beyond its fastest point, power_at_POWER_W and positive_power_at_POWER_W [W].
    "indicators": {"space": str, "front": str, "currency": str, "points": int, "beyond": int}
    | {"hypervolume": float, "hypervolume_searched": float}
    | {f"{point}_{name}": float | None for point in _NAMED for name in ("speed", "power", "positive_power")},
}
