"""Gaits of the page: of each kind and fluid those that are best at some price of power, and the limit of the body."""

from collections.abc import Callable, Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from snakebench.collocation.front import beside, front_speeds, interpolated, limit_gait, of_first_bounds
from snakebench.controllers import Gait, SeaSnake, SinusoidalTorque
from snakebench.fluid import FLUIDS
from snakebench.manifest import read_manifest
from snakebench.names import PAPER
from snakebench.reward import PUBLISHED_PRICE, WEIGHTS, preferred
from snakebench.robot import Robot
from snakebench.tables import parametric_gait, read_table
from snakebench.value import FloatArray

# Label, class, study and search space of the gaits that have fronts.
_FRONTS: tuple[tuple[str, type[SinusoidalTorque | SeaSnake], str, str], ...] = (
    ("sinusoid", SinusoidalTorque, "pareto", PAPER),
    ("sea snake", SeaSnake, "sea_snake_front", "sea_snake"),
)
_Front = tuple[str, float, pd.DataFrame, Callable[[pd.Series], Gait]]  # fluid, viscosity, points, the gait of a point


def families(results: Path, prices: FloatArray) -> Iterator[dict[str, Any]]:
    """Each kind of gait that there are results of, with the best gaits of each fluid at prices of power [1/W]."""
    kinds = [("limit's gait", "angle", list(_of_the_limit(results)))]
    for label, kind, study, space in _FRONTS:
        kinds.append((label, kind.drives, list(_of_front(results / study / "fronts", space, kind))))
    for label, drives, fronts in kinds:
        if fronts:
            yield {"label": label, "drives": drives, "media": [_medium(front, prices) for front in fronts]}


def of_usual_robot(study: Path) -> bool:
    """Whether a published study is of the robot that swims in the page."""
    return Robot(**read_manifest(study)["config"]["robot"]) == Robot()


def limit_speeds(results: Path, viscosities: FloatArray, powers: FloatArray) -> FloatArray:
    """The limit as `sb.limit` gives it, shape (viscosities, powers) [m/s]; NaN where it is not known."""
    fronts, speeds = _limit_fronts(results), np.full((len(viscosities), len(powers)), np.nan)
    known = np.array([front_speeds(one, powers, "net") for one in fronts.values()])
    at = np.log10(list(fronts))
    for row, viscosity in enumerate(np.log10(viscosities) if fronts else ()):
        if at[0] - 1e-9 <= viscosity <= at[-1] + 1e-9:
            for column in np.flatnonzero(np.isfinite(known[beside(at, viscosity)]).all(axis=0)):
                there = np.isfinite(known[:, column])
                speeds[row, column] = interpolated(at[there], known[there, column], np.array([viscosity]))[0]
    return speeds


def _limit_fronts(results: Path) -> dict[float, pd.DataFrame]:
    """The published limit in P by viscosity [m^2/s]; nothing if there is none."""
    rows = _limit_table(results, "limit")
    by_viscosity = {} if rows is None else dict(iter(rows.groupby("viscosity")))
    return {float(str(viscosity)): points.sort_values("power") for viscosity, points in by_viscosity.items()}


def _limit_table(results: Path, name: str) -> pd.DataFrame | None:
    """The rows of a table of the limit in P, under the study's first bounds."""
    found = results / "limit"
    if not found.is_dir() or not of_usual_robot(found):
        return None
    rows = of_first_bounds(read_table(found / f"{name}.csv"), read_manifest(found)["config"])
    return rows[rows["currency"] == "net"]


def _of_the_limit(results: Path) -> Iterator[_Front]:
    if (gaits := _limit_table(results, "gaits")) is None:
        return
    knots = dict(iter(gaits.groupby(["viscosity", "allowed"])))
    for viscosity, points in _limit_fronts(results).items():
        fluid = points["fluid"].iloc[0]
        name = fluid if isinstance(fluid, str) else f"{viscosity * 1e6:.3g} mm²/s"
        published = points[[(viscosity, allowed) in knots for allowed in points["allowed"]]]
        yield name, viscosity, published, lambda row: limit_gait(knots[row["viscosity"], row["allowed"]])


def _of_front(table: Path, space: str, kind: type[Gait]) -> Iterator[_Front]:
    if not table.parent.is_dir() or not of_usual_robot(table.parent):
        return
    fronts = read_table(table.with_suffix(".csv"))
    rows = fronts[fronts["space"] == space]
    rows = rows[rows["currency"] == "net"]
    for name, points in rows.groupby("front", sort=False):
        if name in FLUIDS:
            yield str(name), FLUIDS[str(name)].kinematic_viscosity, points, partial(parametric_gait, kind)


def _medium(front: _Front, prices: FloatArray) -> dict[str, Any]:
    """The gaits of a front that are best at some price, and which of them it is at each."""
    name, viscosity, points, gait = front
    speed, power = points["speed"].to_numpy(), points["power"].to_numpy()
    published = WEIGHTS.propulsion * speed - PUBLISHED_PRICE * power
    best = [int(np.argmax(preferred(published, speed, power, np.full(len(speed), price)))) for price in prices]
    used = sorted(set(best))
    gaits: Sequence[dict[str, Any]] = [
        {"gait": gait(points.iloc[k]).model_dump(mode="json"), "speed": float(speed[k]), "power": float(power[k])}
        for k in used
    ]
    return {"name": name, "viscosity": viscosity, "gaits": gaits, "best": [used.index(k) for k in best]}
