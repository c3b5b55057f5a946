"""PPO as in Stable-Baselines3 and sb3-contrib, with whole padded sequences and a learning rate that adapts.

The library that the paper names adapts its learning rate to the policy's change per update, measured as the
Kullback-Leibler divergence; so do these.
"""

from __future__ import annotations

from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from typing import Any, NamedTuple

import numpy as np
import torch
from numpy.typing import NDArray
from sb3_contrib import RecurrentPPO
from sb3_contrib.common.recurrent.buffers import RecurrentDictRolloutBuffer
from sb3_contrib.common.recurrent.type_aliases import RecurrentDictRolloutBufferSamples, RNNStates
from stable_baselines3 import PPO
from stable_baselines3.common.utils import FloatSchedule, explained_variance

_SLOWEST, _FASTEST = 1e-5, 1e-2  # bounds of the learning rate, and its change per update, as in that library
_CHANGE = 1.5


class Sequences(NamedTuple):
    """Where whole sequences stand in rollouts of shape (n_steps, members)."""

    first: NDArray[np.int64]  # step at which each begins, shape (n_sequences,)
    member: NDArray[np.int64]  # whose it is, shape (n_sequences,)
    length: NDArray[np.int64]  # its steps, shape (n_sequences,)


def sequences(starts: NDArray[np.bool_]) -> Sequences:
    """Rollouts cut at the starts of episodes; `starts` has shape (n_steps, members)."""
    begins = starts.T.copy()
    begins[:, 0] = True
    member, first = np.nonzero(begins)
    ends = np.append(first[1:], 0)
    ends[np.append(member[1:] != member[:-1], True)] = len(starts)
    return Sequences(first, member, ends - first)


