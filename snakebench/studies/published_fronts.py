"""Fronts of speed against power as studies published them: a page's own, and those of the studies beside it."""

import re
from collections.abc import Iterable, Iterator
from contextlib import suppress

import numpy as np
import pandas as pd

from snakebench.collocation.front import front_speeds, under_first_bounds
from snakebench.controllers import GAITS
from snakebench.errors import StoreError
from snakebench.manifest import MANIFEST, read_manifest
from snakebench.names import CURRENCIES, FASTER, INTEGRATED, SIMPLE_SUM, STRONGER
from snakebench.report.table import name_of, of_valid
from snakebench.studies.indicators import MEASURED
from snakebench.studies.published import Published, published
from snakebench.studies.seed_fronts import of_each_seed

OVERALL = (INTEGRATED, SIMPLE_SUM)  # fronts over all fluids
_ONLY_LEDGER = tuple(map(name_of, (FASTER, STRONGER)))  # searched to tell apart what the wider range adds
_FIXED = ("sea_snake_front", "pareto", "fourier")  # studies of fronts of fixed gaits
_POLICIES = ("symmetric", "teacher", "student")
_VERIFIED = "variant == 'finer step'"
_MARK = ["method", "front", "seed", *MEASURED]
_POINT = [*_MARK, "currency"]
_SAMPLES = 100  # of the limit, which is interpolated


def standings(study: Published) -> tuple[pd.DataFrame, pd.DataFrame, list[str]]:
    """The fronts of a study of preference-conditioned policies, and of the comparable studies of fixed gaits beside it.

    Their points; their indicators, with method and seed, in the order to be shown; the methods of fixed gaits. Of free
    waveforms they are those of each seed of the search.
    """
    fixed = [*map(of_each_seed, comparable(study, _FIXED)), *_of_other_gaits(study)]
    points = points_of([*fixed, study])
    worth = pd.concat([_by_method(one.tables["indicators"]) for one in (*fixed, study)], ignore_index=True)
    names = [*study.config["fluids"], *OVERALL]
    points, worth = (part[~part["method"].isin(_ONLY_LEDGER)] for part in (points, worth))
    points, worth = (pd.concat([part[part["front"] == name] for name in names]) for part in (points, worth))
    return points, worth, [name for name in points_of(fixed)["method"].unique() if name not in _ONLY_LEDGER]


def points_of(studies: Iterable[Published]) -> pd.DataFrame:
    """Every point of the fronts of studies: columns method, front, seed, currency, speed and both powers."""
    parts = [pd.DataFrame(columns=_POINT)]
    for study in studies:
        tables = study.tables
        points = [table for table in (tables["fronts"], tables["switching"].assign(front=SIMPLE_SUM)) if len(table)]
        if points:
            parts.append(_by_method(pd.concat(points, ignore_index=True))[_POINT])
    return pd.concat(parts[1:] or parts, ignore_index=True)


def _by_method(table: pd.DataFrame) -> pd.DataFrame:
    """A table of fronts with the columns method and seed; the method of fixed gaits is their search space."""
    return table if "method" in table else table.assign(method=table["space"].map(name_of), seed=0)


def powers_compared(indicators: pd.DataFrame) -> dict[float, str]:
    """The powers at which indicators compare speeds [W], and the columns of the speeds."""
    columns = [str(name) for name in indicators if re.fullmatch(r"speed_at_[^_]+_W", str(name))]
    return {float(name.split("_")[2]): name for name in columns}


def single_points(study: Published) -> pd.DataFrame:
    """Points without a front, of comparable studies: the best sea snakes by return, policies of the paper's reward.

    A policy is one for all fluids and adapts to each: its means over them stand beside both fronts over all fluids.
    """
    return points_without_fronts(comparable(study, ["sea_snake", "teacher_student"]))


def points_without_fronts(studies: Iterable[Published]) -> pd.DataFrame:
    """The same of given studies, of sea snakes or of policies."""
    parts = [pd.DataFrame(columns=_MARK)]
    for study in studies:
        if "optima" in study.tables:
            swims = of_valid(study.tables["optima"].query(_VERIFIED)).assign(method=name_of("sea_snake"))
            own = swims[swims["objective"] == swims["fluid"]]
            parts += [own.assign(front=own["fluid"]), _means(swims[swims["objective"] == "mean"], INTEGRATED)]
        else:
            swims = of_valid(study.tables["evaluations"].query(_VERIFIED)).rename(columns={"policy": "method"})
            swims = swims[swims["method"].isin(_POLICIES)]
            parts += [swims.assign(front=swims["fluid"]), *(_means(swims, name) for name in OVERALL)]
    return pd.concat(parts, ignore_index=True)[_MARK].dropna(subset="speed")


def limit_beside(study: Published) -> Published | None:
    """The study of the limit of the body beside a study, if it is there and comparable."""
    return next(comparable(study, ["limit"]), None)


def with_limit(points: pd.DataFrame, study: Published) -> pd.DataFrame:
    """Points of fronts, and those of the limit of the body in the named fluids, if a comparable study is beside."""
    parts = [points]
    if limit := limit_beside(study):
        rows = under_first_bounds(limit.tables["limit"], limit.config)
        for (fluid, currency), part in rows.groupby(["fluid", "currency"], sort=False):
            column = CURRENCIES[str(currency)]
            powers = np.geomspace(part[column].min(), part[column].max(), _SAMPLES)
            speeds = {"speed": front_speeds(part, powers, str(currency)), column: powers}
            labels = {"method": "limit", "front": fluid, "seed": 0, "currency": currency}
            parts.append(pd.DataFrame(speeds | labels).dropna().reindex(columns=_POINT))
    return pd.concat(parts, ignore_index=True)


def _means(swims: pd.DataFrame, front: str) -> pd.DataFrame:
    return swims.groupby(["method", "seed"])[MEASURED].mean(skipna=False).reset_index().assign(front=front)


def comparable(study: Published, names: Iterable[str]) -> Iterator[Published]:
    """Those studies beside a study that are there and comparable: of the same robot and hypervolume reference."""
    return (other for other in filter(None, map(study.beside, names)) if same_settings(other, study))


def _of_other_gaits(study: Published) -> Iterator[Published]:
    """The comparable studies of fronts of other gaits, as of plug-ins, beside the results of a study."""
    for path in sorted(study.directory.parent.glob(f"*/{MANIFEST}")):
        with suppress(StoreError):  # a damaged one is for its own page
            config = read_manifest(path.parent).get("config", {})
            if config.get("gait") in (None, *GAITS.own) or config.get("profile") != study.config["profile"]:
                continue
            other = published(path.parent)
            if same_settings(other, study):
                yield other


def same_settings(one: Published, other: Published) -> bool:
    """Whether studies have the same robot, which older versions describe by fewer settings, and reference, if any."""
    same_robot = one.robot == other.robot
    references = {tuple(study.config["reference"]) for study in (one, other) if "indicators" in study.tables}
    return same_robot and len(references) <= 1
