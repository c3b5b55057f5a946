"""PPO as in Stable-Baselines3 and sb3-contrib, with whole sequences and a learning rate that adapts.

It adapts to the Kullback-Leibler divergence of the policy per update, as in the library that the paper names.
"""

from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
import torch
from gymnasium import spaces
from numpy.typing import NDArray
from sb3_contrib import RecurrentPPO
from sb3_contrib.common.recurrent.buffers import RecurrentDictRolloutBuffer
from sb3_contrib.common.recurrent.policies import RecurrentMultiInputActorCriticPolicy
from sb3_contrib.common.recurrent.type_aliases import RecurrentDictRolloutBufferSamples, RNNStates
from stable_baselines3 import PPO
from stable_baselines3.common.policies import MultiInputActorCriticPolicy
from stable_baselines3.common.torch_layers import BaseFeaturesExtractor
from stable_baselines3.common.utils import explained_variance
from torch import Tensor, nn

from snakebench.learning.actor import as_policy
from snakebench.learning.settings import Training
from snakebench.observation import GROUPS, columns
from snakebench.policy import Card, Policy

_SLOWEST, _FASTEST = 1e-5, 1e-2  # bounds of the learning rate, and its change per update, as in that library
_CHANGE = 1.5
# The gradients of an LSTM are computed in bfloat16 where the processor has it: some three times as fast.
_BFLOAT16 = bool(torch.cpu.get_capabilities().get("avx512_bf16") or torch.cpu.get_capabilities().get("amx_bf16"))


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
    """Actor and critic with an LSTM each, over whole sequences, of which only the first step may begin an episode."""

    @staticmethod
    def _process_sequence(
        features: Tensor, lstm_states: tuple[Tensor, Tensor], episode_starts: Tensor, lstm: nn.LSTM
    ) -> tuple[Tensor, tuple[Tensor, Tensor]]:
        n = lstm_states[0].shape[1]
        goes_on = (1.0 - episode_starts.reshape(n, -1)[:, 0]).reshape(1, n, 1)
        sequences = features.reshape(n, -1, lstm.input_size).swapaxes(0, 1)
        with torch.autocast("cpu", torch.bfloat16, enabled=_BFLOAT16 and torch.is_grad_enabled()):
            output, (hidden, cell) = lstm(sequences, (lstm_states[0] * goes_on, lstm_states[1] * goes_on))
        return output.float().transpose(0, 1).flatten(0, 1), (hidden, cell)


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
    return RecurrentPolicy, settings | {"lstm_hidden_size": training.lstm[0], "n_lstm_layers": len(training.lstm)}


def exported(network: MemorylessPolicy | RecurrentPolicy, card: Card) -> Policy:
    """The actor's mean as a policy that needs no PyTorch."""
    lstm = network.lstm_actor if card.lstm else None
    return as_policy(card, network.pi_features_extractor.layers, lstm, network.action_net)


class Sequences(NamedTuple):
    """Where whole sequences are in rollouts of shape (n_steps, members); each part has shape (n_sequences,)."""

    first: NDArray[np.int64]  # step at which it begins
    member: NDArray[np.int64]
    length: NDArray[np.int64]  # number of steps

    def padded(self) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
        """The steps of each, filled up with its first one, and which are not filling: shape (n_sequences, longest)."""
        step = np.arange(self.length.max())
        within = step < self.length[:, None]
        return self.first[:, None] + np.where(within, step, 0), within


def sequences(starts: NDArray[np.bool_]) -> Sequences:
    """Rollouts cut at the starts of episodes; `starts` has shape (n_steps, members)."""
    begins = starts.T.copy()
    begins[:, 0] = True
    member, first = np.nonzero(begins)
    ends = np.append(first[1:], 0)
    ends[np.append(member[1:] != member[:-1], True)] = len(starts)
    return Sequences(first, member, ends - first)


def minibatches(buffer: RecurrentDictRolloutBuffer, count: int) -> Iterator[RecurrentDictRolloutBufferSamples]:
    """Whole sequences of rollouts in random order, in at most `count` minibatches, none empty."""
    cut = sequences(buffer.episode_starts > 0)
    order = np.random.permutation(len(cut.first))
    for chosen in np.array_split(order, min(count, len(order))):
        yield _samples(buffer, Sequences(*(part[chosen] for part in cut)))


