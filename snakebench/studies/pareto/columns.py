"""The tables of studies of the fronts of fixed gaits; parameters of the gaits are further columns."""

from snakebench.studies.columns import FRONT_TABLES, SEARCHED
from snakebench.studies.indicators import MEASURED
from snakebench.tables import EVALUATION, Columns

_SEARCH: Columns = {"space": str, "objective": str, "currency": str}
TABLES: dict[str, Columns] = FRONT_TABLES | {
    # Every gait of the grids in every fluid, as searched.
    "grid": {"space": str, "fluid": str, "status": str, "steady": bool} | dict.fromkeys(MEASURED, float | None),
    # Every gait on a front in the front's fluids, as verified, beside what was searched.
    "verified": {"fluid": str} | EVALUATION | SEARCHED,
    # Hypervolume of each search, as searched, and what the best, the median and the worst seed of NSGA-II attain: both
    # of points as they are, as staircases. The power is that of the currency.
    "growth": _SEARCH | {"method": str, "seed": int, "simulations": int, "hypervolume": float},
    "attainment": _SEARCH | {"surface": str, "speed": float, "power": float},
}
