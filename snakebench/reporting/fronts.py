"""Fronts of speed against power as studies published them, a page's own and those of the studies beside it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from snakebench.store import read_manifest, read_table


def front_points(directory: Path) -> pd.DataFrame:
    """Every point of every front of a study, the simple-sum ones among them: columns space, front, speed, power."""
    parts = [read_table(directory / "fronts.csv")]
    if (directory / "switching.csv").exists():
        parts.append(read_table(directory / "switching.csv").assign(front="simple-sum"))
    return pd.concat(parts, ignore_index=True)[["space", "front", "speed", "power"]]


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
