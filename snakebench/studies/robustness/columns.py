"""The tables of the study of robustness."""

from snakebench.studies.columns import CONTENDER, ORIGIN
from snakebench.tables import EVALUATION, Columns

_PLACE: Columns = CONTENDER | {"fluid": str}
_RATIOS: Columns = {"speed": float, "power": float | None, "course": float | None}
TABLES: dict[str, Columns] = {
    # One perturbation at a time; of the swim without any it is "none".
    "sweeps": _PLACE | {"perturbation": str, "value": float} | EVALUATION,
    "combinations": _PLACE | {"draw": int} | EVALUATION,
    "draws": {"draw": int},  # and the value of each perturbation in it
    # Means over the range of a perturbation: speed and power [1], course [rad]; `areas.py`.
    "areas": _PLACE | {"perturbation": str} | _RATIOS,
    "contenders": ORIGIN,
}
