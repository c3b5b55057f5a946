"""The published results of a study: its manifest, its tables, checked against their columns, and its swims."""

from __future__ import annotations

from collections.abc import Mapping
from importlib import import_module
from pathlib import Path
from typing import Any, NamedTuple

import pandas as pd

from snakebench.errors import InvalidValue, StoreError
from snakebench.manifest import read_manifest
from snakebench.metrics import GRAVITY
from snakebench.names import SMALLER
from snakebench.report.animation import swimmer
from snakebench.robot import Robot
from snakebench.studies import METHODS
from snakebench.tables import Columns, read_tables
from snakebench.trajectory import Trajectory


class Published(NamedTuple):
    """The results of a study in a directory."""

    directory: Path
    manifest: dict[str, Any]
    tables: dict[str, pd.DataFrame]  # all that the study declares; without rows where it had none to write

    @property
    def config(self) -> dict[str, Any]:
        """The settings of the study."""
        return self.manifest["config"]

    @property
    def robot(self) -> Robot:
        """The robot of the study."""
        return Robot(**self.config["robot"])

    @property
    def weight(self) -> float:
        """The weight of its robot [N]."""
        return self.robot.total_mass * GRAVITY

    def swim(self, name: str) -> Trajectory | None:
        """A swim that is shown; None if there is none of that name."""
        path = self.directory / "trajectories" / f"{name}.npz"
        try:
            return Trajectory.load(path) if path.exists() else None
        except InvalidValue as error:
            raise StoreError(f"{path} is damaged: {error}: run the study again") from None

    def swimmers(self, labels: Mapping[str, str]) -> list[dict[str, Any]]:
        """Animations of those of the swims that there are, under their labels."""
        return [swimmer(label, swim) for name, label in labels.items() if (swim := self.swim(name))]

    def beside(self, study: str) -> Published | None:
        """The results of another study of the same profile, beside these; None if none can be used."""
        profile = self.config.get("profile")
        suffix = f"-{profile}" if profile in SMALLER else ""
        directory = self.directory.parent / f"{study}{suffix}"
        try:
            return published(directory)
        except StoreError:  # what is wrong with them is for their own page
            return None


def best_of_seeds(optima: pd.DataFrame) -> pd.DataFrame:
    """The rows of each objective's best seed, judged by `values_of_searches`."""
    best = values_of_searches(optima).groupby("objective", sort=False).idxmax()
    return optima[optima.set_index(["objective", "seed"]).index.isin(best)]


def values_of_searches(optima: pd.DataFrame) -> pd.Series:
    """The objective's value of every optimum, by objective and seed: the mean return over its fluids as searched."""
    searched = optima[optima["variant"] == "searched"]
    return searched.groupby(["objective", "seed"], sort=False)["return"].mean()


def published(directory: Path) -> Published:
    """The results of a study; they must be complete, of version 2.0 or newer and of a known method."""
    manifest = read_manifest(directory)
    config = manifest.get("config")
    method = config.get("method") if isinstance(config, dict) else None
    if method not in METHODS:
        raise StoreError(f"the manifest in {directory} is damaged: its method is {method}, not of {', '.join(METHODS)}")
    if "fluids" not in manifest:
        raise StoreError(f"the results in {directory} are of a version before 2.0: run its study again")
    return Published(directory, manifest, read_tables(directory, tables_of(method)))


def tables_of(method: str) -> dict[str, Columns]:
    """The tables that the studies of a method write, and their columns."""
    return import_module(f"{__package__}.{method}.columns").TABLES
