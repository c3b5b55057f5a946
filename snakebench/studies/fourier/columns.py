"""The tables of the Fourier study."""

from __future__ import annotations

from snakebench.studies.pareto.columns import FRONT_TABLES
from snakebench.tables import EVALUATION, Columns

_SEARCH: Columns = {"tuned_to": str, "harmonics": int, "objective": str, "price": float | None, "seed": int}
TABLES: dict[str, Columns] = {
    **FRONT_TABLES,
    "fronts": FRONT_TABLES["fronts"] | _SEARCH,
    "growth": _SEARCH | {"gaits": int, "best": float},
    "optima": _SEARCH | {"value": float, "fluid": str, "variant": str, "engine": str, "physics_rate": int} | EVALUATION,
    "gaits": _SEARCH | {"frequency": float, "joint": int, "harmonic": int, "cosine": float, "sine": float},
}
