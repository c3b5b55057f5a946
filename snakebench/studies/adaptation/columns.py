"""The tables of the adaptation study."""

from __future__ import annotations

from snakebench.studies.contender_columns import CONTENDER, ORIGIN
from snakebench.tables import EVALUATION, Columns

_TOTALS: Columns = dict.fromkeys(("distance", "speed", "power", "positive_power"), float | None)
_OTHERS: Columns = dict.fromkeys(
    ("cost_of_transport", "positive_cost_of_transport", "stray", "ideal_distance"), float | None
)
TABLES: dict[str, Columns] = {
    "steady": CONTENDER | {"fluid": str | None, "viscosity": float} | EVALUATION,
    "courses": {"course": str}
    | CONTENDER
    | {"variant": str, "engine": str, "physics_rate": int, "status": str | None}
    | _TOTALS
    | _OTHERS,
    "switching": {"course": str, "method": str} | _TOTALS,
    "recoveries": {"course": str}
    | CONTENDER
    | {"time": float, "from": str, "to": str, "steady_speed": float, "seconds": float | None, "held": float | None},
    "traces": {"course": str}
    | CONTENDER
    | {"time": float, "x": float, "viscosity": float, "speed": float, "power": float, "positive_power": float | None},
    "contenders": ORIGIN,
}
