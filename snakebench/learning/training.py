"""A training: PPO from the first step to a policy file."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from numpy.typing import NDArray
from sb3_contrib.common.recurrent.type_aliases import RNNStates
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.logger import Logger

from snakebench.learning.ppo import MemorylessPPO, SequencePPO, exported, policy_settings
from snakebench.learning.resume import Row, finite, learned
from snakebench.learning.settings import Training
from snakebench.learning.vector import SwimVecEnv
from snakebench.policy import Policy
from snakebench.reward import WEIGHTS

_LOGGED = {"kl": "approx_kl", "value_loss": "value_loss", "explained_variance": "explained_variance"}
_ROLLOUT = ("actions", "rewards", "values", "log_probs", "advantages", "returns")


def train(training: Training, seed: int, folder: Path, origin: Mapping[str, str | int | float] | None = None) -> Policy:
    """Train a policy, or continue where `folder` stopped; the same bytes either way, on the same kind of machine."""
    return learned(training, training.steps, folder, lambda: _Trainer(training, seed, origin or {}))


def ppo(training: Training, seed: int) -> MemorylessPPO | SequencePPO:
    """The model of Stable-Baselines3 that learns, before the first step."""
    policy, settings = policy_settings(training)
    return (SequencePPO if training.lstm else MemorylessPPO)(
        policy,
        SwimVecEnv(training.members, training),
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

    def __init__(self, training: Training, seed: int, origin: Mapping[str, str | int | float]) -> None:
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
