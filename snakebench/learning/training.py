"""A training: PPO from the first step to a policy file, with a log and checkpoints on the way."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import torch
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.logger import Logger
from stable_baselines3.common.vec_env import VecEnv

from snakebench.learning.networks import exported, policy_settings
from snakebench.learning.ppo import MemorylessPPO, SequencePPO
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
from snakebench.learning.settings import Training
from snakebench.learning.vector import SwimVecEnv, physics_digest
from snakebench.policy import Card, Policy
from snakebench.reward import Weights
from snakebench.sources import code_digest
from snakebench.value import digest

_CODE = code_digest(
    *(f"learning.{name}" for name in ("actor", "networks", "ppo", "task", "training", "vector")),
    *("observation", "policy", "reward"),
)
_KEPT = {"kl": "approx_kl", "value_loss": "value_loss", "explained_variance": "explained_variance"}


def train(training: Training, seed: int, folder: Path, origin: dict[str, str | int | float] | None = None) -> Policy:
    """Train a policy, or go on where `folder` stopped; the same bytes either way, on the same kind of machine.

    It uses one core: two trainings side by side are faster than one on two.

    Raises:
        LearningFailed: when numbers are no longer finite; the last good checkpoint and the batch's statistics stay.
        StoreError: when the folder cannot be written.
    """
    place = Folder(folder)
    if place.policy.exists():
        return Policy.load(place.policy)
    torch.set_num_threads(1)
    card = training.card(**(origin or {}))
    model = _model(training, card, seed)
    _advance(model.get_env(), training, 0.0)  # the first episodes begin before the first rollout
    rows: list[Row] = []
    if (checkpoint := place.checkpoint()) is not None:
        rows = checkpoint["rows"]
        _restore(model, checkpoint)
    watch = _Watch(training, place)
    for k in range(len(rows), training.checkpoints):
        target = training.steps * (k + 1) // training.checkpoints
        model.set_logger(Logger(None, []))  # the record is ours; SB3's own would leave a directory behind
        try:
            model.learn(target - model.num_timesteps, watch, log_interval=None, reset_num_timesteps=False)
        except ValueError:  # of the actions' distribution or of the engine
            if _finite(batch := _batch(model)):
                raise
            raise place.fail(f"after {model.num_timesteps} steps numbers are not finite", batch) from None
        _check(model, place)
        found = model.logger.name_to_value
        row: Row = {"steps": model.num_timesteps, **finished(watch.episodes)}
        row |= {"learning_rate": model.learning_rate, "spread": float(model.policy.log_std.detach().exp().mean())}
        row |= {name: float(found[f"train/{key}"]) for name, key in _KEPT.items()}
        place.keep(row | judged(exported(model.policy, card), training), _state(model), rows)
        watch.episodes.clear()
    policy = exported(model.policy, card)
    policy.save(place.policy)
    return policy


def training_key(training: Training, seed: int) -> str:
    """A hash of everything that determines a training: settings, seed, physics, and the code that learns."""
    return digest([training.digest(), seed, physics_digest(training), _CODE, torch.__version__])[:16]


class _Watch(BaseCallback):
    """Collects episodes, moves the curriculum, and looks at each rollout before it is learned from."""

    def __init__(self, training: Training, place: Folder) -> None:
        super().__init__()
        self._training, self._place = training, place
        self.episodes: list[dict[str, float]] = []

    def _on_step(self) -> bool:
        self.episodes += [about["episode"] for about in self.locals["infos"] if "episode" in about]
        return True

    def _on_rollout_start(self) -> None:
        _advance(self.training_env, self._training, self.num_timesteps / self._training.steps)

    def _on_rollout_end(self) -> None:
        batch = _batch(self.model)
        if not _finite(batch):
            raise self._place.fail(f"after {self.num_timesteps} steps a rollout is not finite", batch)


def _advance(environment: VecEnv, training: Training, done: float) -> None:
    """Move the curriculum to where it is after a share of the training."""
    environment.set_attr("propulsion", _propulsion(training, done))
    if training.randomisation.prices:
        environment.set_attr("dearest", _dearest(training, done, *training.randomisation.prices))


def _propulsion(training: Training, done: float) -> float:
    """The weight w_1 after a share of the training [s/m]."""
    return training.propulsion + _grown(done, training.growth) * (Weights().propulsion - training.propulsion)


def _dearest(training: Training, done: float, low: float, high: float) -> float:
    """The highest price of power after a share of the training [1/W]."""
    return float(low * (high / low) ** _grown(done, training.price_growth))


def _grown(done: float, growth: float) -> float:
    return min(done / growth, 1.0) if growth else 1.0


def _model(training: Training, card: Card, seed: int) -> MemorylessPPO | SequencePPO:
    policy, settings = policy_settings(card, training.critic, training.spread)
    return (SequencePPO if card.lstm else MemorylessPPO)(
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


def _batch(model: Any) -> dict[str, Any]:
    buffer = model.rollout_buffer
    names = ("actions", "rewards", "values", "log_probs", "advantages", "returns")
    weights = {name: weight.detach().numpy() for name, weight in model.policy.named_parameters()}
    last = {f"last {name}": group for name, group in model._last_obs.items()}
    return {**buffer.observations, **{name: getattr(buffer, name) for name in names}, **last, **weights}


def _finite(batch: dict[str, Any]) -> bool:
    return all(np.isfinite(array).all() for array in batch.values())


def _check(model: Any, place: Folder) -> None:
    if not all(torch.isfinite(parameter).all() for parameter in model.policy.parameters()):
        raise place.fail(f"after {model.num_timesteps} steps the network is not finite", _batch(model))


def _state(model: Any) -> dict[str, Any]:
    """All that the rest of a training depends on."""
    states = getattr(model, "_last_lstm_states", None)
    return {
        "policy": model.policy.state_dict(),
        "optimizer": model.policy.optimizer.state_dict(),
        "learning_rate": model.learning_rate,
        "steps": model.num_timesteps,
        "observation": as_tensors(model._last_obs),
        "starts": torch.from_numpy(np.array(model._last_episode_starts)),
        "memory": None if states is None else [list(states.pi), list(states.vf)],
        "environment": as_tensors(model.get_env().state()),
        "streams": random_streams(),
    }


def _restore(model: Any, checkpoint: dict[str, Any]) -> None:
    model.policy.load_state_dict(checkpoint["policy"])
    model.policy.optimizer.load_state_dict(checkpoint["optimizer"])
    model.adapt(checkpoint["learning_rate"])
    model.num_timesteps = checkpoint["steps"]
    model._last_obs = as_arrays(checkpoint["observation"])
    model._last_episode_starts = checkpoint["starts"].numpy()
    if checkpoint["memory"] is not None:
        actor, critic = (tuple(part) for part in checkpoint["memory"])
        model._last_lstm_states = type(model._last_lstm_states)(actor, critic)
    model.get_env().restore(as_arrays(checkpoint["environment"]))
    set_random_streams(checkpoint["streams"])
