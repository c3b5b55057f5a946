"""PPO as in Stable-Baselines3 and sb3-contrib, with whole sequences and a learning rate that adapts.

It adapts to the Kullback-Leibler divergence of the policy per update, as in the library that the paper names.
"""

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from itertools import pairwise
from typing import Any

import numpy as np
import torch
from gymnasium import spaces
from numpy.typing import NDArray
from sb3_contrib import RecurrentPPO
from sb3_contrib.common.recurrent.policies import RecurrentMultiInputActorCriticPolicy
from sb3_contrib.common.recurrent.type_aliases import RNNStates
from stable_baselines3 import PPO
from stable_baselines3.common.buffers import DictRolloutBuffer
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.policies import MultiInputActorCriticPolicy
from stable_baselines3.common.torch_layers import BaseFeaturesExtractor
from stable_baselines3.common.utils import explained_variance
from stable_baselines3.common.vec_env import VecEnv
from torch import Tensor, nn

from snakebench.learning.actor import State, as_policy, outputs
from snakebench.learning.rollouts import Minibatch, kept, minibatches, padded, values_along, whole
from snakebench.learning.settings import Training
from snakebench.observation import GROUPS, Groups, columns
from snakebench.policy import Card, Policy

_SLOWEST, _FASTEST = 1e-5, 1e-2  # bounds of the learning rate, and its change per update, as in that library
_CHANGE = 1.5
_LOG_DENSITY = -0.5 * float(np.log(2 * np.pi))  # of a standard normal number, at 0


class Features(BaseFeaturesExtractor):
    """Columns of a dict observation, through an MLP with ELU."""

    def __init__(self, observation_space: spaces.Dict, chosen: Sequence[int], mlp: Sequence[int]) -> None:
        super().__init__(observation_space, mlp[-1] if mlp else len(chosen))
        self.chosen = torch.as_tensor(chosen)
        sizes = pairwise([len(chosen), *mlp])
        self.layers = nn.Sequential(*(part for one, two in sizes for part in (nn.Linear(one, two), nn.ELU())))

    def forward(self, observations: dict[str, Tensor]) -> Tensor:
        """Features of each member, shape (members, features_dim)."""
        whole = torch.cat([observations[name] for name in GROUPS], dim=1)
        return self.layers(whole[:, self.chosen])


class _Asymmetric:
    """Two feature extractors, each of its own columns: the actor's is made first, then the critic's."""

    observation_space: spaces.Dict
    features_extractor_kwargs: dict[str, Any]

    def __init__(self, *args: Any, actor: Sequence[int], critic: Sequence[int], **settings: Any) -> None:
        self._columns = iter((actor, critic))
        super().__init__(*args, **settings)

    def make_features_extractor(self) -> Features:
        """The features of the actor at the first call, of the critic at the second."""
        return Features(self.observation_space, next(self._columns), **self.features_extractor_kwargs)


class MemorylessPolicy(_Asymmetric, MultiInputActorCriticPolicy):
    """Actor and critic without memory."""


class RecurrentPolicy(_Asymmetric, RecurrentMultiInputActorCriticPolicy):
    """Actor and critic with an LSTM each, or a critic without memory.

    Beside what Stable-Baselines3 asks for, both are networks over whole sequences: of columns of observations, shape
    (steps, members, width), from a state of memory to the next.
    """

    def means(self, observed: Tensor, state: State) -> tuple[Tensor, State]:
        """Mean actions [rad], shape (steps, members, n_joints), and the actor's state after the last step."""
        return outputs(self.pi_features_extractor.layers, self.lstm_actor, self.action_net, observed, state)

    def values(self, observed: Tensor, state: State) -> tuple[Tensor, State]:
        """Values, shape (steps, members, 1), and the critic's state after the last step."""
        memory = self.lstm_critic or self.critic
        return outputs(self.vf_features_extractor.layers, memory, self.value_net, observed, state)

    def log_prob(self, deviations: Tensor) -> Tensor:
        """Logarithm of the probability density of actions, whose deviations from the mean have the joints last."""
        relative = deviations * torch.exp(-self.log_std)
        return (_LOG_DENSITY - self.log_std).sum() - 0.5 * relative.square().sum(-1)


