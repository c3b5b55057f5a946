"""Learning from the first step to a policy file; a killed training continues from its last checkpoint.

It ends with the same bytes as one that was not interrupted, on the same kind of machine.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, Protocol

import numpy as np
import torch
from numpy.typing import NDArray

from snakebench.evaluation import evaluate
from snakebench.fluid import PAPERS
from snakebench.learning.settings import Distillation, Training
from snakebench.learning.training_folder import Row, TrainingFolder
from snakebench.learning.vector import SwimVecEnv, physics_digest
from snakebench.policy import Policy
from snakebench.sources import code_digest
from snakebench.value import digest

_LEARNING = (f"learning.{name}" for name in ("actor", "control_step", "ppo", "resume", "vector"))
_SHARED = *_LEARNING, "observation", "policy", "reward"
_CODE = {
    Training: code_digest(*_SHARED, "learning.training"),
    Distillation: code_digest(*_SHARED, "learning.distillation"),
}


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


def learned(settings: Training | Distillation, steps: int, path: Path, begin: Callable[[], Learner]) -> Policy:
    """The finished policy in a folder, or what `begin` starts and `steps` complete.

    It uses one core: two trainings side by side are faster than one on two. When numbers are no longer finite, learning
    has failed; the last good checkpoint and the numbers' statistics stay.
    """
    folder = TrainingFolder(path)
    if folder.policy.exists():
        return Policy.load(folder.policy)
    torch.set_num_threads(1)
    learner, rows = begin(), list[Row]()
    if (checkpoint := folder.checkpoint()) is not None:
        rows = checkpoint["rows"]
        _restore(learner, checkpoint)
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


def learning_key(settings: Training | Distillation, seed: int, teacher: Policy | None = None) -> str:
    """A hash of everything that determines what is learned: settings, teacher, seed, physics, and the code."""
    made = [settings.digest(), seed, physics_digest(settings), _CODE[type(settings)], torch.__version__]
    return digest([*made, teacher and teacher.digest()])[:16]


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


def _restore(learner: Learner, checkpoint: Mapping[str, Any]) -> None:
    learner.environment.restore({name: tensor.numpy() for name, tensor in checkpoint["environment"].items()})
    learner.restore(checkpoint)
    torch.set_rng_state(checkpoint["torch"])
    np.random.set_state(checkpoint["numpy"])


def _returns(episodes: list[dict[str, float]]) -> Row:
    returns = [episode["r"] for episode in episodes if episode["whole"]]
    mean = float(np.mean(returns)) if returns else None
    deviation = float(np.std(returns, ddof=1)) if len(returns) > 1 else None
    return {"episodes": len(returns), "return_mean": mean, "return_std": deviation}


def _evaluated(policy: Policy, settings: Training | Distillation) -> Row:
    """Speed [m/s] and return of a policy in each fluid of the paper, in planar."""
    row: Row = {}
    for fluid in PAPERS:
        run = evaluate(policy, fluid, scenario=settings.scenario())
        row |= {f"speed_{fluid}": run.speed, f"return_{fluid}": run.episode_return}
    return row
