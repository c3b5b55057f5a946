"""The published limit: the highest speed at a power, interpolated between the points of the study."""

from collections.abc import Mapping
from functools import lru_cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from scipy.interpolate import PchipInterpolator

from snakebench.controllers import PeriodicTargets
from snakebench.errors import InvalidValue, UnknownName
from snakebench.fluid import Fluid, density_at, named_fluid
from snakebench.names import CURRENCIES
from snakebench.tables import read_table, table_file
from snakebench.value import FloatArray

_INSTALLED = Path(__file__).with_name("limit.csv")
_TABLES = (_INSTALLED, Path(__file__).parents[2] / "results" / "limit" / "limit.csv")
_POINT = ["viscosity", "bounds", "currency", "allowed"]  # what identifies a point
_SAME = 1e-3  # relative difference of viscosities that count as equal
_DENSITY = 0.01  # relative difference of density within which the table holds


class Limit(NamedTuple):
    """The limit at a power; its error is that of interpolation, mesh and replay together."""

    speed: float  # [m/s]
    error: float  # bound on the error of the speed, as far as it is known [m/s]
    points: int  # of the table that it is interpolated between


def limit(fluid: Fluid | str, power: float, *, currency: str = "net", bounds: str = "policies") -> Limit:
    """The highest speed known for the paper's robot at a mean power, from the study `limit`.

    It is the best of many local optima, so a lower bound of the true limit. Between points it is a monotone cubic in
    log10 of power, and in log10 of viscosity. The error is the largest difference of the neighbouring points between
    meshes and between optimum and replay, plus what linear interpolation would change.

    Args:
        fluid: a fluid, its name, or VISCOSITY,DENSITY as "1e-3,900".
        power: mean power in the currency [W].
        currency: "net", P, or "positive", P+.
        bounds: of target angles and joints' speed, as the study names them: "policies" is ±1 rad.

    Raises:
        InvalidValue: outside the table's range of power, viscosity or density, with that range.

    Example:
        >>> sb.limit("water", 5.0).speed > sb.limit("oil2", 5.0).speed
        True
    """
    medium = named_fluid(fluid) if isinstance(fluid, str) else fluid
    table = _published()
    for what, name, column in (("currency", currency, "currency"), ("bounds", bounds, "bounds")):
        if name not in set(table[column]):
            raise UnknownName.among(what, name, sorted(set(table[column])))
    rows = table[(table["currency"] == currency) & (table["bounds"] == bounds)]
    expected = density_at(medium.kinematic_viscosity)
    if abs(medium.density / expected - 1) > _DENSITY:
        raise InvalidValue(
            f"density = {medium.density:g} kg/m^3: the limit is known for {expected:g} at this viscosity"
        )
    fronts = {
        float(str(viscosity)): one
        for viscosity, part in rows.groupby("viscosity")
        if (one := front_limit(part, power, currency))
    }
    if not fronts:
        known = rows[CURRENCIES[currency]]
        span = f"from {known.min():.3g} to {known.max():.3g} W"
        raise InvalidValue(f"power = {power:g} W: the limit is known {span}: solve it anew")
    return _between(fronts, medium.kinematic_viscosity, f"{power:g} W")


def of_first_bounds(table: pd.DataFrame, config: Mapping[str, Any]) -> pd.DataFrame:
    """The rows of a table of the study under the first bounds of its settings."""
    return table[table["bounds"] == next(iter(config["bounds"]))]


def under_first_bounds(table: pd.DataFrame, config: Mapping[str, Any]) -> pd.DataFrame:
    """The rows of a table of the study in the named fluids, under the first bounds of its settings."""
    rows = of_first_bounds(table, config)
    return rows[rows["fluid"].notna()]


def of_held_targets(table: pd.DataFrame, config: Mapping[str, Any]) -> pd.DataFrame:
    """The rows of a table of the study under the bounds of its settings that hold targets for a control step."""
    return table[table["bounds"].isin([name for name, bounds in config["bounds"].items() if bounds.get("held")])]


