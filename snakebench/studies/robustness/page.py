"""The page of the study of robustness."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd

from snakebench.names import ADAPTIVE
from snakebench.report import table
from snakebench.report.table import PERTURBATION_LABELS, Column, Table, summary
from snakebench.studies.published import Published
from snakebench.studies.robustness import figures
from snakebench.studies.robustness.areas import DEAD_JOINT, KEPT, NOMINAL, SWIM, course, kept


def page(study: Published) -> dict[str, Any]:
    """What the page shows."""
    config, sweeps = study.config, study.tables["sweeps"]
    areas, swept = study.tables["areas"], kept(sweeps, sweeps)
    combined = kept(study.tables["combinations"], sweeps)
    nominal = table.of_valid(sweeps[sweeps["perturbation"] == NOMINAL])
    by = {"method": nominal["method"].unique(), "fluid": config["fluids"]}
    ours, theirs = config["robust_pilots"][0], config["pilots"][0]
    borne = of_unperturbed(study.tables["targets"], nominal, theirs)
    against = ratios(nominal, study.tables["combinations"], ours, theirs)
    return {
        "findings": {
            "combined": combined,
            "targets": borne,
            "dead": _dead(borne, config["targets"]),
            "against": against,
        },
        "targets": targets_table(borne, config["targets"], config["fluids"]) if len(borne) else None,
        "nominal": summary(
            nominal.assign(course=np.degrees(course(nominal))),
            by,
            [("n", table.size), "speed", "power", "positive_power", ("course [°]", table.mean("course", 1))],
        ),
        "areas": _area_table(areas, config["fluids"]),
        "least": least_table(swept, config["fluids"]),
        "beside": beside(against) if len(against) else None,
        "pictures": {
            PERTURBATION_LABELS[name]: figures.sweep(
                swept[swept["perturbation"] == name], PERTURBATION_LABELS[name], config["fluids"]
            )
            for name in config["ranges"]
        },
        "combinations": figures.combinations(combined, config["fluids"]) if len(combined) else None,
        "combined": _combined_table(combined, by),
        "ranges": Table(
            ["perturbation", "from", "to"],
            [[PERTURBATION_LABELS[name], *map(table.number, ends)] for name, ends in config["ranges"].items()],
        ),
        **table.validity(pd.concat([sweeps, study.tables["combinations"], study.tables["targets"]])),
        "robust": bool(set(nominal["method"]) & set(config["robust_pilots"])),
        "policies": bool((nominal["tuned_to"] == ADAPTIVE).any()),
        "methods": [table.name_of(method) for method in nominal["method"].unique()],
    }


def _area_table(areas: pd.DataFrame, fluids: list[str]) -> Table:
    shown = {"v": ("speed", 3), "P": ("power", 3), "P+": ("positive_power", 3), "course [°]": ("course", 1)}
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


def of_unperturbed(swims: pd.DataFrame, nominal: pd.DataFrame, theirs: str) -> pd.DataFrame:
    """Swims with their speed as a share of the unperturbed speed of a policy in the fluid, mean over its seeds [1].

    A run that is not valid has none. Without that policy there are no rows.
    """
    plain = nominal[nominal["method"] == theirs].groupby("fluid")["speed"].mean()
    share = swims["speed"].where(swims["status"] == "ok", 0.0) / swims["fluid"].map(plain)
    return swims.assign(share=share).dropna(subset="share")


def targets_table(borne: pd.DataFrame, targets: Mapping[str, Any], fluids: Sequence[str]) -> Table:
    """Of each target the share of the speed that every contender keeps, beside its target [%]; its course."""
    asked = borne["target"].map({name: 100 * one["share"] for name, one in targets.items()})
    shown = borne.assign(asked=asked, course=np.degrees(course(borne)))
    columns: list[Column] = [("target [%]", table.first("asked", ".0f"))]
    cells = {"": table.share("share"), ", course [°]": table.mean("course", 0)}
    columns += [(f"{fluid}{what}", table.at(cell, fluid=fluid)) for fluid in fluids for what, cell in cells.items()]
    return summary(shown, ["target", "method"], columns)


def _dead(borne: pd.DataFrame, targets: Mapping[str, Any]) -> pd.DataFrame:
    """Of targets with a dead joint the mean share over the seeds, by method, fluid and target."""
    dead = [name for name, one in targets.items() if DEAD_JOINT in one["perturbations"]]
    rows = borne[borne["target"].isin(dead)]
    return rows.groupby(["method", "fluid", "target"], sort=False)["share"].mean().reset_index()


def ratios(nominal: pd.DataFrame, combinations: pd.DataFrame, ours: str, theirs: str) -> pd.DataFrame:
    """How fast one policy is beside another, by means over the seeds: columns fluid, plain, combined, faster and n.

    Ratios of their speeds, unperturbed and of their means over the combinations; and in how many of the n it is faster.
    The row "all" is of the means over the fluids of shares of the other's unperturbed speed. A run that is not valid
    has speed 0.
    """
    plain = nominal.groupby(["fluid", "method"], sort=False)["speed"].mean().unstack()
    if not {ours, theirs} <= set(plain) or combinations.empty:
        return pd.DataFrame(columns=["fluid", "plain", "combined", "faster", "n"])
    swims = combinations.assign(speed=combinations["speed"].where(combinations["status"] == "ok", 0.0))
    swum = swims.groupby(["draw", "fluid", "method"])["speed"].mean().unstack()
    shares = swum.div(plain[theirs], axis=0, level="fluid").groupby("draw").mean()
    parts = {str(fluid): swum.xs(fluid, level="fluid") for fluid in plain.index} | {"all": shares}
    plains = (plain[ours] / plain[theirs]).to_dict()
    plains["all"] = np.mean(list(plains.values()))
    rows = [
        (fluid, plains[fluid], part[ours].mean() / part[theirs].mean(), (part[ours] > part[theirs]).sum(), len(part))
        for fluid, part in parts.items()
    ]
    return pd.DataFrame(rows, columns=["fluid", "plain", "combined", "faster", "n"])


def beside(against: pd.DataFrame) -> Table:
    """The table of `ratios`."""
    cells = zip(*(against[name] for name in ("fluid", "plain", "combined", "faster")), strict=True)
    rows = [[fluid, f"{plain:.3f}", f"{combined:.3f}", str(faster)] for fluid, plain, combined, faster in cells]
    return Table(["fluid", "v / v, unperturbed", "in combinations", f"faster, of {against['n'].iloc[0]}"], rows)


def _combined_table(combined: pd.DataFrame, by: dict[str, Any]) -> Table:
    """Of each seed the mean and the worst of the combinations, then the mean over the seeds."""
    seeds = combined.assign(failed=combined["status"] != "ok").groupby(SWIM, sort=False)
    means = seeds[list(KEPT)].mean().assign(worst=seeds["speed"].min(), failed=seeds["failed"].sum()).reset_index()
    means["course"] = np.degrees(means["course"])
    shown = {
        "v / v₀": ("speed", 3),
        "least v / v₀": ("worst", 3),
        "P / P₀": ("power", 3),
        "P+ / P+₀": ("positive_power", 3),
    }
    columns = [(head, table.mean(*cell)) for head, cell in (shown | {"course [°]": ("course", 1)}).items()]
    return summary(means, by, [("n", table.size), *columns, ("not valid, of each seed", table.every("failed", ".0f"))])
