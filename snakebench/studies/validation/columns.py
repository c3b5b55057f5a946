"""The tables of the validation study."""

from snakebench.tables import EVALUATION, Columns

_NUMERICS: Columns = {"engine": str, "physics_rate": int}
TABLES: dict[str, Columns] = {
    "runs": {"gait": str, "drives": str, "fluid": str} | _NUMERICS | EVALUATION,
    # The largest difference of a joint angle from the limit after `order_duration` [rad].
    "order": {"gait": str, "drives": str} | _NUMERICS | {"error": float},
    # The centre of mass ends at end_x, end_y [m].
    "adversaries": {"adversary": str, "fluid": str} | _NUMERICS | EVALUATION | {"end_x": float, "end_y": float},
    # Of one robot on one core; measured, so they differ from run to run.
    "costs": {"drives": str} | _NUMERICS | {"seconds_per_second": float},
}
