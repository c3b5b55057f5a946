"""Distillation on perturbed robots: the student observes what sensors measure, its teacher the robots as they are."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from snakebench.learning.demonstrations import Demonstrations, Demonstrator
from snakebench.learning.perturbed import PerturbedVecEnv
from snakebench.learning.resume import learned
from snakebench.learning.rollouts import whole
from snakebench.learning.settings import Imitating
from snakebench.learning.training import Labels, _Distiller, _PolicyTeacher
from snakebench.policy import Policy


def distil_perturbed(
    settings: Imitating, teacher: Policy | Demonstrations, seed: int, folder: Path, origin: Labels | None = None
) -> Policy:
    """As `distil`, on perturbed robots; a student learns to filter, since its teacher's actions are of no noise."""
    return learned(settings, settings.iterations, folder, lambda: _Perturbed(settings, teacher, seed, origin or {}))


class _Perturbed(_Distiller):
    environment: PerturbedVecEnv

    def __init__(self, settings: Imitating, teacher: Policy | Demonstrations, seed: int, origin: Labels) -> None:
        super().__init__(settings, teacher, seed, origin)
        self._teacher = _Undeceived(self._teacher, self.environment)  # type: ignore[assignment]


class _Undeceived:
    """A teacher that is told of the robots as they are."""

    def __init__(self, teacher: _PolicyTeacher | Demonstrator, environment: PerturbedVecEnv) -> None:
        self.state, self._labels, self._environment = teacher.state, teacher.labels, environment

    def labels(self, observation: NDArray[np.float32], starts: NDArray[np.bool_]) -> NDArray[np.float32]:
        """The teacher's labels, whatever the sensors say."""
        del observation
        return self._labels(whole(self._environment.truth()), starts)
