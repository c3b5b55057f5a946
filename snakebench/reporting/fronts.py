"""Fronts of speed against power as studies published them, a page's own and those of the studies beside it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from snakebench.store import read_manifest, read_table

METHODS = {  # what is called how, by search space or study
    "sea_snake": "sea snake",
    "paper": "sinusoid",
    "extended": "wider sinusoid",
    "fourier": "free waveform",
}
FIXED = ("sea_snake_front", "pareto", "fourier")  # studies of fronts of fixed gaits
OVERALL = ("integrated", "simple-sum")  # fronts over all fluids
_COLUMNS = ["method", "front", "seed", "speed", "power"]
_POLICIES = ("symmetric", "teacher", "student")


def front_points(directory: Path) -> pd.DataFrame:
    """Every point of every front of a study, the simple-sum ones among them: columns space, front, speed, power."""
    parts = [read_table(directory / "fronts.csv")]
    if (directory / "switching.csv").exists():
        parts.append(read_table(directory / "switching.csv").assign(front="simple-sum"))
    return pd.concat(parts, ignore_index=True)[["space", "front", "speed", "power"]]


def fixed_fronts(directories: Sequence[Path]) -> pd.DataFrame:
    """The fronts of fixed gaits in directories of results: columns method, front, seed (0), speed, power."""
    parts = [
        (points := front_points(directory)).assign(method=points["space"].map(named), seed=0)[_COLUMNS]
        for directory in directories
    ]
    return pd.concat(parts, ignore_index=True) if parts else pd.DataFrame(columns=_COLUMNS)


def learned_fronts(directory: Path) -> pd.DataFrame:
    """The fronts of policies with a dial, of every seed: columns method, front, seed, speed, power."""
    return by_seed(front_points(directory))[_COLUMNS]


def by_seed(table: pd.DataFrame) -> pd.DataFrame:
    """A table by `space`, "POLICY SEED", as one by method and seed."""
    split = table["space"].str.rsplit(" ", n=1, expand=True)
    return table.assign(method=split[0], seed=split[1].astype(int))


def named(space: str) -> str:
    """What the fixed gaits of a search space are called."""
    return METHODS.get(space, space)


def single_points(results: Path, suffix: str = "") -> pd.DataFrame:
    """Gaits and policies that are no front, as verified: columns as of fronts; none whose study is not there.

    They are the best sea-snake gaits by return, and the policies of the paper's reward. A policy is one for all fluids
    and adapts to each: its means over them stand beside both fronts over all fluids.
    """
    parts = [pd.DataFrame(columns=_COLUMNS)]
    snakes, policies = results / f"sea_snake{suffix}", results / f"teacher_student{suffix}"
    if (snakes / "optima.csv").exists():
        fine = _valid(read_table(snakes / "optima.csv")).assign(method="sea snake")
        own = fine[fine["objective"] == fine["fluid"]].assign(front=fine["fluid"])
        shared = fine[fine["objective"] == "mean"].groupby(["method", "seed"])[["speed", "power"]].mean().reset_index()
        parts += [own, shared.assign(front="integrated")]
    if (policies / "evaluations.csv").exists():
        fine = _valid(read_table(policies / "evaluations.csv"))
        shown = fine[fine["policy"].isin(_POLICIES)].assign(method=fine["policy"], front=fine["fluid"])
        means = shown.groupby(["method", "seed"])[["speed", "power"]].mean().reset_index()
        parts += [shown, *(means.assign(front=name) for name in OVERALL)]
    return pd.concat(parts, ignore_index=True)[_COLUMNS]


def counted_alike(results: Path, names: Sequence[str], config: Mapping[str, Any]) -> Iterator[Path]:
    """The directories of those studies of a name that are there, of the same robot and hypervolume reference."""
    for directory in (results / name for name in names):
        if (directory / "manifest.json").exists():
            beside = read_manifest(directory)["config"]
            if all(beside[key] == config[key] for key in ("reference", "robot")):
                yield directory


def speeds_at(front: pd.DataFrame, powers: np.ndarray) -> np.ndarray:
    """The highest speed on a front for at most each power [m/s]; 0 below its first point."""
    ordered = front.sort_values("power")
    place = np.searchsorted(ordered["power"], powers, side="right")
    return np.concatenate([[0.0], np.maximum.accumulate(ordered["speed"])])[place]


def _valid(table: pd.DataFrame) -> pd.DataFrame:
    return table[(table["variant"] == "finer step") & (table["status"] == "ok")]
