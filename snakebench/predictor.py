"""Policies of other libraries: a model that predicts as Stable-Baselines3's do is a controller."""

import hashlib
from collections.abc import Mapping, Sequence
from typing import Any

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


class Predictor:
    """A model that predicts actions, as a controller in closed loop.

    Its observations are those of the environments, to the last bit; it acts deterministically. The model is not copied:
    after further training it is another controller, with another digest.

    Args:
        model: with `predict(observation, state=..., episode_start=..., deterministic=True)`, as models of
            Stable-Baselines3 have it: from what `shown` returns, the state of the last step (None at first) and whether
            the step is the first, shape (1,), to target angles [rad], shape (n_joints,), and the next state.
        feels: as of the environment it was trained in: names of groups or of quantities, None for a dict of groups.
        joints: of the robot it was trained for.
        control_rate: actions per second that it was trained for [Hz].
        price: of power, observed as the preference [1/W].
        name: of the model in the digest, needed if it has no readable parameters; it must change with the model.

    Raises:
        InvalidValue: for an unknown name or a bad price; when the model was trained on observations of another width;
            when it has neither parameters (`state_dict`, its own or of its `policy`) nor a name.
    """

    drives: Drives = "angle"

    def __init__(
        self,
        model: Any,
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
        width = None if feels is None else len(columns(feels, joints))
        trained = getattr(getattr(model, "observation_space", None), "shape", None)
        if width is not None and trained and (width,) != tuple(trained):
            raise InvalidValue(f"feels = {list(feels or ())}: {width} numbers, the model observes {trained[0]}")
        if name is None and _parameters(model) is None:
            raise InvalidValue("name = None: the model has no state_dict to identify it by, a name is needed")

    def begin(self, robot: Robot, control_rate: int) -> Pilot:
        """The model at the start of a run.

        Raises:
            InvalidValue: when it was trained for another number of joints or another control rate; in the run, when it
                returns another number of angles, or one that is not finite.
        """
        return Pilot((self.joints, self.control_rate), robot, control_rate, self.price, self._act, (None, True))

    def _act(self, observation: NDArray[np.float32], memory: tuple[Any, bool]) -> tuple[FloatArray, tuple[Any, bool]]:
        """Target angles [rad]; the memory is the model's state and whether the step is the run's first."""
        seen, (state, first) = shown(observation, self.feels, self.joints), memory
        answer = self.model.predict(seen, state=state, episode_start=np.array([first]), deterministic=True)
        if not isinstance(answer, tuple) or len(answer) != 2:
            raise InvalidValue("the model's predict returned no pair: the action and the state are needed")
        target = np.clip(np.asarray(answer[0], np.float64), -1.0, 1.0)
        if target.shape != (self.joints,):
            raise InvalidValue(f"the model returned angles of shape {target.shape}: ({self.joints},) is needed")
        if not np.isfinite(target).all():
            raise InvalidValue(f"the model returned the angles {target.tolist()}: finite ones are needed")
        return target, (answer[1], False)

    def digest(self) -> str:
        """A hash of the model's parameters, of its layers as PyTorch prints them, and of all other arguments.

        The code of the model's class enters by the class's name only: give a `name` that changes with that code, or
        with settings that are no parameters.
        """
        kind = type(self.model)
        made = (self.feels, self.joints, self.control_rate, self.price, self.name, kind.__module__, kind.__qualname__)
        content = hashlib.sha256(f"{_CODE} {made!r}".encode())
        if (parameters := _parameters(self.model)) is not None:
            content.update(repr(getattr(self.model, "policy", self.model)).encode())  # activations have no parameters
            for name, array in parameters.items():
                content.update(f"{name} {array.dtype} {array.shape}".encode() + array.tobytes())
        return content.hexdigest()


def shown(whole: NDArray[np.float32], feels: Sequence[str] | None, n_joints: int) -> Shown:
    """The part of a whole observation, shape (width,), that `feels` names; a dict of groups if it is None."""
    return grouped(whole, n_joints) if feels is None else whole[columns(feels, n_joints)]


def _parameters(model: Any) -> dict[str, NDArray[Any]] | None:
    """The model's numbers by name; None when it has no `state_dict`, or one that holds something else."""
    state = getattr(getattr(model, "policy", model), "state_dict", None)
    parameters = state() if callable(state) else None
    if not isinstance(parameters, Mapping) or not parameters:
        return None
    arrays = {
        str(name): np.asarray(part.detach().cpu() if hasattr(part, "detach") else part)
        for name, part in parameters.items()
    }
    return None if any(array.dtype.hasobject for array in arrays.values()) else arrays
