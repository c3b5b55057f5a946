"""Actor and critic: each chooses what it observes, and both are an MLP, an LSTM or none, and a linear layer.

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
from snakebench.observation import GROUPS, columns
from snakebench.policy import Card, Policy

# Gradients of an LSTM are found in bfloat16 where the processor computes in it: some three times as fast.
_HALVES = bool(torch.cpu.get_capabilities().get("avx512_bf16") or torch.cpu.get_capabilities().get("amx_bf16"))


class Features(BaseFeaturesExtractor):
    """The named groups or quantities of a dict observation, through an MLP with ELU."""

    def __init__(self, observation_space: spaces.Dict, feels: Sequence[str], mlp: Sequence[int]) -> None:
        n_joints = _joints(observation_space)
        chosen = columns(feels, n_joints)
        super().__init__(observation_space, mlp[-1] if mlp else len(chosen))
        self.chosen = torch.as_tensor(chosen)
        sizes = pairwise([len(chosen), *mlp])
        self.layers = nn.Sequential(*(part for one, two in sizes for part in (nn.Linear(one, two), nn.ELU())))

    def forward(self, observations: dict[str, Tensor]) -> Tensor:
        """Features of each member, shape (members, features_dim)."""
        whole = torch.cat([observations[name] for name in GROUPS], dim=1)
        return self.layers(whole[:, self.chosen])


class _Choosing:
    """Makes the actor's features first, the critic's second, each of its own observations."""

    observation_space: spaces.Dict
    features_extractor_class: type[Features]
    features_extractor_kwargs: dict[str, Any]

    def __init__(self, *args: Any, actor: Sequence[str], critic: Sequence[str], **settings: Any) -> None:
        self._feels = [tuple(actor), tuple(critic)]
        super().__init__(*args, **settings)

    def make_features_extractor(self) -> Features:
        """The features of the one whose turn it is."""
        return self.features_extractor_class(
            self.observation_space, feels=self._feels.pop(0), **self.features_extractor_kwargs
        )


class MemorylessPolicy(_Choosing, MultiInputActorCriticPolicy):
    """Actor and critic that see only the present."""


class RecurrentPolicy(_Choosing, RecurrentMultiInputActorCriticPolicy):
    """Actor and critic with an LSTM each, which runs over whole sequences: they may begin an episode, not contain one.

    `ppo.SequenceBuffer` gives such sequences, and a rollout gives sequences of one step.
    """

    @staticmethod
    def _process_sequence(
        features: Tensor, lstm_states: tuple[Tensor, Tensor], episode_starts: Tensor, lstm: nn.LSTM
    ) -> tuple[Tensor, tuple[Tensor, Tensor]]:
        n = lstm_states[0].shape[1]
        goes_on = (1.0 - episode_starts.reshape(n, -1)[:, 0]).reshape(1, n, 1)
        sequences = features.reshape(n, -1, lstm.input_size).swapaxes(0, 1)
        with torch.autocast("cpu", torch.bfloat16, enabled=_HALVES and torch.is_grad_enabled()):
            output, (hidden, cell) = lstm(sequences, (lstm_states[0] * goes_on, lstm_states[1] * goes_on))
        return output.float().transpose(0, 1).flatten(0, 1), (hidden, cell)


def policy_settings(card: Card, critic: Sequence[str], first_spread: float) -> tuple[type[Any], dict[str, Any]]:
    """The class of an actor as `card` describes it beside a critic that feels `critic`, and its arguments.

    Args:
        card: of the actor; the critic's network has the same sizes.
        critic: groups or quantities.
        first_spread: standard deviation of the actions before training [rad].

    Raises:
        InvalidValue: when LSTM layers have different sizes.
    """
    settings = {
        "actor": card.feels,
        "critic": tuple(critic),
        "net_arch": [],
        "activation_fn": nn.ELU,
        "log_std_init": float(np.log(first_spread)),
        "features_extractor_class": Features,
        "features_extractor_kwargs": {"mlp": card.mlp},
        "share_features_extractor": False,
        "optimizer_kwargs": {"eps": 1e-5, "fused": True},
    }
    if not card.lstm:
        return MemorylessPolicy, settings
    return RecurrentPolicy, settings | {"lstm_hidden_size": card.lstm[0], "n_lstm_layers": len(card.lstm)}


def exported(network: MemorylessPolicy | RecurrentPolicy, card: Card) -> Policy:
    """The actor's mean as a policy that needs no PyTorch."""
    lstm = network.lstm_actor if card.lstm else None
    return as_policy(card, network.pi_features_extractor.layers, lstm, network.action_net)


def _joints(observation_space: spaces.Dict) -> int:
    """How many joints a robot with these sensors has: four numbers each, and three of the head."""
    (width,) = observation_space["sensors"].shape or (0,)
    return (width - 3) // 4