def _samples(buffer: RecurrentDictRolloutBuffer, cut: Sequences) -> RecurrentDictRolloutBufferSamples:
    steps, within = cut.padded()
    at = steps.ravel(), np.repeat(cut.member, steps.shape[1])

    def flat(array: NDArray[Any]) -> Tensor:
        return torch.from_numpy(array[at])

    def state(hidden: NDArray[np.float32]) -> Tensor:
        return torch.from_numpy(np.ascontiguousarray(hidden[cut.first, :, cut.member].swapaxes(0, 1)))

    return RecurrentDictRolloutBufferSamples(
        observations={name: flat(group) for name, group in buffer.observations.items()},
        actions=flat(buffer.actions),
        old_values=flat(buffer.values),
        old_log_prob=flat(buffer.log_probs),
        advantages=flat(buffer.advantages),
        returns=flat(buffer.returns),
        lstm_states=RNNStates(
            (state(buffer.hidden_states_pi), state(buffer.cell_states_pi)),
            (state(buffer.hidden_states_vf), state(buffer.cell_states_vf)),
        ),
        episode_starts=flat(buffer.episode_starts),
        mask=torch.from_numpy(within.ravel().astype(np.float32)),
    )


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
    """Recurrent PPO on whole sequences; actor and critic share no parameters, so each learns in a thread of its own."""

    def train(self) -> None:
        """Learn from the rollouts; the losses are those of `RecurrentPPO.train`."""
        self.policy.set_training_mode(True)
        self._update_learning_rate(self.policy.optimizer)
        count = self.n_steps * self.n_envs // self.batch_size
        with ThreadPoolExecutor(1) as beside:
            for _ in range(self.n_epochs):
                updates = [self._update(batch, beside) for batch in minibatches(self.rollout_buffer, count)]
        self._n_updates += self.n_epochs
        value_loss, change = np.mean(updates, axis=0)  # of the last epoch
        explained = explained_variance(self.rollout_buffer.values.ravel(), self.rollout_buffer.returns.ravel())
        self.logger.record("train/value_loss", value_loss)
        self.logger.record("train/approx_kl", change)
        self.logger.record("train/explained_variance", explained)
        self._adapt(change)

    def _update(self, batch: RecurrentDictRolloutBufferSamples, beside: ThreadPoolExecutor) -> tuple[float, float]:
        self.policy.optimizer.zero_grad()
        critic = beside.submit(self._differentiate_critic, batch)
        change = self._differentiate_actor(batch)
        value_loss = critic.result()
        torch.nn.utils.clip_grad_norm_(self.policy.parameters(), self.max_grad_norm)
        self.policy.optimizer.step()
        return value_loss, change

    def _differentiate_critic(self, batch: RecurrentDictRolloutBufferSamples) -> float:
        values = self.policy.predict_values(batch.observations, batch.lstm_states.vf, batch.episode_starts)
        loss = (batch.returns - values.flatten())[batch.mask > 0].square().mean()
        (self.vf_coef * loss).backward()
        return float(loss.detach())

    def _differentiate_actor(self, batch: RecurrentDictRolloutBufferSamples) -> float:
        """The gradients of the actor; returns the Kullback-Leibler divergence from the old policy, estimated."""
        within, clip = batch.mask > 0, self.clip_range(1.0)
        actor, _ = self.policy.get_distribution(batch.observations, batch.lstm_states.pi, batch.episode_starts)
        log_ratio = (actor.log_prob(batch.actions) - batch.old_log_prob)[within]
        advantage = batch.advantages[within]
        advantage = (advantage - advantage.mean()) / (advantage.std() + 1e-8)
        ratio = log_ratio.exp()
        gain = torch.min(advantage * ratio, advantage * ratio.clamp(1 - clip, 1 + clip)).mean()
        (-gain - self.ent_coef * actor.entropy()[within].mean()).backward()
        return float((ratio - 1 - log_ratio).detach().mean())
