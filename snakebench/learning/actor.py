"""A policy's network in PyTorch, for what NumPy does not do: gradients, many robots at once, and export."""

from __future__ import annotations

import io
import logging
import warnings
from collections.abc import Iterable, Mapping
from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from snakebench.files import write_file
from snakebench.observation import GROUPS, columns, group_width
from snakebench.policy import Card, Policy

State = tuple[Tensor, Tensor]  # hidden and cell states, each of shape (layers, members, units)


class Actor(nn.Module):
    """The network that a card describes; its forward pass is over sequences.

    Args:
        card: with LSTM layers of one size, or none.
    """

    def __init__(self, card: Card) -> None:
        super().__init__()
        self.card = card
        chosen = columns(card.feels, card.joints)
        self.register_buffer("chosen", torch.as_tensor(chosen), persistent=False)
        sizes = [len(chosen), *card.mlp]
        self.mlp = nn.ModuleList(nn.Linear(one, two) for one, two in zip(sizes, card.mlp, strict=False))
        self.lstm = nn.LSTM(sizes[-1], card.lstm[0], len(card.lstm)) if card.lstm else None
        self.action = nn.Linear(card.lstm[-1] if card.lstm else sizes[-1], card.joints)

    @classmethod
    def of(cls, policy: Policy) -> Actor:
        """The network of a policy, with its numbers."""
        actor = cls(policy.card)
        with torch.no_grad():
            for name, array in policy.arrays.items():
                actor._place(name, torch.from_numpy(array))
        return actor

    def policy(self) -> Policy:
        """The policy that these numbers are."""
        return as_policy(self.card, self.mlp, self.lstm, self.action)

    def rest(self, members: int) -> State:
        """The state of members that begin an episode."""
        shape = len(self.card.lstm), members, self.card.lstm[0] if self.card.lstm else 0
        return torch.zeros(shape), torch.zeros(shape)

    def forward(self, observations: Tensor, state: State) -> tuple[Tensor, State]:
        """Target angles before they are clipped [rad], and the state afterwards.

        Args:
            observations: whole and scaled, shape (steps, members, width).
            state: before the first step.
        """
        x = observations[..., self.chosen]
        for layer in self.mlp:
            x = nn.functional.elu(layer(x))
        if self.lstm is not None:
            x, state = self.lstm(x, state)
        return self.action(x), state

    def _place(self, name: str, array: Tensor) -> None:
        layer, kind = name.rsplit(".", 1)
        if not layer.startswith("lstm"):
            self.get_parameter(name).copy_(array)
        elif kind == "weight":
            for weight, part in zip(
                (weights := _lstm_layer(self.lstm, int(layer[5:]))[0]),
                array.split([weight.shape[1] for weight in weights], dim=1),
                strict=True,
            ):
                weight.copy_(part)
        else:
            bias, other = _lstm_layer(self.lstm, int(layer[5:]))[1]
            bias.copy_(array)
            other.zero_()


class _Step(nn.Module):
    """One control step of one robot, its state in the open: what runs on the robot's computer."""

    def __init__(self, policy: Policy) -> None:
        super().__init__()
        self.actor = Actor.of(policy)

    def forward(self, observation: Tensor, *state: Tensor) -> tuple[Tensor, ...]:
        action, after = self.actor(observation[None, None], tuple(part[:, None] for part in state))
        return action[0, 0].clamp(-1.0, 1.0), *(part[:, 0] for part in after)


def as_policy(card: Card, mlp: Iterable[nn.Module], lstm: nn.LSTM | None, action: nn.Linear) -> Policy:
    """The policy that the numbers of these layers are; it needs no PyTorch."""
    linear = [layer for layer in mlp if isinstance(layer, nn.Linear)]
    arrays: dict[str, Tensor] = {"action.weight": action.weight, "action.bias": action.bias}
    for k, layer in enumerate(linear):
        arrays |= {f"mlp.{k}.weight": layer.weight, f"mlp.{k}.bias": layer.bias}
    for k in range(len(card.lstm)):
        weights, biases = _lstm_layer(lstm, k)
        arrays |= {f"lstm.{k}.weight": torch.cat(weights, dim=1), f"lstm.{k}.bias": biases[0] + biases[1]}
    return Policy(card, {name: array.detach().numpy().copy() for name, array in arrays.items()})


def _lstm_layer(lstm: nn.LSTM | None, k: int) -> tuple[list[Tensor], list[Tensor]]:
    """Weights of inputs and of the remembered, and the two biases, of an LSTM layer."""
    weights = [getattr(lstm, f"weight_{of}_l{k}") for of in ("ih", "hh")]
    return weights, [getattr(lstm, f"bias_{of}_l{k}") for of in ("ih", "hh")]


def export_onnx(policy: Policy, path: Path) -> None:
    """Write a policy as an ONNX model of one control step.

    It maps `observation`, whole and scaled, shape (width,), to `action`, target angles [rad]. With a memory, it has the
    LSTM's `hidden` and `cell` state as further inputs, each of shape (layers, units), zeros at first, and `next_hidden`
    and `next_cell` as further outputs.

    Raises:
        StoreError: when the file cannot be written.
    """
    model = io.BytesIO()
    step = _Step(policy).eval()
    state = [part[:, 0] for part in step.actor.rest(1)] if policy.card.lstm else []
    names = ["hidden", "cell"][: len(state)]
    observation = torch.zeros(sum(group_width(group, policy.card.joints) for group in GROUPS))
    logging.getLogger("torch.onnx").setLevel(logging.ERROR)  # it tells of packages that nobody here needs
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of its own workings
        torch.onnx.export(
            step,
            (observation, *state),
            model,
            input_names=["observation", *names],
            output_names=["action", *(f"next_{name}" for name in names)],
            dynamo=True,
            verbose=False,
        )
    write_file(path, model.getvalue())


def as_whole(observation: Mapping[str, NDArray[np.float32]]) -> Tensor:
    """The groups of a dict observation side by side, shape (members, width)."""
    return torch.from_numpy(np.hstack(list(observation.values())))
