"""The tables of the sensitivity study."""

from snakebench.studies.columns import CONTENDER, ORIGIN
from snakebench.studies.pareto.columns import TABLES as PARETO
from snakebench.tables import EVALUATION, Columns

TABLES: dict[str, Columns] = {
    "swims": CONTENDER | {"robot": str, "fluid": str, "engine": str, "physics_rate": int} | EVALUATION,
    "fronts": PARETO["fronts"] | {"robot": str},
    "indicators": PARETO["indicators"] | {"robot": str},
    "contenders": ORIGIN,
}