def policy_settings(training: Training) -> tuple[type[Any], dict[str, Any]]:
    """The class of actor and critic, whose networks have the same sizes, and its arguments."""
    n_joints = training.robot.n_joints
    settings = {
        "actor": columns(training.feels, n_joints).tolist(),
        "critic": columns(training.critic, n_joints).tolist(),
        "net_arch": [],
        "activation_fn": nn.ELU,
        "log_std_init": float(np.log(training.spread)),
        "features_extractor_kwargs": {"mlp": training.mlp},
        "share_features_extractor": False,
        "optimizer_kwargs": {"eps": 1e-5, "fused": True},
    }
    if not training.lstm:
        return MemorylessPolicy, settings
    memory = {"lstm_hidden_size": training.lstm[0], "n_lstm_layers": len(training.lstm)}
    return RecurrentPolicy, settings | memory | {"enable_critic_lstm": training.critic_lstm}


def exported(network: MemorylessPolicy | RecurrentPolicy, card: Card) -> Policy:
    """The actor's mean as a policy that needs no PyTorch."""
    lstm = network.lstm_actor if card.lstm else None
    return as_policy(card, network.pi_features_extractor.layers, lstm, network.action_net)


class _Adaptive:
    """Lowers the learning rate after an update that changed the policy too much, and raises it after too little."""

    learning_rate: float

    def __init__(self, *args: Any, kl: float, **settings: Any) -> None:
        self.kl = kl
        super().__init__(*args, **settings)

    def _adapt(self, change: float) -> None:
        if change > 2 * self.kl:
            self.learning_rate = max(_SLOWEST, self.learning_rate / _CHANGE)
        elif 0 < change < self.kl / 2:
            self.learning_rate = min(_FASTEST, self.learning_rate * _CHANGE)
        self._setup_lr_schedule()  # type: ignore[attr-defined]  # of Stable-Baselines3


class MemorylessPPO(_Adaptive, PPO):
    """PPO for policies without memory; `kl` is the change per update aimed at."""

    def train(self) -> None:
        """Learn from the rollouts."""
        super().train()
        self._adapt(self.logger.name_to_value["train/approx_kl"])


