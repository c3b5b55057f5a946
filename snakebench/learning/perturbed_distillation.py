"""Distillation on perturbed robots: the student observes what sensors measure, its teacher the robots as they are."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from snakebench.learning.demonstrations import Demonstrations
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
        if isinstance(teacher, Policy):
            self._teacher = _Undeceived(teacher, self.environment)


class _Undeceived(_PolicyTeacher):
    """A policy that shows its mean actions for the robots as they are."""

    def __init__(self, policy: Policy, environment: PerturbedVecEnv) -> None:
        super().__init__(policy, environment.num_envs)
        self._environment = environment

    def labels(self, observation: NDArray[np.float32], starts: NDArray[np.bool_]) -> NDArray[np.float32]:
        del observation
        return super().labels(whole(self._environment.truth()), starts)
