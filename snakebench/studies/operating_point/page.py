"""The page of the study of the paper's operating point."""

from collections.abc import Sequence
from typing import Any

import pandas as pd

from snakebench.fluid import named_fluid
from snakebench.names import ADAPTIVE, FINE
from snakebench.report import paper, table
from snakebench.report.accuracy import step_changes, step_table
from snakebench.report.matrix_figure import matrices
from snakebench.report.seed_figure import over_viscosity
from snakebench.report.table import COSTS, POWERS, Cell, Column, Table, mean, name_of, of_valid, size, summary
from snakebench.studies.operating_point import figures
from snakebench.studies.operating_point.columns import AMPLITUDES
from snakebench.studies.published import Published
from snakebench.studies.replays import replays

_TOLD = tuple(paper.TREND)  # of the torque only a range is stated, for all fluids
_CHANGES = {"speed": "v", "power": "P", "positive_power": "P+"}


def page(study: Published) -> dict[str, Any]:
    """What the page shows; a policy on a robot is a method of the figures and tables."""
    fluids = study.config["fluids"]
    points, matrix = (_on_robots(of_valid(study.tables[name])) for name in ("points", "matrix"))
    fine, replayed = (part[part["variant"] == FINE] for part in (points, matrix.assign(loop="open")))
    itself = fine.assign(loop="closed", gait_of=ADAPTIVE)
    papers, sinusoid = papers_policy(fluids, study.robot.total_mass), of_valid(study.tables["sinusoid"])
    swimmers, nearest = list(fine["method"].unique()), nearest_tails(sinusoid)
    along_x, along_path = replays(replayed), replays(along_the_path(replayed, study.weight))
    own, replay = ["method", "seed", "fluid"], ["method", "seed", "gait_of", "fluid"]
    swam, spent = {"fluid": fluids}, ("speed", "path_speed", *POWERS, *COSTS)
    chosen: list[Column] = [("n", size), ("λ [1/W]", mean("preference")), *spent, *_TOLD, "torque_amplitude"]
    shown = {f"{name}-{fluid}": f"{name_of(name)} in {fluid}" for name in study.config["pilots"] for fluid in fluids}
    return {
        "findings": {"fine": fine, "replays": along_x, "path_replays": along_path, "nearest": nearest},
        "papers": papers,
        "swimmers": study.swimmers(shown),
        "over_viscosity": _over_viscosity(fine, swimmers, papers),
        "points": summary(pd.concat([fine, papers]), {"method": [*swimmers, paper.NAME]} | swam, chosen),
        "missed": fine[fine["match"] != "solved"].to_dict("records"),
        "matrices": matrices(pd.concat([paper.replays(fluids), replayed, itself]), fluids),
        "home": _home(along_x, along_path, swimmers, fluids),
        "replays": summary(replayed, {"method": swimmers} | swam | {"gait_of": fluids}, [("n", size), *spent]),
        "tails": figures.tails(sinusoid, fluids),
        "amplitudes": _amplitudes(sinusoid, study.config["diameters"], fluids),
        "nearest": summary(nearest, ["definition"], [(name, table.first(name, ".3g")) for name in nearest.columns[1:]]),
        "engines": step_table(step_changes(points, own, _CHANGES), {"method": swimmers}),
        "steps": len(matrix)  # without rows if no swim had a rhythm to record
        and step_table(step_changes(matrix, replay, _CHANGES), {"method": swimmers}),
        **table.validity(pd.concat([fine, replayed])),
    }


def papers_policy(fluids: Sequence[str], mass: float) -> pd.DataFrame:
    """The paper's figures of its policy as swims of a robot of that mass [kg]; gaits are told at the ends only."""
    rows = [
        {"method": paper.NAME, "seed": 0, "fluid": fluid, "power": theirs.power(mass), **theirs._asdict()}
        | {name: dict(zip(paper.ENDS, paper.TREND[name], strict=True)).get(fluid) for name in _TOLD}
        for fluid, theirs in paper.POLICY.items()
        if fluid in fluids
    ]
    return pd.DataFrame(rows, columns=["method", "seed", "fluid", "power", *paper.Figures._fields, *_TOLD])


