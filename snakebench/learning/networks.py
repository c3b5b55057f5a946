"""Actor and critic: each has its own observations, and is an MLP, an LSTM or none, and a linear layer.

These are Stable-Baselines3's own policies; ours are the choice of observations, the order MLP before LSTM (as in the
paper's text), and an LSTM that runs over whole sequences.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import Any

import numpy as np
import torch
from gymnasium import spaces
from sb3_contrib.common.recurrent.policies import RecurrentMultiInputActorCriticPolicy
from stable_baselines3.common.policies import MultiInputActorCriticPolicy
from stable_baselines3.common.torch_layers import BaseFeaturesExtractor
from torch import Tensor, nn

from snakebench.learning.actor import as_policy
from snakebench.learning.settings import Training
from snakebench.observation import GROUPS, columns
from snakebench.policy import Card, Policy

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
    """Makes two feature extractors: the actor's first, then the critic's, each of its own columns."""

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
    """Actor and critic with an LSTM each, which runs over whole sequences: only their first step may begin an episode.

    `ppo.minibatches` gives such sequences, and a rollout gives sequences of one step.
    """

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
