"""A policy's network in PyTorch, for what NumPy does not do: gradients, and many robots at once."""

from collections.abc import Callable, Iterable
from itertools import pairwise
from typing import Self

import torch
from torch import Tensor, nn

from snakebench.observation import columns
from snakebench.policy import Card, Policy

State = tuple[Tensor, Tensor]  # hidden and cell states, each of shape (layers, members, units)
# The gradients of an LSTM are computed in bfloat16 where the processor has it: some three times as fast.
_BFLOAT16 = bool(torch.cpu.get_capabilities().get("avx512_bf16") or torch.cpu.get_capabilities().get("amx_bf16"))


def outputs(
    layers: Callable[[Tensor], Tensor], memory: nn.Module | None, head: nn.Module, observed: Tensor, state: State
) -> tuple[Tensor, State]:
    """What a network gives over sequences, shape (steps, members, …), and its state after them.

    `memory` may be an LSTM, a layer without memory or nothing.
    """
    x = layers(observed)
    if isinstance(memory, nn.LSTM):
        with torch.autocast("cpu", torch.bfloat16, enabled=_BFLOAT16 and torch.is_grad_enabled()):
            x, state = memory(x, state)
    elif memory is not None:
        x = memory(x)
    return head(x.to(observed.dtype)), state


class Actor(nn.Module):
    """The network that a card describes, with LSTM layers of one size or none; its forward pass is over sequences."""

    def __init__(self, card: Card) -> None:
        super().__init__()
        self.card, chosen = card, columns(card.feels, card.joints)
        self.register_buffer("chosen", torch.as_tensor(chosen), persistent=False)
        sizes = [len(chosen), *card.mlp]
        self.mlp = nn.ModuleList(nn.Linear(one, two) for one, two in pairwise(sizes))
        self.lstm = nn.LSTM(sizes[-1], card.lstm[0], len(card.lstm)) if card.lstm else None
        self.action = nn.Linear(card.lstm[-1] if card.lstm else sizes[-1], card.joints)

    @classmethod
    def of(cls, policy: Policy) -> Self:
        """The network of a policy, with its numbers."""
        numbers = dict[str, Tensor]()
        for name, array in policy.arrays.items():
            tensor = torch.from_numpy(array)
            if not name.startswith("lstm"):
                numbers[name] = tensor
                continue
            _, k, kind = name.split(".")  # a policy has both weights of a layer side by side, and one bias
            width = tensor.shape[-1] - len(tensor) // 4
            parts = (tensor[:, :width], tensor[:, width:]) if kind == "weight" else (tensor, torch.zeros_like(tensor))
            numbers |= {f"lstm.{kind}_ih_l{k}": parts[0], f"lstm.{kind}_hh_l{k}": parts[1]}
        actor = cls(policy.card)
        actor.load_state_dict(numbers)
        return actor

    def policy(self) -> Policy:
        """The policy with these numbers."""
        return as_policy(self.card, self.mlp, self.lstm, self.action)

    def rest(self, members: int) -> State:
        """The state of members that begin an episode."""
        shape = len(self.card.lstm), members, self.card.lstm[0] if self.card.lstm else 0
        return torch.zeros(shape), torch.zeros(shape)

    def forward(self, observations: Tensor, state: State) -> tuple[Tensor, State]:
        """Target angles before they are clipped [rad], and the state, after observations (steps, members, width)."""
        return outputs(self._layers, self.lstm, self.action, observations[..., self.chosen], state)

    def _layers(self, x: Tensor) -> Tensor:
        for layer in self.mlp:
            x = nn.functional.elu(layer(x))
        return x


def as_policy(card: Card, mlp: Iterable[nn.Module], lstm: nn.LSTM | None, action: nn.Linear) -> Policy:
    """The policy with the numbers of these layers, as 16-bit floats: files of half the size. It needs no PyTorch."""
    arrays: dict[str, Tensor] = {"action.weight": action.weight, "action.bias": action.bias}
    for k, layer in enumerate(layer for layer in mlp if isinstance(layer, nn.Linear)):
        arrays |= {f"mlp.{k}.weight": layer.weight, f"mlp.{k}.bias": layer.bias}
    for k in range(len(card.lstm)):
        weights, biases = ([getattr(lstm, f"{kind}_{of}_l{k}") for of in ("ih", "hh")] for kind in ("weight", "bias"))
        arrays |= {f"lstm.{k}.weight": torch.cat(weights, dim=1), f"lstm.{k}.bias": biases[0] + biases[1]}
    return Policy(card, {name: array.detach().half().float().numpy() for name, array in arrays.items()})