def along_the_path(replayed: pd.DataFrame, weight: float) -> pd.DataFrame:
    """Replays with speed and costs along their mean course instead of along x, as they may drift; weight in [N]."""
    speed = replayed["path_speed"].where(replayed["status"] == "ok")
    spent = replayed[list(POWERS)].where(replayed[list(POWERS)] >= 0)
    costs = {name: spent[power] / (weight * speed) for name, power in zip(COSTS, POWERS, strict=True)}
    return replayed.assign(speed=speed, **costs)


def nearest_tails(sinusoid: pd.DataFrame) -> pd.DataFrame:
    """By definition the diameter whose tail amplitudes come nearest to the paper's: by the largest relative `error`."""
    rows = []
    for name in AMPLITUDES:
        tails = sinusoid.pivot(index="diameter", columns="fluid", values=name).reindex(columns=list(paper.ENDS))
        errors = (tails / pd.Series(paper.SINUSOID_TAIL) - 1).abs().max(axis=1, skipna=False).dropna()
        if len(errors):
            best = errors.sort_values(kind="stable").index[0]
            rows.append({"definition": name, "diameter": best, **tails.loc[best], "error": errors.min()})
    return pd.DataFrame(rows, columns=["definition", "diameter", *paper.ENDS, "error"])


def _on_robots(swims: pd.DataFrame) -> pd.DataFrame:
    """Swims whose method names the robot as well."""
    robot = swims["diameter"].map("{:g} m".format) + swims["as_trained"].map({True: "", False: ", not retrained"})
    return swims.assign(policy=swims["method"], method=swims["method"].map(name_of) + ", " + robot)


def _over_viscosity(fine: pd.DataFrame, swimmers: list[str], papers: pd.DataFrame) -> str:
    """In the paper's fluids."""
    viscosities = {name: named_fluid(name).kinematic_viscosity for name in papers["fluid"]}
    fine = fine[fine["fluid"].isin(viscosities)]
    fine, papers = (swims.assign(viscosity=swims["fluid"].map(viscosities)) for swims in (fine, papers))
    figures_of = {name: papers[["viscosity", name]].dropna() for name in ("speed", "power", COSTS[0], *_TOLD)}
    trend = {name: (part["viscosity"].tolist(), part[name].tolist()) for name, part in figures_of.items()}
    return over_viscosity(fine, swimmers, trend=trend)


def _home(along_x: pd.DataFrame, along_path: pd.DataFrame, swimmers: list[str], fluids: list[str]) -> Table:
    """In how many seeds a fluid's own gait is the best replay in it, by each figure."""
    home = along_x.join(along_path[["speed_best", f"{COSTS[0]}_best"]].add_suffix("_path"))
    kinds = {"speed_best": "fastest", "speed_best_path": "fastest by path", f"{COSTS[0]}_best": "lowest CoT"}
    kinds |= {f"{COSTS[0]}_best_path": "lowest CoT by path", f"{COSTS[1]}_best": "lowest CoT+"}

    def seeds(column: str) -> Cell:
        return lambda part: f"{part[column].sum():.0f} of {part[column].count()}"

    columns = [(head, seeds(name)) for name, head in kinds.items()]
    return summary(home[home["home"]], {"method": swimmers, "fluid": fluids}, columns)


def _amplitudes(sinusoid: pd.DataFrame, diameters: list[float], fluids: list[str]) -> Table:
    """Tail amplitudes by each definition, at the diameters that policies swim with, and the paper's."""
    long = sinusoid.melt(["diameter", "fluid"], list(AMPLITUDES), "definition")
    wide = long.pivot(index=["diameter", "definition"], columns="fluid", values="value").reset_index()
    shown = wide[wide["diameter"].isin(diameters)].assign(robot=lambda rows: rows["diameter"].map("{:g} m".format))
    theirs = pd.DataFrame([{"robot": "paper's", "definition": "not stated", **paper.SINUSOID_TAIL}])
    columns: list[Column] = [(f"{fluid} [m]", table.first(fluid, ".3f")) for fluid in fluids]
    by = {"robot": [*shown["robot"].unique(), "paper's"], "definition": [*AMPLITUDES, "not stated"]}
    return summary(pd.concat([shown, theirs]), by, columns)
