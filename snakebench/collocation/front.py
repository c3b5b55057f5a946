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
from snakebench.manifest import MANIFEST, read_manifest
from snakebench.names import CURRENCIES
from snakebench.robot import Robot
from snakebench.tables import read_table, table_file
from snakebench.value import FloatArray

_INSTALLED = Path(__file__).with_name("limit.csv")
_TABLES = (_INSTALLED, Path(__file__).parents[2] / "results" / "limit" / "limit.csv")
_POINT = ["viscosity", "bounds", "currency", "allowed"]  # what identifies a point
_SAME = 1e-3  # relative difference of viscosities that count as equal
_NO_GAIN = 1e-3  # relative gain of speed over that of power, below which more power makes no gait faster
AGREE = 0.01  # difference of speed of starts that agree [1]
FINER = "finer mesh"  # the kind of start of a refinement of the mesh
SHARPER = "less smoothing"  # and of one of the smoothing
REFINED = (FINER, SHARPER)
_DENSITY = 0.01  # relative difference of density within which the table holds


class Limit(NamedTuple):
    """The limit at a power; its error is that of interpolation, mesh and replay together."""

    speed: float  # [m/s]
    error: float  # bound on the error of the speed, as far as it is known [m/s]
    points: int  # of the table that it is interpolated between


def limit(fluid: Fluid | str, power: float, *, currency: str = "net", bounds: str = "policies") -> Limit:
    """The highest speed known for the paper's robot at a mean power, from the study `limit`.

    It is the best of many local optima, so a lower bound of the true limit. Between points it is a monotone cubic in
    log10 of power, and in log10 of viscosity. Where more power makes no gait faster, it stays. The error is the largest
    difference of the neighbouring points between meshes and between optimum and replays, plus what linear interpolation
    would change. Held targets keep their knots, which their replays have too.

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
    points = {float(str(viscosity)): part for viscosity, part in rows.groupby("viscosity")}
    return _between(points, medium.kinematic_viscosity, power, currency)


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


def front_speeds(points: pd.DataFrame, powers: FloatArray, currency: str, *, beyond: bool = False) -> FloatArray:
    """The limit of one fluid from its points, at powers [W]: speeds [m/s], NaN outside their range.

    A point that is slower than one of less power is left out. Where more power makes no gait within the bounds faster,
    the speed stays `beyond` the range; gaits outside the bounds, as those of torques, may be faster there.
    """
    ends = points[CURRENCIES[currency]].agg(["min", "max"]).to_numpy()
    points = risen(points, currency)
    known, speeds = points[CURRENCIES[currency]].to_numpy(), points["speed"].to_numpy()
    speeds = interpolated(np.log10(known), speeds, np.log10(powers))
    most = max(ends[1], _most(points, currency)) if beyond else ends[1]
    near = np.isclose(powers[:, None], ends, rtol=0.01).any(axis=1)
    return np.where((ends[0] <= powers) & (powers <= most) | near, speeds, np.nan)


def front_limit(points: pd.DataFrame, power: float, currency: str) -> Limit | None:
    """The limit of one fluid from its points; None outside their range of power."""
    if np.isnan(front_speeds(points, np.array([power]), currency, beyond=True)).all():
        return None
    points = risen(points, currency)
    powers = points[CURRENCIES[currency]].to_numpy()
    speed, change = with_doubt(np.log10(powers), points["speed"].to_numpy(), np.log10(power))
    place = np.clip(np.searchsorted(powers, power), 1, max(len(powers) - 1, 1))
    near = points.iloc[place - 1 : place + 1]
    doubt = np.nanmax(near[["change", "gap", "planar_gap"]].abs().to_numpy(float), initial=0.0)
    return Limit(speed, change + speed * float(doubt), len(near))


def risen(points: pd.DataFrame, currency: str) -> pd.DataFrame:
    """Points by their power, without those that are no faster than one of less power."""
    points = points.sort_values(CURRENCIES[currency])
    return points[points["speed"] > points["speed"].cummax().shift(fill_value=-np.inf)]


def _most(points: pd.DataFrame, currency: str) -> float:
    """The largest power at which the limit is known: any, if the fastest point gains nothing by more of it."""
    fastest = points.iloc[-1]
    power = float(fastest[CURRENCIES[currency]])
    return np.inf if fastest["multiplier"] * power < _NO_GAIN * fastest["speed"] else power


def _between(points: Mapping[float, pd.DataFrame], viscosity: float, power: float, currency: str) -> Limit:
    """The limit at a viscosity between those of the points, at a power."""
    at = np.array(list(points))
    if not at[0] * (1 - _SAME) <= viscosity <= at[-1] * (1 + _SAME):
        known = f"from {at[0]:.3g} to {at[-1]:.3g} m^2/s"
        raise InvalidValue(f"viscosity = {viscosity:g} m^2/s: the limit is known {known}: solve it anew")
    limits = {one: front_limit(part, power, currency) for one, part in points.items()}
    near = at[beside(np.log10(at), np.log10(viscosity))].tolist()
    if any(limits[one] is None for one in near):
        parts = [risen(points[one], currency) for one in near]
        least, most = (
            max(float(part[CURRENCIES[currency]].iloc[0]) for part in parts),
            min(_most(part, currency) for part in parts),
        )
        known = f"from {least:.3g}" + (f" to {most:.3g} W" if np.isfinite(most) else " W on")
        raise InvalidValue(f"power = {power:g} W: in this fluid the limit is known {known}: solve it anew")
    fronts = {one: found for one, found in limits.items() if found}
    speed, change = with_doubt(
        np.log10(list(fronts)), np.array([one.speed for one in fronts.values()]), np.log10(viscosity)
    )
    used = [fronts[one] for one in near]
    return Limit(speed, change + max(one.error for one in used), sum(one.points for one in used))


def beside(places: FloatArray, at: float) -> list[int]:
    """Which of increasing places lie next to one: the one before and the one after, or the one that is the same."""
    same = np.flatnonzero(np.abs(places - at) <= np.log10(1 + _SAME))
    after = int(np.searchsorted(places, at))
    return [int(same[0])] if len(same) else [after - 1, after]


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
    manifest = path.with_name(MANIFEST)
    if manifest.exists() and Robot(**read_manifest(path.parent)["config"]["robot"]) != Robot():
        raise InvalidValue(f"{path.parent} is of another robot than the paper's: snakebench limit solves for it")
    return read_table(path)
