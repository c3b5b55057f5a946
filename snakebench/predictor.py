"""Policies of other libraries: what predicts as Stable-Baselines3's models do swims and is judged as any policy."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from snakebench.errors import InvalidValue
from snakebench.observation import Groups, Pilot, columns, grouped
from snakebench.physics.joints import Drives
from snakebench.reward import PUBLISHED_PRICE, check_price
from snakebench.robot import Robot
from snakebench.sources import code_digest
from snakebench.value import FloatArray

_CODE = code_digest("predictor")
Shown = Groups | NDArray[np.float32]


class Predicts(Protocol):
    """What Stable-Baselines3's models do, and wrappers around those of other libraries easily."""

    def predict(
        self, observation: Any, state: Any = None, episode_start: Any = None, deterministic: bool = False
    ) -> tuple[Any, Any]:
        """Target angles [rad], shape (n_joints,), and the state for the next step.

        Args:
            observation: of one robot, as `shown` gives it: an array of shape (width,), or a dict of such.
            state: as returned for the last step; None at the start of an episode.
            episode_start: whether this is its first step, shape (1,), bool.
            deterministic: always true here.
        """


class Predictor:
    """A model that predicts actions, as a controller in closed loop.

    It observes what the environments show, to the last bit, and acts deterministically. The model is used as it is when
    the robot swims: one that has learned on since is another controller, with another digest.

    Args:
        model: anything with `predict`.
        feels: as the environment it was trained in: names of groups or of quantities side by side, None for the dict.
        joints: of the robot it was trained for.
        control_rate: actions per second that it was trained for [Hz].
        price: of power, observed as the preference [1/W].
        name: what stands for the model in the digest if it has no parameters to be read; it must change with the model.

    Raises:
        InvalidValue: for an unknown name or a bad price; when the model was trained on observations of another width;
            when it has neither parameters (`state_dict`, its own or of its `policy`) nor a name.
    """

    drives: Drives = "angle"

    def __init__(
        self,
        model: Predicts,
        feels: Sequence[str] | None = None,
        *,
        joints: int = 7,
        control_rate: int = 30,
        price: float = PUBLISHED_PRICE,
        name: str | None = None,
    ) -> None:
        if not callable(getattr(model, "predict", None)):
            raise InvalidValue(f"model = {model!r}: it has no predict")
        self.model, self.feels = model, None if feels is None else tuple(feels)
        self.joints, self.control_rate, self.price, self.name = joints, control_rate, check_price(price), name
        given = self.feels and (len(columns(self.feels, joints)),)
        needed = getattr(getattr(model, "observation_space", None), "shape", None)
        if given and needed and given != tuple(needed):
            raise InvalidValue(f"feels = {list(self.feels or ())}: {given[0]} numbers, the model observes {needed[0]}")
        if name is None and _parameters(model) is None:
            raise InvalidValue("name = None: the model has no state_dict to tell it by, a name is needed")

    def begin(self, robot: Robot, control_rate: int) -> Pilot:
        """The model at the start of a run.

        Raises:
            InvalidValue: when it was trained for another number of joints or another control rate; in the run, when it
                tells another number of angles.
        """
        state: Any = None

        def act(observation: NDArray[np.float32], first: bool) -> FloatArray:
            nonlocal state
            seen = shown(observation, self.feels, self.joints)
            told = self.model.predict(seen, state=state, episode_start=np.array([first]), deterministic=True)
            if not isinstance(told, tuple) or len(told) != 2:
                raise InvalidValue("the model's predict returned no pair: the action and the state are needed")
            action, state = told
            target = np.clip(np.asarray(action, np.float64), -1.0, 1.0)
            if target.shape != (self.joints,):
                raise InvalidValue(f"the model told angles of shape {target.shape}: ({self.joints},) is needed")
            return target

        return Pilot((self.joints, self.control_rate), robot, control_rate, self.price, act)

    def digest(self) -> str:
        """A hash of the bytes of the model's parameters, of its layers as PyTorch prints them, and of all else given.

        What a class of models does with its parameters is known by the class's name alone: give a `name` that changes
        with its code, or with settings that no parameter shows.
        """
        kind = type(self.model)
        about = (self.feels, self.joints, self.control_rate, self.price, self.name, kind.__module__, kind.__qualname__)
        content = hashlib.sha256(f"{_CODE} {about!r}".encode())
        if (parameters := _parameters(self.model)) is not None:
            content.update(repr(getattr(self.model, "policy", self.model)).encode())  # activations have no parameters
            for name, array in parameters.items():
                content.update(f"{name} {array.dtype} {array.shape}".encode() + array.tobytes())
        return content.hexdigest()


def shown(whole: NDArray[np.float32], feels: Sequence[str] | None, n_joints: int) -> Shown:
    """What an environment shows of a whole observation, shape (width,): a dict of groups, or what is felt side by side.

    Raises:
        UnknownName: when a name is neither a group nor a quantity.
    """
    return grouped(whole, n_joints) if feels is None else whole[columns(feels, n_joints)]


def _parameters(model: Any) -> dict[str, NDArray[Any]] | None:
    """The model's numbers by name; None for a model that does not show them, or not as numbers."""
    state = getattr(getattr(model, "policy", model), "state_dict", None)
    found = state() if callable(state) else None
    if not isinstance(found, Mapping) or not found:
        return None
    arrays = {str(name): _as_array(part) for name, part in found.items()}
    return None if any(array.dtype.hasobject for array in arrays.values()) else arrays


def _as_array(part: Any) -> NDArray[Any]:
    return np.asarray(part.detach().cpu() if hasattr(part, "detach") else part)
