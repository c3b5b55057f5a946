"""The tables of the cross study."""

from snakebench.tables import EVALUATION, Columns

CONTENDER: Columns = {"method": str, "tuned_to": str, "seed": int}
ORIGIN: Columns = CONTENDER | {"study": str, "commit": str | None, "digest": str | None}
TABLES: dict[str, Columns] = {
    # `loop` is "open" for the replayed torque of `gait_of`, "closed" for the controller itself.
    "matrix": dict.fromkeys(("method", "loop", "gait_of", "fluid", "variant"), str)
    | {"seed": int, "physics_rate": int}
    | EVALUATION,
    "contenders": ORIGIN,
}