class SequenceBuffer(RecurrentDictRolloutBuffer):
    """Rollouts that are handed out as whole sequences, so that no loop over time is needed to learn from them."""

    def get(self, batch_size: int | None = None) -> Iterator[RecurrentDictRolloutBufferSamples]:
        """Sequences in random order, in as many minibatches as there are `batch_size` in all steps, none empty."""
        cut = sequences(self.episode_starts > 0)
        order = np.random.permutation(len(cut.first))
        minibatches = 1 if batch_size is None else max(1, self.buffer_size * self.n_envs // batch_size)
        for chosen in np.array_split(order, min(minibatches, len(order))):
            yield self._sequences(Sequences(*(part[chosen] for part in cut)))

    def _sequences(self, cut: Sequences) -> RecurrentDictRolloutBufferSamples:
        step = np.arange(cut.length.max())
        within = step < cut.length[:, None]  # (n_sequences, longest)
        steps = np.where(within, cut.first[:, None] + step, cut.first[:, None])
        at = steps.ravel(), np.repeat(cut.member, len(step))

        def flat(array: NDArray[Any]) -> torch.Tensor:
            return torch.from_numpy(array[at])

        def state(hidden: NDArray[np.float32]) -> torch.Tensor:
            return torch.from_numpy(np.ascontiguousarray(hidden[cut.first, :, cut.member].swapaxes(0, 1)))

        return RecurrentDictRolloutBufferSamples(
            observations={name: flat(group) for name, group in self.observations.items()},
            actions=flat(self.actions),
            old_values=flat(self.values),
            old_log_prob=flat(self.log_probs),
            advantages=flat(self.advantages),
            returns=flat(self.returns),
            lstm_states=RNNStates(
                (state(self.hidden_states_pi), state(self.cell_states_pi)),
                (state(self.hidden_states_vf), state(self.cell_states_vf)),
            ),
            episode_starts=flat(self.episode_starts),
            mask=torch.from_numpy(within.ravel().astype(np.float32)),
        )


class _Adaptive:
    """Slows down learning after an update that changed the policy too much, and speeds it up after too little."""

    learning_rate: float
    logger: Any

    def __init__(self, *args: Any, kl: float, **settings: Any) -> None:
        self.kl = kl
        super().__init__(*args, **settings)

    def train(self) -> None:
        """Learn from the rollouts, then adapt the learning rate."""
        super().train()  # type: ignore[misc]
        found = self.logger.name_to_value["train/approx_kl"]
        if found > 2 * self.kl:
            self.adapt(max(_SLOWEST, self.learning_rate / _CHANGE))
        elif 0 < found < self.kl / 2:
            self.adapt(min(_FASTEST, self.learning_rate * _CHANGE))

    def adapt(self, learning_rate: float) -> None:
        """Learn at this rate from now on."""
        self.learning_rate, self.lr_schedule = learning_rate, FloatSchedule(learning_rate)


class MemorylessPPO(_Adaptive, PPO):
    """PPO for policies that see only the present; `kl` is the change per update aimed at."""


class _SequencePPO(RecurrentPPO):
    """Recurrent PPO on whole sequences. Actor and critic share nothing, so each learns in a thread of its own."""

    def _setup_model(self) -> None:
        super()._setup_model()
        lstm = self.policy.lstm_actor
        shape = (self.n_steps, lstm.num_layers, self.n_envs, lstm.hidden_size)
        self.rollout_buffer = SequenceBuffer(
            self.n_steps,
            self.observation_space,
            self.action_space,
            shape,
            self.device,
            gamma=self.gamma,
            gae_lambda=self.gae_lambda,
            n_envs=self.n_envs,
        )

    def train(self) -> None:
        """The losses of `RecurrentPPO.train`, in another order of work."""
        self.policy.set_training_mode(True)
        self._update_learning_rate(self.policy.optimizer)
        with ThreadPoolExecutor(1) as beside:
            for _ in range(self.n_epochs):
                updates = [self._update(batch, beside) for batch in self.rollout_buffer.get(self.batch_size)]
        self._n_updates += self.n_epochs
        value_loss, change = np.mean(updates, axis=0)  # of the last epoch
        explained = explained_variance(self.rollout_buffer.values.ravel(), self.rollout_buffer.returns.ravel())
        self.logger.record("train/value_loss", value_loss)
        self.logger.record("train/approx_kl", change)
        self.logger.record("train/explained_variance", explained)

    def _update(self, batch: RecurrentDictRolloutBufferSamples, beside: ThreadPoolExecutor) -> tuple[float, float]:
        """One step of the optimiser; returns the value loss and the policy's change."""
        self.policy.optimizer.zero_grad()
        criticism = beside.submit(self._criticise, batch)
        change = self._act(batch)
        value_loss = criticism.result()
        torch.nn.utils.clip_grad_norm_(self.policy.parameters(), self.max_grad_norm)
        self.policy.optimizer.step()
        return value_loss, change

    def _criticise(self, batch: RecurrentDictRolloutBufferSamples) -> float:
        """Find the critic's gradients; returns its loss."""
        values = self.policy.predict_values(batch.observations, batch.lstm_states.vf, batch.episode_starts)
        loss = (batch.returns - values.flatten())[batch.mask > 0].square().mean()
        (self.vf_coef * loss).backward()
        return float(loss.detach())

    def _act(self, batch: RecurrentDictRolloutBufferSamples) -> float:
        """Find the actor's gradients; returns an estimate of the Kullback-Leibler divergence from the old policy."""
        within, clip = batch.mask > 0, self.clip_range(1.0)
        actor, _ = self.policy.get_distribution(batch.observations, batch.lstm_states.pi, batch.episode_starts)
        log_ratio = (actor.log_prob(batch.actions) - batch.old_log_prob)[within]
        advantage = batch.advantages[within]
        advantage = (advantage - advantage.mean()) / (advantage.std() + 1e-8)
        ratio = log_ratio.exp()
        gain = torch.min(advantage * ratio, advantage * ratio.clamp(1 - clip, 1 + clip)).mean()
        (-gain - self.ent_coef * actor.entropy()[within].mean()).backward()
        return float((ratio - 1 - log_ratio).detach().mean())


class SequencePPO(_Adaptive, _SequencePPO):
    """Recurrent PPO on whole sequences; `kl` is the change per update aimed at."""
