"""The tables of the sea-snake study."""

from snakebench.tables import EVALUATION, Columns

_GAIT: Columns = {"amplitude": float, "frequency": float, "phase": float}  # [rad, Hz, rad]
_TRIED: Columns = {"objective": str, "seed": int, "trial": int} | _GAIT | {"value": float | None}
_OPTIMUM: Columns = (
    {"objective": str, "seed": int, "fluid": str, "variant": str, "engine": str, "physics_rate": int, "diameter": float}
    | _GAIT
    | EVALUATION
)
TABLES: dict[str, Columns] = {
    # Every evaluation of every search, and the best gait of each as searched, at two steps and on a neutral robot.
    "trials": _TRIED | {"fluid": str} | EVALUATION,
    "optima": _OPTIMUM,
    # Every gait of the searches of the comparison, and the best gait of each as searched and verified.
    "samplers": {"sampler": str} | _TRIED,
    "winners": {"sampler": str} | _OPTIMUM,
}
