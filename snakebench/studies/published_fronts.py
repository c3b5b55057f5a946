"""Fronts of speed against power as studies published them: a page's own, and those of the studies beside it."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from contextlib import suppress
from typing import NamedTuple

import pandas as pd

from snakebench.controllers import GAITS
from snakebench.errors import StoreError
from snakebench.report.method_names import METHOD_NAMES, name_of
from snakebench.report.table import POWERS
from snakebench.robot import Robot
from snakebench.store import INTEGRATED, MANIFEST, SIMPLE_SUM, read_manifest
from snakebench.studies.published import Published, published

OVERALL = (INTEGRATED, SIMPLE_SUM)  # fronts over all fluids
_FIXED = ("sea_snake_front", "pareto", "fourier")  # studies of fronts of fixed gaits
_POLICIES = ("symmetric", "teacher", "student")
_FRONT = ["method", "front", "seed"]
_MEASURED = ["speed", *POWERS]


class Standings(NamedTuple):
    """Fronts of fixed gaits and of preference-conditioned policies."""

    points: pd.DataFrame  # columns method, front, seed, speed, power, positive_power
    worth: pd.DataFrame  # by method, front and seed: the columns of `indicators`
    fixed: list[str]  # methods of fixed gaits: those of `METHOD_NAMES` in their order, then those of plug-ins


def standings(study: Published) -> Standings:
    """The fronts of a study of preference-conditioned policies, and of the comparable studies of fixed gaits beside it.

    Those are studies of the same profile, robot and hypervolume reference.
    """
    fixed = [*comparable(study, _FIXED), *_of_other_gaits(study)]
    points = [fixed_fronts(fixed), by_seed(front_points(study))]
    indicators = [by_seed(study.tables["indicators"]), *(_one_seed(other.tables["indicators"]) for other in fixed)]
    names = points[0]["method"]
    return Standings(
        pd.concat([part[[*_FRONT, *_MEASURED]] for part in points if len(part)], ignore_index=True),
        pd.concat(indicators, ignore_index=True).set_index(_FRONT).sort_index(),
        sorted(names.unique(), key=[*METHOD_NAMES.values(), *names].index),
    )


def front_points(study: Published) -> pd.DataFrame:
    """Every point of every front of a study, the simple-sum ones among them, in the columns of `fronts`."""
    fronts, switching = study.tables["fronts"], study.tables["switching"]
    return pd.concat([fronts, switching.assign(front=SIMPLE_SUM)], ignore_index=True) if len(switching) else fronts


def fixed_fronts(studies: Iterable[Published]) -> pd.DataFrame:
    """The fronts of studies of fixed gaits: columns as of `Standings.points`, seed 0."""
    parts = [_one_seed(front_points(study))[[*_FRONT, *_MEASURED]] for study in studies]
    return pd.concat(parts, ignore_index=True) if parts else pd.DataFrame(columns=[*_FRONT, *_MEASURED])


def by_seed(table: pd.DataFrame) -> pd.DataFrame:
    """A table of fronts of policies with columns method and seed; older versions wrote "POLICY SEED" as `space`."""
    if "method" in table:
        return table
    split = table["space"].str.rsplit(" ", n=1, expand=True)
    return table.assign(method=split[0], seed=split[1].astype(int))


def _one_seed(table: pd.DataFrame) -> pd.DataFrame:
    """A table of fronts of fixed gaits with columns method, from their search space, and seed."""
    return table.assign(method=table["space"].map(name_of), seed=0)


def powers_compared(indicators: pd.DataFrame) -> dict[float, str]:
    """The powers at which indicators compare speeds [W], and the columns of the speeds."""
    columns = [str(name) for name in indicators if re.fullmatch(r"speed_at_[^_]+_W", str(name))]
    return {float(name.split("_")[2]): name for name in columns}


def single_points(study: Published) -> pd.DataFrame:
    """Gaits and policies that have no front, as verified: columns as of `Standings.points`; none without their study.

    They are the best sea-snake gaits by return, and the policies of the paper's reward, of studies of the same profile
    and robot beside this one. A policy is one for all fluids and adapts to each: its means over them stand beside both
    fronts over all fluids.
    """
    parts = [pd.DataFrame(columns=[*_FRONT, *_MEASURED])]
    for other in comparable(study, ["sea_snake"], reference=False):
        swims = _verified(other.tables["optima"]).assign(method=name_of("sea_snake"))
        own = swims[swims["objective"] == swims["fluid"]]
        parts += [own.assign(front=own["fluid"]), _means(swims[swims["objective"] == "mean"], INTEGRATED)]
    for other in comparable(study, ["teacher_student"], reference=False):
        swims = _verified(other.tables["evaluations"])
        swims = swims[swims["policy"].isin(_POLICIES)].rename(columns={"policy": "method"})
        parts += [swims.assign(front=swims["fluid"]), *(_means(swims, name) for name in OVERALL)]
    return pd.concat(parts, ignore_index=True)[[*_FRONT, *_MEASURED]]


def _verified(swims: pd.DataFrame) -> pd.DataFrame:
    return swims[(swims["variant"] == "finer step") & (swims["status"] == "ok")]


def _means(swims: pd.DataFrame, front: str) -> pd.DataFrame:
    return swims.groupby(["method", "seed"])[_MEASURED].mean().reset_index().assign(front=front)


def comparable(study: Published, names: Iterable[str], *, reference: bool = True) -> Iterator[Published]:
    """Those studies beside the results of a study that are there, of the same robot and hypervolume `reference`."""
    for other in filter(None, map(study.beside, names)):
        if _same_settings(other, study, reference):
            yield other


def _of_other_gaits(study: Published) -> Iterator[Published]:
    """The comparable studies of fronts of other gaits, as of plug-ins, beside the results of a study."""
    for path in sorted(study.directory.parent.glob(f"*/{MANIFEST}")):
        with suppress(StoreError):  # a damaged one is for its own page
            config = read_manifest(path.parent).get("config", {})
            if config.get("gait") in (None, *GAITS.own) or config.get("profile") != study.config["profile"]:
                continue
            other = published(path.parent)
            if _same_settings(other, study, reference=True):
                yield other


def _same_settings(one: Published, other: Published, reference: bool) -> bool:
    """Whether studies have the same robot, which older versions describe by fewer settings, and reference."""
    same_robot = Robot(**one.config["robot"]) == Robot(**other.config["robot"])
    return same_robot and (not reference or one.config["reference"] == other.config["reference"])
