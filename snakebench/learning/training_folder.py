"""The folder of a training: the log, TensorBoard's events, the last checkpoint, which holds the log, and the policy."""

from __future__ import annotations

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
from snakebench.files import writable_directory, write_file
from snakebench.policy import Policy
from snakebench.store import file_digest

_SEALED, _SEAL = ("policy.safetensors", "log.csv"), "seal.json"
Row = dict[str, float | int | None]


class LearningFailed(SnakebenchError):
    """A training whose numbers are no longer finite; its last good checkpoint stays."""


class TrainingFolder:
    """The folder of one training."""

    def __init__(self, path: Path) -> None:
        self.path = writable_directory(path)
        self.policy = self.path / "policy.safetensors"

    def checkpoint(self) -> dict[str, Any] | None:
        """The last checkpoint that can be read, with the log's `rows`; None before the first. It executes nothing."""
        try:
            content = io.BytesIO((self.path / "checkpoint.pt").read_bytes())
            with zipfile.ZipFile(content) as archive:
                if archive.testzip() is not None:  # PyTorch does not compare the checksums
                    return None
            content.seek(0)
            return dict(torch.load(content, weights_only=True))
        except Exception:  # of a damaged file PyTorch may raise anything
            return None

    def write(self, row: Row, state: Mapping[str, Any], rows: list[Row]) -> None:
        """Add a row to the log, whose earlier ones are `rows`, with a checkpoint of the state after it."""
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

    def finish(self, policy: Policy) -> None:
        """Write the finished policy, and before it the digests that reveal later damage of it and of the log."""
        digests = self._digests() | {self.policy.name: file_digest(policy.content())}
        write_file(self.path / _SEAL, json.dumps(digests, indent=2) + "\n")
        policy.save(self.policy)

    def set_damaged_aside(self) -> bool:
        """Whether the finished policy or its log was damaged: both are set aside, and training continues."""
        if not self.policy.exists() or self._intact():
            return False
        for name in _SEALED:
            if (path := self.path / name).exists():
                path.replace(path.with_name(f"{name}.damaged"))
        if (checkpoint := self.checkpoint()) is not None:
            self._write_log(checkpoint["rows"])
        return True

    def failure(self, reason: str, numbers: Mapping[str, NDArray[Any]]) -> LearningFailed:
        """The error of a training whose numbers are not finite; their statistics are written to `failure.json`."""
        statistics = {name: _statistics(array) for name, array in numbers.items()}
        write_file(self.path / "failure.json", json.dumps({"reason": reason, "batch": statistics}, indent=2) + "\n")
        return LearningFailed(f"{reason}: the last good checkpoint and failure.json are kept in {self.path}")

    def _intact(self) -> bool:
        try:
            Policy.load(self.policy)
            return bool(json.loads((self.path / _SEAL).read_text(encoding="utf-8")) == self._digests())
        except FileNotFoundError:  # nothing was sealed
            return True
        except (InvalidValue, OSError, ValueError):
            return False

    def _digests(self) -> dict[str, str]:
        paths = (self.path / name for name in _SEALED)
        return {path.name: file_digest(path.read_bytes()) for path in paths if path.exists()}

    def _write_log(self, rows: list[Row]) -> None:
        write_file(self.path / "log.csv", pd.DataFrame(rows).to_csv(index=False, lineterminator="\n"))


def _statistics(array: NDArray[Any]) -> dict[str, float | int]:
    finite = array[np.isfinite(array)]
    statistics: dict[str, float | int] = {"numbers": int(array.size), "not finite": int(array.size - finite.size)}
    if finite.size:
        statistics |= {"least": float(finite.min()), "mean": float(finite.mean()), "most": float(finite.max())}
    return statistics
