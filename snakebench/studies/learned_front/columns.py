"""The tables of the learned-front study."""

from snakebench.studies.columns import FRONT_TABLES
from snakebench.tables import EVALUATION, Columns

_POLICY: Columns = {"policy": str, "seed": int}
TABLES: dict[str, Columns] = {
    **FRONT_TABLES,
    # Of each policy and seed; what was "searched" is the planar engine's, in which policies learn.
    "fronts": FRONT_TABLES["fronts"] | {"price": float, "wave_speed": float | None},
    "curves": _POLICY | {"steps": int, "return_mean": float | None, "error": float | None},
    "steps": _POLICY | {"steps": int, "rollout": int | None, "kl": float | None},
    # Every policy and seed at every price in every fluid, in both engines, at some prices with a coarser step.
    "dial": _POLICY | {"price": float, "fluid": str, "variant": str, "engine": str, "physics_rate": int} | EVALUATION,
    # What the best, the median and the worst seed of a policy attain, by the power of the currency.
    "attainment": {"policy": str, "front": str, "currency": str, "surface": str, "speed": float, "power": float},
}
