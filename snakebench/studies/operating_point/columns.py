"""The tables of the study of the paper's operating point."""

from snakebench.studies.columns import ORIGIN
from snakebench.tables import EVALUATION, Columns

# `as_trained` marks the robot that the policies were trained on; with others they swim without being retrained.
_POLICY: Columns = {"method": str, "seed": int, "diameter": float, "as_trained": bool}
# Half and full peak-to-peak across the swimming direction, of the tail's tip and of the last link's centre [m].
AMPLITUDES: Columns = dict.fromkeys(("tip_half", "tip_full", "link_half", "link_full"), float | None)
TABLES: dict[str, Columns] = {
    # `match` says whether planar's power is within the tolerance of the paper's ("solved"), or else on which side of it
    # ("below", "above"): the policy's nearest.
    "points": _POLICY
    | {"fluid": str, "preference": float, "target_power": float, "match": str, "searches": int}
    | {"variant": str, "engine": str, "physics_rate": int}
    | EVALUATION,
    # The command torque of the gait of a fluid, at the paper's power there, replayed open loop in every fluid.
    "matrix": _POLICY | {"gait_of": str, "fluid": str, "variant": str, "physics_rate": int} | EVALUATION,
    "sinusoid": {"diameter": float, "fluid": str, "physics_rate": int} | AMPLITUDES | EVALUATION,
    "contenders": ORIGIN,
}
