"""Trained policies: a small recurrent network in NumPy, in a file that holds numbers and a card, never code.

The file is in the safetensors format, with the arrays of `Card.shapes` and the card as JSON in its metadata.
"""

import hashlib
import json
from collections.abc import Mapping
from copy import copy
from pathlib import Path
from typing import Literal, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import Field
from safetensors import SafetensorError
from safetensors.numpy import load, save

from snakebench.errors import InvalidValue
from snakebench.files import write_file
from snakebench.observation import LAYOUT, PREFERENCE, STUDENT, Pilot, columns
from snakebench.physics.joints import Drives
from snakebench.reward import PUBLISHED_PRICE
from snakebench.robot import MAX_LINKS, Robot
from snakebench.value import Count, Positive, Value

Floats = NDArray[np.float32]
Memory = NDArray[np.float32]  # hidden and cell state of each LSTM layer, shape (2, layers, units)


class Card(Value):
    """What a policy is made for, and the sizes of its network (paper, table of hyperparameters, by default)."""

    format: Literal[1] = Field(1, description="of the file")
    joints: Count = Field(7, lt=MAX_LINKS, description="of the robot")
    control_rate: Count = Field(30, description="actions per second [Hz]")
    feels: tuple[str, ...] = Field(STUDENT, min_length=1, description="observed groups, or quantities of them")
    mlp: tuple[Count, ...] = Field((64, 64), description="units of each hidden layer, ELU")
    lstm: tuple[Count, ...] = Field((128, 128), description="units of each LSTM layer; none for no memory")
    layout: tuple[str, ...] = Field(LAYOUT, description="of the whole observation; an older file lacks its end")
    prices: tuple[Positive, Positive] | None = Field(
        None, description="range of the price of power of a preference-conditioned policy [1/W]; none for any other"
    )
    origin: dict[str, str | int | float] = Field(default_factory=dict, description="how it was trained")

    def __hash__(self) -> int:
        return hash(self.model_dump_json())

    def shapes(self) -> dict[str, tuple[int, ...]]:
        """Name and shape of every array.

        `lstm.*` follow the usual gate order input, forget, cell, output; the two biases of a layer are one.
        """
        width, shapes = len(columns(self.feels, self.joints)), dict[str, tuple[int, ...]]()
        for k, units in enumerate(self.mlp):
            shapes |= {f"mlp.{k}.weight": (units, width), f"mlp.{k}.bias": (units,)}
            width = units
        for k, units in enumerate(self.lstm):
            shapes |= {f"lstm.{k}.weight": (4 * units, width + units), f"lstm.{k}.bias": (4 * units,)}
            width = units
        return shapes | {"action.weight": (self.joints, width), "action.bias": (self.joints,)}