def gait_at(gaits: pd.DataFrame, point: pd.Series) -> PeriodicTargets:
    """The gait of a row of the table `limit` from the table `gaits`."""
    return limit_gait(gaits[(gaits[_POINT] == point[_POINT]).all(axis=1)])


def limit_gait(rows: pd.DataFrame) -> PeriodicTargets:
    """The gait of one point from the rows of the study's table `gaits`."""
    ordered = rows.sort_values("knot")
    joints = [name for name in rows if str(name).startswith("joint_")]
    return PeriodicTargets(
        period=float(ordered["period"].iloc[0]), targets=tuple(map(tuple, ordered[joints].to_numpy().tolist()))
    )


def front_speeds(points: pd.DataFrame, powers: FloatArray, currency: str) -> FloatArray:
    """The limit of one fluid from its points, at powers [W]: speeds [m/s], NaN outside their range."""
    points = points.sort_values(CURRENCIES[currency])
    known = points[CURRENCIES[currency]].to_numpy()
    ends = np.isclose(powers[:, None], known[[0, -1]], rtol=0.01).any(axis=1)
    speeds = interpolated(np.log10(known), points["speed"].to_numpy(), np.log10(powers))
    return np.where((known[0] <= powers) & (powers <= known[-1]) | ends, speeds, np.nan)


def front_limit(points: pd.DataFrame, power: float, currency: str) -> Limit | None:
    """The limit of one fluid from its points; None outside their range of power."""
    if np.isnan(front_speeds(points, np.array([power]), currency)).all():
        return None
    points = points.sort_values(CURRENCIES[currency])
    powers = points[CURRENCIES[currency]].to_numpy()
    speed, change = with_doubt(np.log10(powers), points["speed"].to_numpy(), np.log10(power))
    place = np.clip(np.searchsorted(powers, power), 1, max(len(powers) - 1, 1))
    near = points.iloc[place - 1 : place + 1]
    doubt = np.nanmax(near[["change", "gap"]].abs().to_numpy(float), initial=0.0)
    return Limit(speed, change + speed * float(doubt), len(near))


def _between(fronts: Mapping[float, Limit], viscosity: float, label: str) -> Limit:
    """The limit at a viscosity between those of others at the same power."""
    at = np.array(list(fronts))
    if not at[0] * (1 - _SAME) <= viscosity <= at[-1] * (1 + _SAME):
        known = f"from {at[0]:.3g} to {at[-1]:.3g} m^2/s"
        raise InvalidValue(f"viscosity = {viscosity:g} m^2/s at {label}: the limit is known {known}: solve it anew")
    speeds = np.array([one.speed for one in fronts.values()])
    speed, change = with_doubt(np.log10(at), speeds, np.log10(viscosity))
    place = int(np.searchsorted(at, viscosity * (1 - _SAME)))
    here = np.isclose(at[place], viscosity, rtol=_SAME, atol=0)
    near = list(fronts.values())[place if here else place - 1 : place + 1]
    return Limit(speed, change + max(one.error for one in near), sum(one.points for one in near))


def interpolated(x: FloatArray, y: FloatArray, at: FloatArray) -> FloatArray:
    """What interpolates the limit: a monotone cubic through rows `y` at increasing `x`; constant outside."""
    at = np.clip(at, x[0], x[-1])
    return np.asarray(PchipInterpolator(x, y)(at)) if len(x) > 1 else np.repeat(y, np.size(at), axis=0)


def with_doubt(x: FloatArray, y: FloatArray, at: float) -> tuple[float, float]:
    """The interpolated value at a place, and how far it is from a line."""
    value = float(interpolated(x, y, np.array([at]))[0])
    return value, abs(value - float(np.interp(at, x, y)))


@lru_cache
def _published() -> pd.DataFrame:
    path = next((path for path in _TABLES if table_file(path).exists()), None)
    if path is None:
        raise InvalidValue("no limit is published here: snakebench run-study limit makes it")
    return read_table(path)
