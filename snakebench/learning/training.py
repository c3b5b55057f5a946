"""Training by PPO, and distillation: a student with only its sensors imitates a privileged teacher (DAgger style)."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from sb3_contrib.common.recurrent.type_aliases import RNNStates
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.logger import Logger
from torch import Tensor, nn

from snakebench.learning.actor import Actor, State
from snakebench.learning.demonstrations import Demonstrations, Demonstrator
from snakebench.learning.perturbed import PerturbedVecEnv
from snakebench.learning.ppo import MemorylessPPO, SequencePPO, exported, policy_settings
from snakebench.learning.resume import Row, finite, learned
from snakebench.learning.rollouts import kept, sequences, whole
from snakebench.learning.settings import Imitating, Imitation, Swimming, Training
from snakebench.learning.vector import SwimVecEnv
from snakebench.observation import Groups
from snakebench.policy import Policy
from snakebench.reward import WEIGHTS

Labels = Mapping[str, str | int | float]  # how a policy was made
_LOGGED = {"kl": "approx_kl", "value_loss": "value_loss", "explained_variance": "explained_variance"}
_RECENT = 0.1  # weight of a control step in what a student's recent error is
_ROLLOUT = ("actions", "rewards", "values", "log_probs", "advantages", "returns")


def train(training: Training, seed: int, folder: Path, origin: Labels | None = None) -> Policy:
    """Train a policy, or continue where `folder` stopped; the same bytes either way, on the same kind of machine."""
    return learned(training, training.steps, folder, lambda: _Trainer(training, seed, origin or {}))


def distil(
    settings: Imitating, teacher: Policy | Demonstrations, seed: int, folder: Path, origin: Labels | None = None
) -> Policy:
    """Teach a student, or continue where `folder` stopped; the same bytes either way, on the same kind of machine."""
    return learned(settings, settings.iterations, folder, lambda: _Distiller(settings, teacher, seed, origin or {}))


def environment(members: int, swimming: Swimming) -> SwimVecEnv:
    """Where a policy learns: with perturbed robots if the settings name perturbations."""
    return (PerturbedVecEnv if swimming.randomisation.perturbations else SwimVecEnv)(members, swimming)


def ppo(training: Training, seed: int) -> MemorylessPPO | SequencePPO:
    """The model of Stable-Baselines3 that learns, before the first step."""
    policy, settings = policy_settings(training)
    return (SequencePPO if training.lstm else MemorylessPPO)(
        policy,
        environment(training.members, training),
        kl=training.kl,
        learning_rate=training.learning_rate,
        n_steps=training.rollout,
        batch_size=training.members * training.rollout // training.minibatches,
        n_epochs=training.epochs,
        gamma=training.discount,
        gae_lambda=training.trace,
        clip_range=training.clip,
        ent_coef=training.entropy,
        vf_coef=training.value,
        max_grad_norm=training.gradient,
        policy_kwargs=settings,
        seed=seed,
        device="cpu",
    )


def curriculum(training: Training, done: float) -> dict[str, float]:
    """Attributes of `SwimVecEnv` after a share of the training: w_1 [s/m], and the highest price of power [1/W]."""
    grown = min(done / training.growth, 1.0) if training.growth else 1.0
    values = {"propulsion": training.propulsion + grown * (WEIGHTS.propulsion - training.propulsion)}
    if training.randomisation.prices:
        low, high = training.randomisation.prices
        grown = min(done / training.price_growth, 1.0) if training.price_growth else 1.0
        values["highest_price"] = float(low * (high / low) ** grown)
    return values


class _Trainer(BaseCallback):
    """A `Learner` by PPO; as the model's callback it collects episodes, moves the curriculum and looks for NaN."""

    def __init__(self, training: Training, seed: int, origin: Labels) -> None:
        super().__init__()
        self._training, self._card = training, training.card(**origin)
        self.episodes: list[dict[str, float]] = []
        self.model: Any = ppo(training, seed)
        self.environment = self.model.get_env()
        self._on_rollout_start()  # the first episodes begin before the first rollout

    @property
    def steps(self) -> int:
        return int(self.model.num_timesteps)

    def learn(self, steps: int) -> Row:
        self.model.set_logger(Logger(None, []))  # one of Stable-Baselines3's own would leave a directory behind
        self.model.learn(steps - self.steps, self, log_interval=None, reset_num_timesteps=False)
        spread = float(self.model.policy.log_std.detach().exp().mean())
        row: Row = {"learning_rate": self.model.learning_rate, "spread": spread}
        return row | {name: float(self.logger.name_to_value[f"train/{key}"]) for name, key in _LOGGED.items()}

    def policy(self) -> Policy:
        return exported(self.model.policy, self._card)

    def numbers(self) -> dict[str, NDArray[Any]]:
        buffer = self.model.rollout_buffer
        weights = {name: weight.detach().numpy() for name, weight in self.model.policy.named_parameters()}
        last = {f"last {name}": group for name, group in self.model._last_obs.items()}
        return {**buffer.observations, **{name: getattr(buffer, name) for name in _ROLLOUT}, **last, **weights}

    def state(self) -> dict[str, Any]:
        return {
            "parameters": self.model.get_parameters(),
            "learning_rate": self.model.learning_rate,
            "steps": self.steps,
            "memory": tuple(self.model._last_lstm_states) if self._training.lstm else None,
        }

    def restore(self, checkpoint: Mapping[str, Any]) -> None:
        model = self.model
        model.set_parameters(checkpoint["parameters"])
        model.learning_rate = checkpoint["learning_rate"]
        model._setup_lr_schedule()
        model.num_timesteps = checkpoint["steps"]
        model._last_obs, model._last_episode_starts = self.environment.observe(), self.environment.starts
        if self._training.lstm:
            model._last_lstm_states = RNNStates(*checkpoint["memory"])

    def _on_step(self) -> bool:
        self.episodes += [info["episode"] for info in self.locals["infos"] if "episode" in info]
        return True

    def _on_rollout_start(self) -> None:
        for name, value in curriculum(self._training, self.steps / self._training.steps).items():
            self.environment.set_attr(name, value)

    def _on_rollout_end(self) -> None:
        if not finite(self.numbers()):
            raise ValueError("a rollout is not finite")


