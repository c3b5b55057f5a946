"""Learning from the first step to a policy file; a killed training continues from its last checkpoint.

It ends with the same bytes as one that was not interrupted, on the same kind of machine.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, Protocol

import numpy as np
import torch
from numpy.typing import NDArray

from snakebench.evaluation import evaluate
from snakebench.fluid import PAPERS
from snakebench.learning.settings import Distillation, Training
from snakebench.learning.training_folder import Row, TrainingFolder
from snakebench.learning.vector import physics_rate
from snakebench.policy import Policy


class Learner(Protocol):
    """A training or a distillation in progress."""

    @property
    def steps(self) -> int:
        """What is done: control steps of all members of a training, iterations of a distillation."""

    def learn(self, steps: int) -> Row:
        """Learn until so many steps are done; returns the log's row of what was learned meanwhile.

        Raises:
            ValueError: when numbers are no longer finite.
        """

    def policy(self) -> Policy:
        """The policy as it is now."""

    def numbers(self) -> Mapping[str, NDArray[Any]]:
        """What has to be finite: the last rollout and the network."""

    def state(self) -> dict[str, Any]:
        """What the rest of the learning depends on, global random streams apart, as a checkpoint stores it."""

    def restore(self, checkpoint: Mapping[str, Any]) -> None:
        """Continue from what `state` returned."""


def learned(settings: Training | Distillation, steps: int, path: Path, begin: Callable[[], Learner]) -> Policy:
    """The finished policy in a folder, or what `begin` starts and `steps` complete.

    It uses one core: two trainings side by side are faster than one on two.

    Raises:
        LearningFailed: when numbers are no longer finite; the last good checkpoint and the numbers' statistics stay.
        StoreError: when the folder cannot be written.
    """
    folder = TrainingFolder(path)
    if folder.policy.exists():
        return Policy.load(folder.policy)
    torch.set_num_threads(1)
    learner, rows = begin(), list[Row]()
    if (checkpoint := folder.checkpoint()) is not None:
        rows = checkpoint["rows"]
        learner.restore(checkpoint)
        torch.set_rng_state(checkpoint["torch"])
        np.random.set_state(checkpoint["numpy"])
    for k in range(len(rows), settings.checkpoints):
        try:
            row = learner.learn(steps * (k + 1) // settings.checkpoints)
        except ValueError:
            if finite(learner.numbers()):
                raise
        if not finite(numbers := learner.numbers()):
            raise folder.failure(f"after {learner.steps} steps numbers are not finite", numbers)
        folder.write(row | _evaluated(learner.policy(), settings), learner.state() | _random_streams(), rows)
    policy = learner.policy()
    policy.save(folder.policy)
    return policy


def episode_statistics(episodes: Sequence[Mapping[str, float]]) -> Row:
    """Number of whole episodes, the mean of their returns, and its standard deviation."""
    returns = [episode["r"] for episode in episodes if episode["whole"]]
    return {
        "episodes": len(returns),
        "return_mean": float(np.mean(returns)) if returns else None,
        "return_std": float(np.std(returns, ddof=1)) if len(returns) > 1 else None,
    }


def _evaluated(policy: Policy, settings: Training | Distillation) -> Row:
    """Speed [m/s] and return of a policy in each fluid of the paper, in planar."""
    row: Row = {}
    for fluid in PAPERS:
        run = evaluate(
            policy,
            fluid,
            robot=settings.robot,
            engine="planar",
            physics_rate=physics_rate(settings.control_rate),
            control_rate=settings.control_rate,
            duration=settings.duration,
        )
        row |= {f"speed_{fluid}": run.speed, f"return_{fluid}": run.episode_return}
    return row


def _random_streams() -> dict[str, Any]:
    """The global random streams that Stable-Baselines3 and PyTorch draw from."""
    state: Any = np.random.get_state()
    return {"torch": torch.get_rng_state(), "numpy": (state[0], state[1].tolist(), *state[2:])}


def finite(numbers: Mapping[str, NDArray[Any]]) -> bool:
    """Whether all numbers are finite."""
    return all(np.isfinite(array).all() for array in numbers.values())
