"""Distillation: a student that feels only its sensors imitates a teacher (DAgger style).

Teacher and student swim together: in each control step the teacher's mean action is the label, and one of the two
drives each robot. At first the teacher drives, so that the student sees the gait's cycle; its share falls to zero, so
that the student learns on the states that it visits itself.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from snakebench.errors import InvalidValue
from snakebench.learning.actor import Actor, State, as_whole
from snakebench.learning.ppo import sequences
from snakebench.learning.record import (
    Folder,
    Row,
    as_arrays,
    as_tensors,
    finished,
    judged,
    random_streams,
    set_random_streams,
)
from snakebench.learning.settings import Distillation
from snakebench.learning.vector import SwimVecEnv, physics_digest
from snakebench.policy import Policy
from snakebench.sources import code_digest
from snakebench.value import digest

_CODE = code_digest(
    *(f"learning.{name}" for name in ("actor", "distillation", "ppo", "task", "vector")),
    *("observation", "policy", "reward"),
)


def distil(
    distillation: Distillation,
    teacher: Policy,
    seed: int,
    folder: Path,
    origin: dict[str, str | int | float] | None = None,
) -> Policy:
    """Teach a student, or go on where `folder` stopped; the same bytes either way, on the same kind of machine.

    Raises:
        LearningFailed: when numbers are no longer finite; the last good checkpoint and the batch's statistics stay.
        StoreError: when the folder cannot be written.
    """
    place = Folder(folder)
    if place.policy.exists():
        return Policy.load(place.policy)
    torch.set_num_threads(1)
    lesson = _Lesson(distillation, teacher, seed, origin or {})
    rows: list[Row] = []
    if (checkpoint := place.checkpoint()) is not None:
        rows = checkpoint["rows"]
        lesson.restore(checkpoint)
    for k in range(len(rows), distillation.checkpoints):
        until = distillation.iterations * (k + 1) // distillation.checkpoints
        errors = []
        while lesson.done < until:
            try:
                errors.append(lesson.iterate())
            except InvalidValue as error:  # of the engine: an action that is not finite
                raise place.fail(f"after {lesson.done} iterations: {error}", lesson.batch()) from None
            if not np.isfinite(errors[-1]):
                raise place.fail(f"after {lesson.done} iterations the error is not finite", lesson.batch())
        row: Row = {"steps": lesson.done, **finished(lesson.episodes), "error": float(np.mean(errors))}
        lesson.episodes.clear()
        place.keep(row | judged(lesson.student.policy(), distillation), lesson.state(), rows)
    policy = lesson.student.policy()
    policy.save(place.policy)
    return policy


def distillation_key(distillation: Distillation, teacher: Policy, seed: int) -> str:
    """A hash of all that determines a distillation: settings, teacher, seed, physics, and the code that learns."""
    return digest(
        [distillation.digest(), teacher.digest(), seed, physics_digest(distillation), _CODE, torch.__version__]
    )[:16]


class _Lesson:
    """Everything that changes while a student learns."""

    def __init__(
        self, distillation: Distillation, teacher: Policy, seed: int, origin: dict[str, str | int | float]
    ) -> None:
        torch.manual_seed(seed)
        np.random.seed(seed)
        self._settings, self.done, self.episodes = distillation, 0, list[dict[str, float]]()
        members = distillation.members
        self._teacher, self.student = Actor.of(teacher), Actor(distillation.card(**origin))
        self._optimizer = torch.optim.Adam(self.student.parameters(), distillation.learning_rate, fused=True)
        self._environment = SwimVecEnv(members, distillation)
        self._environment.seed(seed)
        self._observation = as_whole(self._environment.reset())
        self._starts = np.ones(members, bool)
        self._knows, self._remembers = self._teacher.rest(members), self.student.rest(members)

    def iterate(self) -> float:
        """A rollout, and what the student learns from it; returns its mean squared error before it learned [rad^2]."""
        memory = self._remembers
        observations, labels, starts = self._swim()
        errors = []
        for _ in range(self._settings.passes):
            order = np.random.permutation(self._settings.members)
            for group in np.array_split(order, self._settings.groups):
                chosen = torch.from_numpy(group)
                errors.append(
                    self._learn(
                        observations[:, chosen],
                        labels[:, chosen],
                        starts[:, group],
                        (memory[0][:, chosen], memory[1][:, chosen]),
                    )
                )
        self.done += 1
        return float(np.mean(errors[: self._settings.groups]))

    def state(self) -> dict[str, Any]:
        """All that the rest of the lesson depends on."""
        return {
            "student": self.student.state_dict(),
            "optimizer": self._optimizer.state_dict(),
            "done": self.done,
            "observation": self._observation,
            "starts": torch.from_numpy(self._starts),
            "knows": list(self._knows),
            "remembers": list(self._remembers),
            "environment": as_tensors(self._environment.state()),
            "streams": random_streams(),
        }

    def restore(self, checkpoint: dict[str, Any]) -> None:
        """Go on from what `state` gave."""
        self.student.load_state_dict(checkpoint["student"])
        self._optimizer.load_state_dict(checkpoint["optimizer"])
        self.done, self._observation = checkpoint["done"], checkpoint["observation"]
        self._starts = checkpoint["starts"].numpy()
        self._knows, self._remembers = ((part[0], part[1]) for part in (checkpoint["knows"], checkpoint["remembers"]))
        self._environment.restore(as_arrays(checkpoint["environment"]))
        set_random_streams(checkpoint["streams"])

    def batch(self) -> dict[str, NDArray[Any]]:
        """The present of the lesson, for the statistics of a failure."""
        weights = {name: weight.detach().numpy() for name, weight in self.student.named_parameters()}
        return {"observation": self._observation.numpy(), **weights}

    def _swim(self) -> tuple[Tensor, Tensor, NDArray[np.bool_]]:
        """A rollout: observations and labels, shape (steps, members, …), and where episodes start in it."""
        settings = self._settings
        share = max(0.0, 1 - self.done / settings.handover) if settings.handover else 0.0
        led = torch.from_numpy(np.random.permutation(settings.members) < round(share * settings.members))
        observations, labels, starts = [], [], []
        for _ in range(settings.rollout):
            observations.append(self._observation)
            starts.append(self._starts)
            with torch.no_grad():
                goes_on = torch.from_numpy(~self._starts).float()[None, :, None]
                right, self._knows = self._step(self._teacher, self._knows, goes_on)
                tried, self._remembers = self._step(self.student, self._remembers, goes_on)
            labels.append(right)
            action = torch.where(led[:, None], right, tried)
            observation, _, self._starts, about = self._environment.step(action.numpy())
            self._observation = as_whole(observation)
            self.episodes += [one["episode"] for one in about if "episode" in one]
        return torch.stack(observations), torch.stack(labels), np.stack(starts)

    def _step(self, actor: Actor, state: State, goes_on: Tensor) -> tuple[Tensor, State]:
        action, after = actor(self._observation[None], (state[0] * goes_on, state[1] * goes_on))
        return action[0].clamp(-1.0, 1.0), after

    def _learn(self, observations: Tensor, labels: Tensor, starts: NDArray[np.bool_], memory: State) -> float:
        """One step of Adam on the sequences of some members, cut where episodes start; returns the error [rad^2]."""
        cut = sequences(starts)
        step = np.arange(cut.length.max())
        within = torch.from_numpy(step[:, None] < cut.length)  # (longest, n_sequences)
        at = np.minimum(cut.first + step[:, None], len(starts) - 1), cut.member
        goes_on = torch.from_numpy(~starts[cut.first, cut.member]).float()[:, None]
        hidden, cell = (part[:, cut.member] * goes_on for part in memory)
        tried, _ = self.student(observations[at], (hidden, cell))
        error = (tried - labels[at])[within].square().mean()
        self._optimizer.zero_grad()
        error.backward()
        nn.utils.clip_grad_norm_(self.student.parameters(), 1.0)
        self._optimizer.step()
        return float(error.detach())