class Policy:
    """A trained policy, as a controller in closed loop.

    Args:
        card: what it is made for.
        arrays: its numbers, float32, named and shaped as `card.shapes()` says.

    Raises:
        InvalidValue: when the arrays do not fit the card or are not finite.
    """

    drives: Drives = "angle"
    price: float  # of power, observed as the preference [1/W]

    def __init__(self, card: Card, arrays: Mapping[str, Floats]) -> None:
        expected, given = card.shapes(), {name: array.shape for name, array in arrays.items()}
        for name in sorted(expected.keys() | given.keys()):
            if expected.get(name) != given.get(name):
                raise InvalidValue(f"{name} has shape {given.get(name)}: {expected.get(name)} is needed")
            if arrays[name].dtype != np.float32 or not np.isfinite(arrays[name]).all():
                raise InvalidValue(f"{name} holds numbers that are no finite 32-bit floats")
        self.card, self.arrays = card, {name: np.ascontiguousarray(arrays[name]) for name in expected}
        self.price = card.prices[0] if card.prices else PUBLISHED_PRICE
        self._columns = columns(card.feels, card.joints)

    def at(self, price: float) -> Self:
        """The same policy at another price of power [1/W]; a loaded one is at the lowest price of its range.

        Raises:
            InvalidValue: when the policy is not preference-conditioned, or was not trained at that price.
        """
        if self.card.prices is None:
            raise InvalidValue(f"preference = {price:g}: this policy is not preference-conditioned")
        low, high = self.card.prices
        if not low <= price <= high:
            raise InvalidValue(f"preference = {price:g}: the policy was trained from {low:g} to {high:g} 1/W")
        other = copy(self)
        other.price = price
        return other

    def save(self, path: Path | str) -> None:
        """Write the policy; the same policy is always the same bytes.

        Raises:
            StoreError: when the file cannot be written.
        """
        write_file(path, self.content())

    def content(self) -> bytes:
        """What `save` writes: 16-bit floats if all numbers are such ones, as those of new trainings are."""
        with np.errstate(over="ignore"):
            halves = {name: array.astype(np.float16) for name, array in self.arrays.items()}
        short = all(np.array_equal(halves[name], array) for name, array in self.arrays.items())
        return save(halves if short else self.arrays, {"snakebench": self.card.model_dump_json()})

    @classmethod
    def load(cls, path: Path | str) -> Self:
        """Read what `save` wrote. Nothing in a file is executed.

        Raises:
            InvalidValue: when it is missing, damaged, of another format or another observation layout.
        """
        try:
            content = Path(path).read_bytes()
            read = load(content)
            arrays = {name: x.astype(np.float32) if x.dtype == np.float16 else x for name, x in read.items()}
            header = json.loads(content[8 : 8 + int.from_bytes(content[:8], "little")])
            card = Card(**json.loads(header["__metadata__"]["snakebench"]))
            if card.layout not in (LAYOUT, LAYOUT[: -len(PREFERENCE)]):  # older ones know no preference
                missing = [line for line in card.layout if line not in LAYOUT] or ["another order"]
                raise InvalidValue(f"it observes {', '.join(missing)}: {', '.join(LAYOUT)} is what there is")
            return cls(card, arrays)
        except OSError as error:
            raise InvalidValue(f"cannot read the policy {path}: {error.strerror}") from None
        except InvalidValue as error:
            raise InvalidValue(f"the policy {path} does not fit this version of snakebench: {error}") from None
        except (SafetensorError, ValueError, KeyError, TypeError, AttributeError, RecursionError) as error:
            raise InvalidValue(f"{path} is damaged or no policy of snakebench: {error!r}") from None

    def digest(self) -> str:
        """A hash of everything that determines the actions."""
        made_for = self.card.model_dump_json(exclude={"origin"})
        content = hashlib.sha256(f"{made_for} {self.price}".encode())
        for name, array in self.arrays.items():
            content.update(name.encode() + array.tobytes())
        return content.hexdigest()

    def fresh_memory(self) -> Memory:
        """The memory at the beginning of an episode."""
        layers = self.card.lstm
        return np.zeros((2, len(layers), max(layers, default=0)), np.float32)

    def act(self, observation: Floats, memory: Memory) -> tuple[Floats, Memory]:
        """Target angles [rad], shape (n_joints,), and the memory afterwards.

        Args:
            observation: whole and scaled, as `Senses.observation` gives it, shape (width,).
            memory: as the last call returned it, or fresh.
        """
        x, after = observation[self._columns], np.zeros_like(memory)
        for k in range(len(self.card.mlp)):
            x = self.arrays[f"mlp.{k}.weight"] @ x + self.arrays[f"mlp.{k}.bias"]
            x = np.where(x > 0, x, np.expm1(np.minimum(x, 0)))
        for k, units in enumerate(self.card.lstm):
            inputs = np.concatenate([x, memory[0, k, :units]])
            gates = self.arrays[f"lstm.{k}.weight"] @ inputs + self.arrays[f"lstm.{k}.bias"]
            input_gate, forget_gate, candidate, output_gate = gates.reshape(4, units)
            cell = _sigmoid(forget_gate) * memory[1, k, :units] + _sigmoid(input_gate) * np.tanh(candidate)
            x = _sigmoid(output_gate) * np.tanh(cell)
            after[0, k, :units], after[1, k, :units] = x, cell
        action = self.arrays["action.weight"] @ x + self.arrays["action.bias"]
        return np.clip(action, -1, 1), after

    def begin(self, robot: Robot, control_rate: int) -> Pilot:
        """The policy at the start of a run.

        Raises:
            InvalidValue: when it is made for another number of joints or another control rate.
        """
        made_for = self.card.joints, self.card.control_rate
        return Pilot(made_for, robot, control_rate, self.price, self.act, self.fresh_memory())


def _sigmoid(x: Floats) -> Floats:
    return 0.5 * (1 + np.tanh(0.5 * x))
