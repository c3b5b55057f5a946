"""The tables of the Fourier study."""

from snakebench.studies.pareto.columns import FRONT_TABLES
from snakebench.tables import EVALUATION, Columns

# A search is tuned to a fluid, or "integrated" to the mean over all. Its objective is the "return", or speed less a
# "price" of P or a "positive price" of P+.
SEARCH: Columns = {"tuned_to": str, "harmonics": int, "objective": str, "price": float | None, "seed": int}
TABLES: dict[str, Columns] = {
    **FRONT_TABLES,
    "fronts": FRONT_TABLES["fronts"] | SEARCH,
    # The best value found so far, one row a generation; `gaits` counts with those of the search that it continues.
    "growth": SEARCH | {"gaits": int, "best": float},
    # The best gait of every search in each of its fluids, as searched and at two finer steps; its coefficients.
    "optima": SEARCH | {"value": float, "fluid": str, "variant": str, "engine": str, "physics_rate": int} | EVALUATION,
    "gaits": SEARCH | {"frequency": float, "joint": int, "harmonic": int, "cosine": float, "sine": float},
}
