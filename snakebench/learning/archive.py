"""Models that Stable-Baselines3 or sb3-contrib saved, as controllers; loading such an archive may run code in it."""

from pathlib import Path
from zipfile import BadZipFile

from gymnasium.spaces import Dict
from stable_baselines3.common.save_util import load_from_zip_file

from snakebench.errors import InvalidValue
from snakebench.observation import columns
from snakebench.predictor import Predictor

_FEELS = (("sensors",), ("sensors", "preference"), ("sensors", "privileged"), ("sensors", "privileged", "preference"))


def load_archive(path: Path) -> Predictor:
    """The policy of an archive; what it observes is known by its width: sensors, and privileged or preference after it.

    Raises:
        InvalidValue: when it is no such archive, or observes something else.
    """
    try:
        data, parameters, _ = load_from_zip_file(path, device="cpu")
        space, settings = data["observation_space"], data["policy_kwargs"]
        kind = data["policy_class"]
        policy = kind(space, data["action_space"], lambda _: 0.0, **settings)
        policy.load_state_dict(parameters["policy"])
    except (OSError, BadZipFile, KeyError, TypeError, ValueError, AttributeError, RuntimeError) as error:
        raise InvalidValue(f"{path} is no policy of Stable-Baselines3: {error!r}") from None
    policy.set_training_mode(False)
    if isinstance(space, Dict):
        return Predictor(policy, None)
    feels = next((names for names in _FEELS if space.shape == (len(columns(names, 7)),)), None)
    if feels is None:
        widths = ", ".join(f"{len(columns(names, 7))} for {' and '.join(names)}" for names in _FEELS)
        raise InvalidValue(f"{path} observes {space.shape} numbers: {widths} are known; use sb.Predictor for others")
    return Predictor(policy, feels)
