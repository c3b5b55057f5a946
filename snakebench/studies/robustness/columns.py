"""The tables of the study of robustness."""

from snakebench.studies.columns import CONTENDER, ORIGIN
from snakebench.tables import EVALUATION, Columns

_PLACE: Columns = CONTENDER | {"fluid": str}
SHOWN = ("status", "steady", "speed", "path_speed", "power", "positive_power")
_SWIM: Columns = {name: EVALUATION[name] for name in SHOWN}
_RATIOS: Columns = {"speed": float, "power": float | None, "positive_power": float | None, "course": float | None}
TABLES: dict[str, Columns] = {
    # One perturbation at a time; of the swim without any it is "none".
    "sweeps": _PLACE | {"perturbation": str, "value": float} | _SWIM,
    "combinations": _PLACE | {"draw": int} | _SWIM,
    "draws": {"draw": int},  # and the value of each perturbation in it
    # What should be borne, of all contenders.
    "targets": _PLACE | {"target": str} | _SWIM,
    # Means over the range of a perturbation: speed and powers [1], course [rad]; `areas.py`.
    "areas": _PLACE | {"perturbation": str} | _RATIOS,
    "contenders": ORIGIN,
}
