"""The page of the study of robustness."""

from typing import Any

import numpy as np
import pandas as pd

from snakebench.names import ADAPTIVE
from snakebench.report import table
from snakebench.report.table import PERTURBATION_LABELS, Table, summary
from snakebench.studies.published import Published
from snakebench.studies.robustness import figures
from snakebench.studies.robustness.areas import KEPT, NOMINAL, SWIM, kept


def page(study: Published) -> dict[str, Any]:
    """What the page shows."""
    config, sweeps = study.config, study.tables["sweeps"]
    areas, swept = study.tables["areas"], kept(sweeps, sweeps)
    combined = kept(study.tables["combinations"], sweeps)
    nominal = table.of_valid(sweeps[sweeps["perturbation"] == NOMINAL])
    by = {"method": nominal["method"].unique(), "fluid": config["fluids"]}
    return {
        "findings": {"combined": combined},
        "nominal": summary(nominal, by, [("n", table.size), "speed", "power"]),
        "areas": _area_table(areas, config["fluids"]),
        "least": least_table(swept, config["fluids"]),
        "beside": beside(nominal, study.tables["combinations"], config["robust_pilots"][0], config["pilots"][0]),
        "pictures": {
            PERTURBATION_LABELS[name]: figures.sweep(
                swept[swept["perturbation"] == name], PERTURBATION_LABELS[name], config["fluids"]
            )
            for name in config["ranges"]
        },
        "combinations": figures.combinations(combined, config["fluids"]) if len(combined) else None,
        "combined": _combined_table(combined, by),
        **table.validity(pd.concat([sweeps, study.tables["combinations"]])),
        "robust": bool(set(nominal["method"]) & set(config["robust_pilots"])),
        "policies": bool((nominal["tuned_to"] == ADAPTIVE).any()),
    }


def _area_table(areas: pd.DataFrame, fluids: list[str]) -> Table:
    shown = {"v": ("speed", 3), "P": ("power", 3), "course [°]": ("course", 1)}
    cells = {name: table.mean(*cell) for name, cell in shown.items()}
    columns = [(f"{fluid}, {name}", table.at(cell, fluid=fluid)) for fluid in fluids for name, cell in cells.items()]
    return summary(areas.assign(course=np.degrees(areas["course"])), ["perturbation", "method"], columns)


def least_table(swept: pd.DataFrame, fluids: list[str]) -> Table:
    """Of each sweep the least speed kept, in the mean over the seeds, and the value and the course at which it is."""
    by = ["perturbation", "method", "fluid", "value"]
    means = swept.assign(course=np.degrees(swept["course"])).groupby(by, sort=False)[["speed", "course"]].mean()
    means = means.dropna(subset="speed").reset_index()
    least = means.loc[means.groupby(["perturbation", "method", "fluid"], sort=False)["speed"].idxmin()]
    shown = {name: table.first(name, form) for name, form in {"speed": ".3f", "value": ".3g", "course": ".0f"}.items()}
    columns = [
        (f"{fluid}, {head}", table.at(shown[name], fluid=fluid))
        for fluid in fluids
        for head, name in {"v": "speed", "at": "value", "course [°]": "course"}.items()
    ]
    return summary(least[least["perturbation"] != NOMINAL], ["perturbation", "method"], columns)


def beside(nominal: pd.DataFrame, combinations: pd.DataFrame, ours: str, theirs: str) -> Table | None:
    """How fast one policy is beside another, unperturbed and in combinations, by means over the seeds."""
    plain = nominal.groupby(["fluid", "method"], sort=False)["speed"].mean().unstack()
    if not {ours, theirs} <= set(plain) or combinations.empty:
        return None
    swims = combinations.assign(speed=combinations["speed"].where(combinations["status"] == "ok", 0.0))
    swum = swims.groupby(["draw", "fluid", "method"], sort=False)["speed"].mean().unstack()
    ratios = pd.DataFrame(
        {"plain": plain[ours] / plain[theirs], "combined": (swum[ours] / swum[theirs]).unstack().mean()}
    )
    faster = (swum[ours] > swum[theirs]).unstack().sum()
    means = swum.div(plain[theirs], axis=0, level="fluid").groupby("draw").mean()
    rows = [[fluid, *(f"{ratio:.3f}" for ratio in ratios.loc[fluid]), str(faster[fluid])] for fluid in plain.index]
    combined = (means[ours] / means[theirs]).mean()
    whole = ["all", f"{ratios['plain'].mean():.3f}", f"{combined:.3f}", str((means[ours] > means[theirs]).sum())]
    return Table(["fluid", "v / v, unperturbed", "in combinations", f"faster, of {len(means)}"], [*rows, whole])


def _combined_table(combined: pd.DataFrame, by: dict[str, Any]) -> Table:
    """Of each seed the mean and the worst of the combinations, then the mean over the seeds."""
    seeds = combined.groupby(SWIM, sort=False)
    means = seeds[list(KEPT)].mean().assign(worst=seeds["speed"].min()).reset_index()
    means["course"] = np.degrees(means["course"])
    shown = {"v / v₀": ("speed", 3), "least v / v₀": ("worst", 3), "P / P₀": ("power", 3), "course [°]": ("course", 1)}
    return summary(means, by, [("n", table.size), *((head, table.mean(*cell)) for head, cell in shown.items())])
