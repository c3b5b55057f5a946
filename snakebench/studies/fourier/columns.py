"""The tables of the Fourier study."""

from snakebench.studies.columns import FRONT_TABLES, WAVEFORM
from snakebench.tables import EVALUATION, Columns

TABLES: dict[str, Columns] = {
    **FRONT_TABLES,
    "fronts": FRONT_TABLES["fronts"] | WAVEFORM,
    # The best value found so far, one row a generation; `gaits` counts with those of the search that it continues.
    "growth": WAVEFORM | {"gaits": int, "best": float},
    # The best gait of every search in each of its fluids, as searched and at two finer steps; its coefficients.
    "optima": WAVEFORM
    | {"value": float, "fluid": str, "variant": str, "engine": str, "physics_rate": int}
    | EVALUATION,
    "gaits": WAVEFORM | {"frequency": float, "joint": int, "harmonic": int, "cosine": float, "sine": float},
}
