"""Learning from the first step to a policy file; a killed training continues from its last checkpoint, to the byte."""

import io
import json
import shutil
import zipfile
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, Protocol

import numpy as np
import pandas as pd
import torch
from numpy.typing import NDArray
from torch.utils.tensorboard import SummaryWriter

from snakebench.engines import planar
from snakebench.errors import InvalidValue, SnakebenchError
from snakebench.evaluation import evaluate
from snakebench.execution import inputs_digest
from snakebench.files import writable_directory, write_file
from snakebench.fluid import PAPERS, Fluid
from snakebench.learning.demonstrations import Demonstrations
from snakebench.learning.settings import Imitating, Swimming, Training
from snakebench.learning.vector import SwimVecEnv
from snakebench.policy import Policy
from snakebench.sources import code_digest
from snakebench.store import file_digest
from snakebench.value import digest

_LEARNING = ("actor", "control_step", "demonstrations", "ppo", "resume", "rollouts", "training", "vector")
_CODE = code_digest(*(f"learning.{name}" for name in _LEARNING), "observation", "policy", "reward")
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


class Learner(Protocol):
    """A training or a distillation in progress."""

    environment: SwimVecEnv
    steps: int  # done: control steps of all members of a training, iterations of a distillation
    episodes: list[dict[str, float]]  # that ended, as the environment's `infos` have them

    def learn(self, steps: int) -> Row:
        """Learn until so many steps are done; returns what the log shows. Numbers not finite are a ValueError."""

    def policy(self) -> Policy:
        """The policy as it is now."""

    def numbers(self) -> dict[str, NDArray[Any]]:
        """What has to be finite: the last rollout and the network."""

    def state(self) -> dict[str, Any]:
        """What the rest depends on, for a checkpoint; the environment and global random streams apart."""

    def restore(self, checkpoint: Mapping[str, Any]) -> None:
        """Continue from what `state` returned, in the restored environment."""


def learned(settings: Training | Imitating, steps: int, path: Path, begin: Callable[[], Learner]) -> Policy:
    """The finished policy in a folder, or what `begin` starts and `steps` complete, on one core."""
    folder = TrainingFolder(path)
    if folder.policy.exists():
        return Policy.load(folder.policy)
    torch.set_num_threads(1)
    learner, rows = begin(), list[Row]()
    if (checkpoint := folder.checkpoint()) is not None:
        rows = checkpoint["rows"]
        learner.environment.restore({name: part.numpy() for name, part in checkpoint["environment"].items()})
        learner.restore(checkpoint)
        torch.set_rng_state(checkpoint["torch"])
        np.random.set_state(checkpoint["numpy"])
    for k in range(len(rows), settings.checkpoints):
        learner.episodes.clear()
        try:
            row = learner.learn(steps * (k + 1) // settings.checkpoints)
        except ValueError:
            if finite(learner.numbers()):
                raise
        if not finite(numbers := learner.numbers()):
            raise folder.failure(f"after {learner.steps} steps numbers are not finite", numbers)
        row = {"steps": learner.steps} | _returns(learner.episodes) | row | _evaluated(learner.policy(), settings)
        folder.write(row, _state(learner), rows)
    policy = learner.policy()
    folder.finish(policy)
    return policy


def learning_key(settings: Swimming, seed: int, teacher: Policy | Demonstrations | None = None) -> str:
    """A hash of everything that determines what is learned: settings, teacher, seed, physics, and the code."""
    made = [settings.digest(), seed, _physics_digest(settings), _CODE, torch.__version__]
    return digest([*made, teacher and teacher.digest()])[:16]


def _physics_digest(swimming: Swimming) -> str:
    """A hash of what a batch computes: the engine's code, and its numbers of the robot in fluids of all viscosities."""
    fluids = [Fluid(kinematic_viscosity=v) for v in np.geomspace(*swimming.randomisation.viscosities, 9).tolist()]
    rate = swimming.scenario().physics_rate
    return digest([planar.VERSION, *(inputs_digest("planar", swimming.robot, f, "angle", rate) for f in fluids)])


def finite(numbers: Mapping[str, NDArray[Any]]) -> bool:
    """Whether all numbers are finite."""
    return all(np.isfinite(array).all() for array in numbers.values())


def _state(learner: Learner) -> dict[str, Any]:
    stream: Any = np.random.get_state()
    return learner.state() | {
        "environment": {name: torch.from_numpy(array) for name, array in learner.environment.state().items()},
        "torch": torch.get_rng_state(),
        "numpy": (stream[0], stream[1].tolist(), *stream[2:]),
    }


def _returns(episodes: list[dict[str, float]]) -> Row:
    returns = [episode["r"] for episode in episodes if episode["whole"]]
    mean = float(np.mean(returns)) if returns else None
    deviation = float(np.std(returns, ddof=1)) if len(returns) > 1 else None
    return {"episodes": len(returns), "return_mean": mean, "return_std": deviation}


def _evaluated(policy: Policy, settings: Training | Imitating) -> Row:
    """Speed [m/s] and return of a policy in each fluid of the paper, in planar."""
    row: Row = {}
    for fluid in PAPERS:
        run = evaluate(policy, fluid, scenario=settings.scenario())
        row |= {f"speed_{fluid}": run.speed, f"return_{fluid}": run.episode_return}
    return row
