"""Fronts of speed against power as studies published them, a page's own and those of the studies beside it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from snakebench.controllers import GAITS
from snakebench.errors import StoreError
from snakebench.robot import Robot
from snakebench.store import EXTENDED, INTEGRATED, PAPER, SIMPLE_SUM, SMALLER, read_manifest
from snakebench.tables import read_table, table_file
from snakebench.value import FloatArray

METHOD_NAMES = {  # what is called how, by search space or study
    "sea_snake": "sea snake",
    PAPER: "sinusoid",
    EXTENDED: "wider sinusoid",
    "fourier": "free waveform",
}
_FIXED = ("sea_snake_front", "pareto", "fourier")  # studies of fronts of fixed gaits
OVERALL = (INTEGRATED, SIMPLE_SUM)  # fronts over all fluids
_SPENT = ["speed", "power", "positive_power"]
_COLUMNS = ["method", "front", "seed", *_SPENT]
_POLICIES = ("symmetric", "teacher", "student")


def front_points(directory: Path) -> pd.DataFrame:
    """Every point of every front of a study, the simple-sum ones among them: columns space, front, speed and powers.

    The P+ of what version 1.0 wrote is not known.
    """
    parts = [read_table(directory / "fronts.csv")]
    if table_file(directory / "switching.csv").exists():
        parts.append(read_table(directory / "switching.csv").assign(front=SIMPLE_SUM))
    return pd.concat(parts, ignore_index=True).reindex(columns=["space", "front", *_SPENT])


class Standings(NamedTuple):
    """Fronts of fixed gaits and of policies with a dial."""

    points: pd.DataFrame  # columns method, front, seed, speed, power, positive_power
    worth: pd.DataFrame  # by method, front and seed: hypervolume, and hypervolume_searched in the other engine
    fixed: list[str]  # methods of fixed gaits: those of `METHOD_NAMES` in their order, then those of plug-ins


def standings(directory: Path, config: Mapping[str, Any]) -> Standings:
    """The fronts of a study of policies with a dial, and of the studies of fixed gaits beside it that count alike."""
    directories = list(counted_alike(directory, [*_FIXED, *_of_other_gaits(directory)], config))
    fixed = fixed_fronts(directories)
    points = [part for part in (fixed, by_seed(front_points(directory))[_COLUMNS]) if len(part)]
    worth = [by_seed(read_table(directory / "indicators.csv"))]
    for other in directories:
        table = read_table(other / "indicators.csv")
        worth.append(table.assign(method=table["space"].map(name_of), seed=0))
    by_front = pd.concat(worth, ignore_index=True).set_index(["method", "front", "seed"]).sort_index()
    methods = sorted(fixed["method"].unique(), key=[*METHOD_NAMES.values(), *fixed["method"]].index)
    columns = by_front[["hypervolume", "hypervolume_searched"]]
    return Standings(pd.concat(points, ignore_index=True), columns, methods)


def fixed_fronts(directories: Sequence[Path]) -> pd.DataFrame:
    """The fronts of fixed gaits in directories of results: columns as of `Standings.points`, seed 0."""
    parts = [
        (points := front_points(directory)).assign(method=points["space"].map(name_of), seed=0)[_COLUMNS]
        for directory in directories
    ]
    return pd.concat(parts, ignore_index=True) if parts else pd.DataFrame(columns=_COLUMNS)


def by_seed(table: pd.DataFrame) -> pd.DataFrame:
    """A table by `space`, "POLICY SEED", as one by method and seed."""
    split = table["space"].str.rsplit(" ", n=1, expand=True)
    return table.assign(method=split[0], seed=split[1].astype(int))


def name_of(method: str) -> str:
    """What a policy, or the fixed gaits of a search space, are called."""
    return METHOD_NAMES.get(method, method).replace("_", " ")


def beside(directory: Path, study: str) -> Path:
    """Where the results of another study of the same profile are, beside those in a directory."""
    return directory.parent / f"{study}{_suffix(directory)}"


def single_points(directory: Path, config: Mapping[str, Any]) -> pd.DataFrame:
    """Gaits and policies that are no front, as verified: columns as of fronts; none whose study is not there.

    Their studies are those beside a directory of results, of the same profile and robot.

    They are the best sea-snake gaits by return, and the policies of the paper's reward. A policy is one for all fluids
    and adapts to each: its means over them stand beside both fronts over all fluids.
    """
    parts = [pd.DataFrame(columns=_COLUMNS)]
    snakes, policies = (beside(directory, study) for study in ("sea_snake", "teacher_student"))
    alike = list(counted_alike(directory, ["sea_snake", "teacher_student"], config, ["robot"]))
    if snakes in alike:
        fine = _valid(read_table(snakes / "optima.csv")).assign(method="sea snake")
        own = fine[fine["objective"] == fine["fluid"]].assign(front=fine["fluid"])
        shared = fine[fine["objective"] == "mean"].groupby(["method", "seed"])[_SPENT].mean().reset_index()
        parts += [own, shared.assign(front=INTEGRATED)]
    if policies in alike:
        fine = _valid(read_table(policies / "evaluations.csv"))
        shown = fine[fine["policy"].isin(_POLICIES)].assign(method=fine["policy"], front=fine["fluid"])
        means = shown.groupby(["method", "seed"])[_SPENT].mean().reset_index()
        parts += [shown, *(means.assign(front=name) for name in OVERALL)]
    return pd.concat(parts, ignore_index=True)[_COLUMNS]


def counted_alike(
    directory: Path, names: Sequence[str], config: Mapping[str, Any], keys: Sequence[str] = ("reference", "robot")
) -> Iterator[Path]:
    """The studies beside a directory of results that are there, of the same robot and hypervolume reference."""
    for other in (beside(directory, name) for name in names):
        if (other / "manifest.json").exists():
            of_other = read_manifest(other)["config"]
            if all(_value(of_other, key) == _value(config, key) for key in keys):
                yield other


def _value(config: Mapping[str, Any], key: str) -> object:
    """A setting; what an older version did not yet say of a robot is as it was."""
    return Robot(**config[key]) if key == "robot" else config[key]


def _of_other_gaits(directory: Path) -> Iterator[str]:
    """The studies of fronts of other gaits, as of plug-ins, of the same profile as the results in a directory."""
    own, suffix = directory.parent, _suffix(directory)
    for path in sorted(file.parent for file in own.glob(f"*{suffix}/manifest.json")):
        with suppress(StoreError, LookupError, TypeError, AttributeError):  # damaged ones are for their own page
            gait = read_manifest(path)["config"].get("gait")
            if _suffix(path) == suffix and gait not in (None, *GAITS.own):
                yield path.name.removesuffix(suffix)


def _suffix(directory: Path) -> str:
    """What the name of a directory of results says of the profile, if it is one of the smaller ones."""
    return next((f"-{name}" for name in SMALLER if directory.name.endswith(f"-{name}")), "")


def fastest_within(points: pd.DataFrame, power: float, by: Sequence[str] = ()) -> pd.DataFrame:
    """The rows of the highest speed that need no more than a power, one of each group; none where there is none."""
    ranked = points[points["power"] <= power].sort_values("speed", ascending=False, kind="stable")
    return ranked.drop_duplicates(by) if by else ranked.head(1)


def speeds_within(points: pd.DataFrame, powers: FloatArray) -> FloatArray:
    """The highest speed of points that need no more than each power [m/s]; NaN where there is none."""
    ordered = points.sort_values("power")
    place = np.searchsorted(ordered["power"], powers, side="right")
    return np.concatenate([[np.nan], np.maximum.accumulate(ordered["speed"])])[place]


def _valid(table: pd.DataFrame) -> pd.DataFrame:
    return table[(table["variant"] == "finer step") & (table["status"] == "ok")]
