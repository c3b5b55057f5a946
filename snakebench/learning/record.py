"""What a training leaves in its folder: the log, TensorBoard's events, the last checkpoint, and at the end the policy.

A checkpoint is written with every row of the log, so that a training that was killed goes on from the last row and
ends with the same bytes as one that was not.
"""

from __future__ import annotations

import hashlib
import io
import json
import shutil
import zipfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import torch
from numpy.typing import NDArray
from torch.utils.tensorboard import SummaryWriter

from snakebench.errors import InvalidValue, SnakebenchError
from snakebench.evaluation import evaluate
from snakebench.files import writable_directory, write_file
from snakebench.fluid import PAPERS
from snakebench.learning.settings import Swimming
from snakebench.learning.vector import physics_rate
from snakebench.policy import Policy

_SEALED, _SEAL = ("policy.safetensors", "log.csv"), "seal.json"
Row = dict[str, float | int | None]


class LearningFailed(SnakebenchError):
    """A training whose numbers are no longer finite; its last good checkpoint is kept."""


class Folder:
    """The folder of one training.

    Raises:
        StoreError: when it cannot be written.
    """

    def __init__(self, path: Path) -> None:
        self.path = writable_directory(path)

    @property
    def policy(self) -> Path:
        """Where the finished policy is."""
        return self.path / "policy.safetensors"

    def checkpoint(self) -> dict[str, Any] | None:
        """The last checkpoint that can be read; None before the first. Nothing in it is executed."""
        try:
            content = io.BytesIO((self.path / "checkpoint.pt").read_bytes())
            with zipfile.ZipFile(content) as archive:
                if archive.testzip() is not None:  # PyTorch does not compare the checksums
                    return None
            content.seek(0)
            return dict(torch.load(content, weights_only=True))
        except Exception:  # of a damaged file PyTorch may raise anything
            return None

    def keep(self, row: Row, state: Mapping[str, Any], rows: list[Row]) -> None:
        """Keep a row of the log with the state after it; the checkpoint holds the whole log, so the two agree."""
        content = io.BytesIO()
        torch.save({"rows": [*rows, row], **state}, content)
        write_file(self.path / "checkpoint.pt", content.getvalue())
        rows.append(row)
        self._write_log(rows)
        events = self.path / "tensorboard"
        if len(rows) == 1:  # TensorBoard's own way to take a curve back loses rows that were written in one second
            shutil.rmtree(events, ignore_errors=True)
        with SummaryWriter(str(events)) as writer:
            for name, number in row.items():
                if number is not None:
                    writer.add_scalar(name, number, int(row["steps"] or 0))

    def seal(self) -> None:
        """Remember what the finished policy and its log are, so that damage is found out later."""
        write_file(self.path / _SEAL, json.dumps(self._digests(), indent=2) + "\n")

    def set_damaged_aside(self) -> bool:
        """Set the finished policy and its log aside if either is damaged; training goes on from the checkpoint then.

        Returns:
            Whether they were.
        """
        if not self.policy.exists() or self._intact():
            return False
        for name in _SEALED:
            if (path := self.path / name).exists():
                path.replace(path.with_name(f"{name}.damaged"))
        if (checkpoint := self.checkpoint()) is not None:
            self._write_log(checkpoint["rows"])
        return True

    def _intact(self) -> bool:
        try:
            Policy.load(self.policy)
            return bool(json.loads((self.path / _SEAL).read_text(encoding="utf-8")) == self._digests())
        except FileNotFoundError:  # nothing was sealed
            return True
        except (InvalidValue, OSError, ValueError):
            return False

    def _digests(self) -> dict[str, str | None]:
        paths = {name: self.path / name for name in _SEALED}
        return {
            name: hashlib.sha256(path.read_bytes()).hexdigest() if path.exists() else None
            for name, path in paths.items()
        }

    def _write_log(self, rows: list[Row]) -> None:
        write_file(self.path / "log.csv", pd.DataFrame(rows).to_csv(index=False, lineterminator="\n"))

    def fail(self, reason: str, batch: Mapping[str, NDArray[Any]]) -> LearningFailed:
        """The error of a training whose numbers are not finite; keeps the statistics of its last batch."""
        statistics = {name: _statistics(array) for name, array in batch.items()}
        write_file(self.path / "failure.json", json.dumps({"reason": reason, "batch": statistics}, indent=2) + "\n")
        return LearningFailed(f"{reason}: the last good checkpoint and failure.json are kept in {self.path}")


def judged(policy: Policy, swimming: Swimming) -> Row:
    """Speed [m/s] and return of a policy in each fluid of the paper, in planar."""
    row: Row = {}
    for fluid in PAPERS:
        run = evaluate(
            policy,
            fluid=fluid,
            robot=swimming.robot,
            engine="planar",
            physics_rate=physics_rate(swimming.control_rate),
            control_rate=swimming.control_rate,
            duration=swimming.duration,
        )
        row |= {f"speed_{fluid}": run.speed, f"return_{fluid}": run.episode_return}
    return row


def finished(episodes: list[dict[str, float]]) -> Row:
    """Number, mean return and its standard deviation of the whole episodes that ended since the last row."""
    returns = [episode["r"] for episode in episodes if episode["whole"]]
    return {
        "episodes": len(returns),
        "return_mean": float(np.mean(returns)) if returns else None,
        "return_std": float(np.std(returns, ddof=1)) if len(returns) > 1 else None,
    }


def as_tensors(arrays: Mapping[str, NDArray[Any]]) -> dict[str, torch.Tensor]:
    """Arrays as a checkpoint keeps them."""
    return {name: torch.from_numpy(np.array(array)) for name, array in arrays.items()}


def as_arrays(tensors: Mapping[str, torch.Tensor]) -> dict[str, NDArray[Any]]:
    """What `as_tensors` made of them."""
    return {name: tensor.numpy() for name, tensor in tensors.items()}


def random_streams() -> dict[str, Any]:
    """The state of the global random streams that Stable-Baselines3 and PyTorch draw from."""
    name, keys, *rest = np.random.get_state(legacy=True)
    return {"torch": torch.get_rng_state(), "numpy": [name, torch.from_numpy(np.array(keys, np.int64)), *rest]}


def set_random_streams(streams: Mapping[str, Any]) -> None:
    """Go on drawing as after `random_streams`."""
    torch.set_rng_state(streams["torch"])
    name, keys, *rest = streams["numpy"]
    np.random.set_state((name, keys.numpy().astype(np.uint32), *rest))


def _statistics(array: NDArray[Any]) -> dict[str, float | int | None]:
    finite = array[np.isfinite(array)]
    about: dict[str, float | int | None] = {"numbers": int(array.size), "not finite": int(array.size - finite.size)}
    if finite.size:
        about |= {"least": float(finite.min()), "mean": float(finite.mean()), "most": float(finite.max())}
    return about
