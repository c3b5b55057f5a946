"""Distillation: a student with only its sensors imitates a privileged teacher, where either drives (DAgger style)."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from snakebench.learning.actor import Actor, State
from snakebench.learning.ppo import sequences
from snakebench.learning.resume import Row, learned
from snakebench.learning.settings import Distillation
from snakebench.learning.vector import SwimVecEnv
from snakebench.observation import Groups
from snakebench.policy import Policy


def distil(
    distillation: Distillation,
    teacher: Policy,
    seed: int,
    folder: Path,
    origin: Mapping[str, str | int | float] | None = None,
) -> Policy:
    """Teach a student, or continue where `folder` stopped; the same bytes either way, on the same kind of machine."""
    steps = distillation.iterations
    return learned(distillation, steps, folder, lambda: _Distiller(distillation, teacher, seed, origin or {}))


class _Distiller:
    """A `Learner` by distillation, and the state of the robots that teacher and student drive."""

    def __init__(
        self, distillation: Distillation, teacher: Policy, seed: int, origin: Mapping[str, str | int | float]
    ) -> None:
        torch.manual_seed(seed)
        np.random.seed(seed)
        members = distillation.members
        self._settings, self.steps, self.episodes = distillation, 0, list[dict[str, float]]()
        self._teacher, self._student = Actor.of(teacher), Actor(distillation.card(**origin))
        self._optimizer = torch.optim.Adam(self._student.parameters(), distillation.learning_rate, fused=True)
        self.environment = SwimVecEnv(members, distillation)
        self.environment.seed(seed)
        self._observation = _whole(self.environment.reset())
        self._states: list[State] = [self._teacher.rest(members), self._student.rest(members)]

    def learn(self, steps: int) -> Row:
        errors = []
        while self.steps < steps:
            errors.append(self._iterate())
            if not np.isfinite(errors[-1]):
                raise ValueError("the error is not finite")
        return {"error": float(np.mean(errors))}

    def policy(self) -> Policy:
        return self._student.policy()

    def numbers(self) -> dict[str, NDArray[Any]]:
        weights = {name: weight.detach().numpy() for name, weight in self._student.named_parameters()}
        return {"observation": self._observation.numpy(), **weights}

    def state(self) -> dict[str, Any]:
        return {
            "student": self._student.state_dict(),
            "optimizer": self._optimizer.state_dict(),
            "steps": self.steps,
            "states": self._states,
        }

    def restore(self, checkpoint: Mapping[str, Any]) -> None:
        self._student.load_state_dict(checkpoint["student"])
        self._optimizer.load_state_dict(checkpoint["optimizer"])
        self.steps, self._states = checkpoint["steps"], checkpoint["states"]
        self._observation = _whole(self.environment.observe())

    def _iterate(self) -> float:
        """A rollout, and what the student learns from it; returns its mean squared error before it learned [rad^2]."""
        hidden, cell = self._states[1]
        observations, labels, starts = self._rollout()
        errors = []
        for _ in range(self._settings.passes):
            order = np.random.permutation(self._settings.members)
            for group in np.array_split(order, self._settings.groups):
                batch = observations[:, group], labels[:, group], starts[:, group], (hidden[:, group], cell[:, group])
                errors.append(self._update(*batch))
        self.steps += 1
        return float(np.mean(errors[: self._settings.groups]))

    def _rollout(self) -> tuple[Tensor, Tensor, NDArray[np.bool_]]:
        """Observations and labels, shape (steps, members, …), and where episodes start in them."""
        settings = self._settings
        share = max(0.0, 1 - self.steps / settings.handover) if settings.handover else 0.0
        driven = torch.from_numpy(np.random.permutation(settings.members) < round(share * settings.members))
        observations, labels, starts = [], [], []
        for _ in range(settings.rollout):
            observations.append(self._observation)
            starts.append(self.environment.starts)
            label, action = (self._action(k, actor) for k, actor in enumerate((self._teacher, self._student)))
            labels.append(label)
            action = torch.where(driven[:, None], label, action)
            groups, _, _, infos = self.environment.step(action.numpy())
            self._observation = _whole(groups)
            self.episodes += [info["episode"] for info in infos if "episode" in info]
        return torch.stack(observations), torch.stack(labels), np.stack(starts)

    def _action(self, k: int, actor: Actor) -> Tensor:
        """The action of teacher (0) or student (1) on the present observation, whose state goes on."""
        goes_on = torch.from_numpy(~self.environment.starts).float()[None, :, None]
        hidden, cell = self._states[k]
        with torch.no_grad():
            action, self._states[k] = actor(self._observation[None], (hidden * goes_on, cell * goes_on))
        return action[0].clamp(-1.0, 1.0)

    def _update(self, observations: Tensor, labels: Tensor, starts: NDArray[np.bool_], state: State) -> float:
        """One step of Adam on the sequences of some members, cut where episodes start; returns the error [rad^2]."""
        cut = sequences(starts)
        steps, within = (part.T for part in cut.padded())  # shape (longest, n_sequences)
        goes_on = torch.from_numpy(~starts[cut.first, cut.member]).float()[:, None]
        hidden, cell = (part[:, cut.member] * goes_on for part in state)
        action, _ = self._student(observations[steps, cut.member], (hidden, cell))
        error = (action - labels[steps, cut.member])[torch.from_numpy(within)].square().mean()
        self._optimizer.zero_grad()
        error.backward()
        nn.utils.clip_grad_norm_(self._student.parameters(), 1.0)
        self._optimizer.step()
        return float(error.detach())


def _whole(groups: Groups) -> Tensor:
    return torch.from_numpy(np.hstack(list(groups.values())))