class SequencePPO(_Adaptive, RecurrentPPO):
    """Recurrent PPO on whole sequences, in two threads.

    Actor and critic share no parameters, so each learns in a thread of its own. If the critic has no memory, and so
    little to do, halves of the sequences take the threads.
    """

    _last_obs: Groups
    _last_episode_starts: NDArray[np.bool_]
    _last_lstm_states: RNNStates

    def _setup_model(self) -> None:
        super()._setup_model()
        where = self.observation_space, self.action_space, self.device
        self.rollout_buffer = DictRolloutBuffer(self.n_steps, *where, self.gae_lambda, self.gamma, self.n_envs)
        self._columns = self.policy.pi_features_extractor.chosen, self.policy.vf_features_extractor.chosen

    def collect_rollouts(
        self, env: VecEnv, callback: BaseCallback, rollout_buffer: DictRolloutBuffer, n_rollout_steps: int
    ) -> bool:
        """Fill the buffer, as in `RecurrentPPO`; False if the callback ended the training."""
        self.policy.set_training_mode(False)
        rollout_buffer.reset()
        callback.on_rollout_start()
        self._first_states = first = self._last_lstm_states
        with torch.no_grad():
            noise = torch.randn(self.n_steps, *rollout_buffer.actions.shape[1:]) * self.policy.log_std.exp()
            rollout_buffer.log_probs[:] = self.policy.log_prob(noise).numpy()
        truncated, following, state = np.zeros(rollout_buffer.rewards.shape, bool), {}, first.pi
        for k in range(n_rollout_steps):
            action, state = self._act(self._last_obs, kept(state, self._last_episode_starts), noise[k])
            new_obs, rewards, dones, infos = env.step(np.clip(action, self.action_space.low, self.action_space.high))
            self.num_timesteps += env.num_envs
            callback.update_locals(locals())
            if not callback.on_step():
                return False
            self._update_info_buffer(infos, dones)
            for name, group in self._last_obs.items():
                rollout_buffer.observations[name][k] = group
            rollout_buffer.actions[k], rollout_buffer.rewards[k] = action, rewards
            rollout_buffer.episode_starts[k] = self._last_episode_starts
            if dones.any() or k == n_rollout_steps - 1:
                following[k] = whole(new_obs)
            for b in np.flatnonzero(dones):
                following[k][b] = whole(infos[b]["terminal_observation"])
                truncated[k, b] = infos[b]["TimeLimit.truncated"]
            self._last_obs, self._last_episode_starts = new_obs, dones
        critic_state = self._evaluate(rollout_buffer, truncated, following, first.vf)
        self._last_lstm_states = RNNStates(state, critic_state)
        rollout_buffer.full = True
        callback.on_rollout_end()
        return True

    def _act(self, observation: Groups, state: State, noise: Tensor) -> tuple[NDArray[np.float32], State]:
        with torch.no_grad():
            observed = torch.from_numpy(whole(observation))[None, :, self._columns[0]]
            mean, state = self.policy.means(observed, state)
            return (mean[0] + noise).numpy(), state

    def _evaluate(
        self,
        buffer: DictRolloutBuffer,
        truncated: NDArray[np.bool_],
        following: dict[int, NDArray[np.float32]],
        state: State,
    ) -> State:
        """Add values, returns and advantages to a buffer; returns the critic's state."""
        chosen = self._columns[1].numpy()
        observed = whole(buffer.observations)[..., chosen]
        ahead = {step: observation[:, chosen] for step, observation in following.items()}
        starts = buffer.episode_starts > 0
        buffer.values[:], ahead, state = values_along(self.policy.values, observed, starts, ahead, state)
        for step, values in ahead.items():
            buffer.rewards[step] += self.gamma * values * truncated[step]
        last_values = torch.from_numpy(ahead[self.n_steps - 1])
        buffer.compute_returns_and_advantage(last_values, self._last_episode_starts)
        return state

    def train(self) -> None:
        """Learn from the rollouts; the losses are those of `RecurrentPPO.train`."""
        self.policy.set_training_mode(True)
        self._update_learning_rate(self.policy.optimizer)
        states = self._first_states
        batch = padded(self.rollout_buffer, self._columns, (states.pi, states.vf))
        count = self.n_steps * self.n_envs // self.batch_size
        with ThreadPoolExecutor(1) as beside:
            for _ in range(self.n_epochs):
                updates = [self._update(part, beside) for part in minibatches(batch, count)]
        self._n_updates += self.n_epochs
        value_loss, change = np.mean(updates, axis=0)  # of the last epoch
        explained = explained_variance(self.rollout_buffer.values.ravel(), self.rollout_buffer.returns.ravel())
        self.logger.record("train/value_loss", value_loss)
        self.logger.record("train/approx_kl", change)
        self.logger.record("train/explained_variance", explained)
        self._adapt(change)

    def _update(self, batch: Minibatch, beside: ThreadPoolExecutor) -> tuple[float, float]:
        """Learn from a minibatch; returns the loss of the values and the Kullback-Leibler divergence, estimated."""
        self.policy.optimizer.zero_grad()
        advantages = batch.advantages[batch.within > 0]
        scaled = (batch.advantages - advantages.mean()) / (advantages.std() + 1e-8)
        batch = batch._replace(advantages=scaled, within=batch.within / len(advantages))
        parts = torch.arange(batch.within.shape[1]).chunk(1 if self.policy.lstm_critic else 2)
        first, *others = [batch.part(part) for part in parts]
        critic = beside.submit(self._differentiate_critic, batch)
        changes = [beside.submit(self._differentiate_actor, other) for other in others]
        change = self._differentiate_actor(first) + sum(other.result() for other in changes)
        value_loss = critic.result()
        torch.nn.utils.clip_grad_norm_(self.policy.parameters(), self.max_grad_norm)
        self.policy.optimizer.step()
        return value_loss, change

    def _differentiate_critic(self, batch: Minibatch) -> float:
        values, _ = self.policy.values(batch.critic, batch.critic_state)
        loss = ((batch.returns - values[..., 0]).square() * batch.within).sum()
        (self.vf_coef * loss).backward()
        return float(loss.detach())

    def _differentiate_actor(self, batch: Minibatch) -> float:
        """The gradients of the actor; returns its share of the Kullback-Leibler divergence from the old policy."""
        clip = self.clip_range(1.0)
        means, _ = self.policy.means(batch.actor, batch.actor_state)
        log_ratio = self.policy.log_prob(batch.actions - means) - batch.log_probs
        ratio = log_ratio.exp()
        gain = torch.min(batch.advantages * ratio, batch.advantages * ratio.clamp(1 - clip, 1 + clip))
        loss = -(gain * batch.within).sum()
        if self.ent_coef:  # of a normal distribution: the logarithm of its width, and a constant
            loss = loss - self.ent_coef * batch.within.sum() * self.policy.log_std.sum()
        loss.backward()
        return float(((ratio - 1 - log_ratio) * batch.within).detach().sum())
