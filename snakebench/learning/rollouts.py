"""Rollouts for recurrent PPO: in time order while they are collected, cut into sequences to learn from.

While robots swim, only the actor runs, step by step. The critic then sees many steps at once.
"""

from collections.abc import Callable, Iterator, Mapping
from typing import Any, NamedTuple

import numpy as np
import torch
from numpy.typing import NDArray
from stable_baselines3.common.buffers import DictRolloutBuffer
from torch import Tensor

from snakebench.learning.actor import State
from snakebench.observation import GROUPS

Network = Callable[[Tensor, State], tuple[Tensor, State]]  # over sequences, from a state to the state after them


class Sequences(NamedTuple):
    """Where whole sequences are in rollouts of shape (n_steps, members); each part has shape (n_sequences,)."""

    first: NDArray[np.int64]  # step at which it begins
    member: NDArray[np.int64]
    length: NDArray[np.int64]  # number of steps

    def padded(self) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
        """The steps of each, filled up with its first one, and which are not filling: shape (longest, n_sequences)."""
        step = np.arange(self.length.max())[:, None]
        within = step < self.length
        return self.first + np.where(within, step, 0), within


def sequences(starts: NDArray[np.bool_]) -> Sequences:
    """Rollouts cut at the starts of episodes; `starts` has shape (n_steps, members)."""
    begins = starts.T.copy()
    begins[:, 0] = True
    member, first = np.nonzero(begins)
    ends = np.append(first[1:], 0)
    ends[np.append(member[1:] != member[:-1], True)] = len(starts)
    return Sequences(first, member, ends - first)


def whole(groups: Mapping[str, NDArray[np.float32]]) -> NDArray[np.float32]:
    """Observations of all groups side by side, shape (…, width)."""
    return np.concatenate([groups[name] for name in GROUPS], axis=-1)


def kept(state: State, starts: NDArray[np.bool_]) -> State:
    """The state of members of which some begin an episode, and so remember nothing."""
    if not starts.any():
        return state
    goes_on = torch.from_numpy(~starts).float()[:, None]
    return state[0] * goes_on, state[1] * goes_on


def values_along(
    critic: Network,
    observations: NDArray[np.float32],
    starts: NDArray[np.bool_],
    following: dict[int, NDArray[np.float32]],
    state: State,
) -> tuple[NDArray[np.float32], dict[int, NDArray[np.float32]], State]:
    """Values of whole rollouts, from one start of an episode to the next at a time.

    Args:
        critic: the network, its outputs of shape (steps, members, 1).
        observations: shape (n_steps, members, width).
        starts: where episodes start, shape (n_steps, members).
        following: after a step at which an episode ends, and after the last: what is observed then, before any robot
            is put back to rest, shape (members, width).
        state: of the critic, at the start.

    Returns:
        values, shape (n_steps, members); those of `following`; and the state after the last step.
    """
    values, ahead, begin = [], dict[int, NDArray[np.float32]](), 0
    with torch.no_grad():
        for end in sorted(following):
            part = torch.from_numpy(observations[begin : end + 1])
            value, state = critic(part, kept(state, starts[begin]))
            values.append(value[..., 0].numpy())
            ahead[end] = critic(torch.from_numpy(following[end])[None], state)[0][0, :, 0].numpy()
            begin = end + 1
    return np.concatenate(values), ahead, state


class Minibatch(NamedTuple):
    """Whole sequences, filled up to equal length: each part has shape (longest, n_sequences, …)."""

    actor: Tensor  # what the actor observes
    critic: Tensor
    actions: Tensor
    log_probs: Tensor  # of the actions, under the policy that took them
    advantages: Tensor
    returns: Tensor
    within: Tensor  # 1, or 0 for what is filling
    actor_state: State  # at the first step
    critic_state: State

    def part(self, chosen: Tensor) -> "Minibatch":
        """Some of the sequences, as long as the longest of them."""
        longest = int((self.within[:, chosen] > 0).sum(0).max())
        steps = [part[:longest].index_select(1, chosen) for part in self[:7]]
        states = [(hidden.index_select(1, chosen), cell.index_select(1, chosen)) for hidden, cell in self[7:]]
        return Minibatch(*steps, *states)


def padded(buffer: DictRolloutBuffer, columns: tuple[Tensor, Tensor], states: tuple[State, State]) -> Minibatch:
    """All sequences of a rollout, given what actor and critic observe, and their states before its first step."""
    starts = buffer.episode_starts > 0
    cut = sequences(starts)
    steps, within = cut.padded()

    def along(array: NDArray[Any]) -> Tensor:
        return torch.from_numpy(array[steps, cut.member])

    begins = starts[cut.first, cut.member]
    actor_state, critic_state = (kept((hidden[:, cut.member], cell[:, cut.member]), begins) for hidden, cell in states)
    observations = along(whole(buffer.observations))
    return Minibatch(
        actor=observations[..., columns[0]],
        critic=observations[..., columns[1]],
        actions=along(buffer.actions),
        log_probs=along(buffer.log_probs),
        advantages=along(buffer.advantages),
        returns=along(buffer.returns),
        within=torch.from_numpy(within.astype(np.float32)),
        actor_state=actor_state,
        critic_state=critic_state,
    )


def minibatches(batch: Minibatch, count: int) -> Iterator[Minibatch]:
    """Its sequences in random order, in at most `count` minibatches, none empty."""
    order = torch.from_numpy(np.random.permutation(batch.within.shape[1]))
    for chosen in order.tensor_split(min(count, len(order))):
        yield batch.part(chosen)