class _Distiller:
    """A `Learner` by imitation, and the state of the robots that teacher and student drive."""

    def __init__(self, settings: Imitating, teacher: Policy | Demonstrations, seed: int, origin: Labels) -> None:
        torch.manual_seed(seed)
        np.random.seed(seed)
        self._settings, self.steps, self.episodes = settings, 0, list[dict[str, float]]()
        self._student = Actor(settings.card(**origin))
        self._optimizer = torch.optim.Adam(self._student.parameters(), settings.learning_rate, fused=True)
        self.environment = environment(settings.members, settings)
        self.environment.seed(seed)
        self._observation = _tensor(self.environment.reset())
        self._state = self._student.rest(settings.members)
        self._lost = torch.zeros(settings.members, 1)  # recent squared errors [rad^2]
        self._teacher: _PolicyTeacher | Demonstrator
        if isinstance(teacher, Policy):
            self._teacher = _PolicyTeacher(teacher, settings.members)
        else:
            self._teacher = Demonstrator(teacher, settings, settings.members)

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
            "state": self._state,
            "lost": self._lost,
            "teacher": {name: torch.from_numpy(array) for name, array in self._teacher.state().items()},
        }

    def restore(self, checkpoint: Mapping[str, Any]) -> None:
        self._student.load_state_dict(checkpoint["student"])
        self._optimizer.load_state_dict(checkpoint["optimizer"])
        self.steps, self._state, self._lost = (checkpoint[name] for name in ("steps", "state", "lost"))
        for name, array in self._teacher.state().items():
            array[:] = checkpoint["teacher"][name].numpy()
        self._observation = _tensor(self.environment.observe())

    def _iterate(self) -> float:
        """A rollout, and what the student learns from it; returns its mean squared error before it learned [rad^2]."""
        hidden, cell = self._state
        self._slow_down()
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
        driven = torch.from_numpy(self._driven())[:, None]
        observations, labels, starts = [], [], []
        for _ in range(settings.rollout):
            observations.append(self._observation)
            starts.append(self.environment.starts)
            labels.append(torch.from_numpy(self._teacher.labels(self._observation.numpy(), starts[-1])))
            action, self._state = _step(self._student, self._observation, self._state, starts[-1])
            share = self._rescued(driven, action, labels[-1])
            action = share * labels[-1] + (1 - share) * action
            groups, _, _, infos = self.environment.step(action.numpy())
            self._observation = _tensor(groups)
            self.episodes += [info["episode"] for info in infos if "episode" in info]
        return torch.stack(observations), torch.stack(labels), np.stack(starts)

    def _driven(self) -> NDArray[np.float32]:
        """The teacher's share in the action of each member: all of it for some, or the same for all."""
        settings = self._settings
        share = max(0.0, 1 - self.steps / settings.handover) if settings.handover else 0.0
        if isinstance(settings, Imitation):
            return np.full(settings.members, share, np.float32)
        return (np.random.permutation(settings.members) < round(share * settings.members)).astype(np.float32)

    def _rescued(self, driven: Tensor, action: Tensor, label: Tensor) -> Tensor:
        """The teacher's share in each action: it takes over where a student that imitates gaits is lost."""
        if not isinstance(self._settings, Imitation):
            return driven
        self._lost = self._lost + _RECENT * ((action - label).square().mean(dim=1, keepdim=True) - self._lost)
        return torch.maximum(driven, (2 * self._lost / self._settings.lost - 1).clamp(0.0, 1.0))

    def _slow_down(self) -> None:
        """Let the learning rate fall to 0 in the last iterations."""
        if decay := self._settings.decay:
            left = (1 - self.steps / self._settings.iterations) / decay
            self._optimizer.param_groups[0]["lr"] = self._settings.learning_rate * min(left, 1.0)

    def _update(self, observations: Tensor, labels: Tensor, starts: NDArray[np.bool_], state: State) -> float:
        """One step of Adam on the sequences of some members, cut where episodes start; returns the error [rad^2]."""
        cut = sequences(starts)
        steps, within = cut.padded()
        first = kept((state[0][:, cut.member], state[1][:, cut.member]), starts[cut.first, cut.member])
        action, _ = self._student(observations[steps, cut.member], first)
        error = (action - labels[steps, cut.member])[torch.from_numpy(within)].square().mean()
        self._optimizer.zero_grad()
        error.backward()
        nn.utils.clip_grad_norm_(self._student.parameters(), 1.0)
        self._optimizer.step()
        return float(error.detach())


class _PolicyTeacher:
    """A policy that shows its mean actions."""

    def __init__(self, policy: Policy, members: int) -> None:
        self._actor = Actor.of(policy)
        self._state = self._actor.rest(members)

    def state(self) -> dict[str, NDArray[Any]]:
        """What is remembered, not copies."""
        return dict(zip(("hidden", "cell"), (part.numpy() for part in self._state), strict=True))

    def labels(self, observation: NDArray[np.float32], starts: NDArray[np.bool_]) -> NDArray[np.float32]:
        """As `Demonstrator.labels`."""
        action, state = _step(self._actor, torch.from_numpy(observation), self._state, starts)
        for part, new in zip(self._state, state, strict=True):
            part.copy_(new)
        return action.numpy()


def _step(actor: Actor, observation: Tensor, state: State, starts: NDArray[np.bool_]) -> tuple[Tensor, State]:
    """Target angles of members [rad], and their state afterwards; it begins anew where episodes start."""
    with torch.no_grad():
        action, state = actor(observation[None], kept(state, starts))
    return action[0].clamp(-1.0, 1.0), state


def _tensor(groups: Groups) -> Tensor:
    return torch.from_numpy(whole(groups))
