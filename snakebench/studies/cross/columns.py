"""The tables of the cross study."""

from __future__ import annotations

from snakebench.studies.contender_columns import ORIGIN
from snakebench.tables import EVALUATION, Columns

TABLES: dict[str, Columns] = {
    "matrix": {
        "method": str,
        "seed": int,
        "loop": str,
        "gait_of": str,
        "fluid": str,
        "variant": str,
        "physics_rate": int,
    }
    | EVALUATION,
    "contenders": ORIGIN,
}
