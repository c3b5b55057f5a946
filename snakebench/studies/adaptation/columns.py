"""The tables of the adaptation study."""

from snakebench.studies.columns import CONTENDER, ORIGIN
from snakebench.tables import EVALUATION, Columns

_GAIT: Columns = {"gait": int | None}  # number of a single gait among those of its method; `contenders` describes it
_CONTENDER: Columns = CONTENDER | _GAIT
_SWIM: Columns = {"course": str} | _CONTENDER
_TOTALS: Columns = dict.fromkeys(("distance", "speed", "power", "positive_power"), float | None)
_REST = dict.fromkeys(("cost_of_transport", "positive_cost_of_transport", "stray"), float | None)
_IDEAL: Columns = dict.fromkeys(("ideal_distance", "ideal_net", "ideal_positive"), float | None)
_CHANGE: Columns = {"time": float, "from": str, "to": str, "steady_speed": float}
_POINT: Columns = {"time": float, "x": float, "viscosity": float, "speed": float, "power": float}
TABLES: dict[str, Columns] = {
    "steady": _CONTENDER | {"fluid": str | None, "viscosity": float} | EVALUATION,
    # `ideal_distance` is that of the same swimmer if it were always at its steady state; `ideal_CURRENCY` that of ideal
    # switching of the limit at the mean power of the swimmer, P ("net") or P+ ("positive").
    "courses": _SWIM
    | {"variant": str, "engine": str, "physics_rate": int, "status": str | None}
    | _TOTALS
    | _REST
    | _IDEAL,
    # The distance of ideal switching of the limit at mean powers.
    "ideal": {"course": str, "currency": str, "power": float, "distance": float},
    # Ideal switching among the gaits of a method, each tuned to a fluid, of each seed of their search.
    "switching": {"course": str, "method": str, "seed": int | None} | _TOTALS,
    # Seconds until a swimmer is known to be back within 5 % of its steady speed; share of the gait periods within it;
    # distance lost against its steady speed [m].
    "recoveries": _SWIM | _CHANGE | dict.fromkeys(("seconds", "held", "loss"), float | None),
    "traces": _SWIM | _POINT | {"positive_power": float},
    # Mean speeds over fluids at equal mean power: of one gait for all, of the best gait of each, and of the limit.
    "worth": {"fluids": str, "diameter": float, "currency": str, "power": float, "gaits": int}
    | dict.fromkeys(("single_speed", "tuned_speed", "gain", "limit_speed"), float | None),
    "contenders": ORIGIN | _GAIT | {"price": float | None},
}
