"""The tables of the cross study."""

from snakebench.studies.columns import ORIGIN
from snakebench.tables import EVALUATION, Columns

TABLES: dict[str, Columns] = {
    # `loop` is "open" for the replayed torque of `gait_of`, "closed" for the controller itself.
    "matrix": dict.fromkeys(("method", "loop", "gait_of", "fluid", "variant"), str)
    | {"seed": int, "physics_rate": int}
    | EVALUATION,
    "contenders": ORIGIN,
}
