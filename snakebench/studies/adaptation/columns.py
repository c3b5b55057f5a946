"""The tables of the adaptation study."""

from snakebench.studies.cross.columns import CONTENDER, ORIGIN
from snakebench.tables import EVALUATION, Columns

_SWIM: Columns = {"course": str} | CONTENDER
_TOTALS: Columns = dict.fromkeys(("distance", "speed", "power", "positive_power"), float | None)
_REST = dict.fromkeys(("cost_of_transport", "positive_cost_of_transport", "stray", "ideal_distance"), float | None)
_CHANGE: Columns = {"time": float, "from": str, "to": str, "steady_speed": float}
_POINT: Columns = {"time": float, "x": float, "viscosity": float, "speed": float, "power": float}
TABLES: dict[str, Columns] = {
    "steady": CONTENDER | {"fluid": str | None, "viscosity": float} | EVALUATION,
    # `ideal_distance` is that of the same swimmer if it were always at its steady state.
    "courses": _SWIM | {"variant": str, "engine": str, "physics_rate": int, "status": str | None} | _TOTALS | _REST,
    # Ideal switching among the gaits of a method, each tuned to a fluid, of each seed of their search.
    "switching": {"course": str, "method": str, "seed": int | None} | _TOTALS,
    # Seconds until a swimmer is back within 5 % of its steady speed; share of the gait periods within it.
    "recoveries": _SWIM | _CHANGE | {"seconds": float | None, "held": float | None},
    "traces": _SWIM | _POINT | {"positive_power": float | None},
    "contenders": ORIGIN,
}
