"""An entry: a controller in a file, or several that it may be set to, and what it uses."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from pathlib import Path

import numpy as np

from snakebench.controllers import gait_of
from snakebench.errors import InvalidValue, UnknownName, missing
from snakebench.files import parsed_object
from snakebench.fluid import PAPERS
from snakebench.gain_schedule import SCHEDULE, WINDOW, GainSchedule, features
from snakebench.observation import columns
from snakebench.policy import Policy
from snakebench.predictor import Predictor
from snakebench.robot import Robot
from snakebench.scoring.result import Information
from snakebench.scoring.tasks import TASKS
from snakebench.simulation import AnyController, ClosedLoop, check_controller
from snakebench.sources import code_digest, package_version
from snakebench.store import file_digest
from snakebench.value import digest

TABLE = "gait-table"  # kind of a file with several gaits
SAFE = (".json", ".safetensors", ".onnx")  # endings of files that execute nothing
_PREFERENCES = 17  # prices at which a preference-conditioned policy is tried, at equal ratios
_LARGEST = 64_000_000  # of a file [bytes]
_MOST_GAITS = 100  # in a table
_MOST_ACTIONS = 120  # of a policy [1/s]
_LONGEST = 60.0  # of a swim [s]
_PHYSICS_RATE = 960  # in the tasks: how often a waveform is looked at [Hz]
_ROUNDING = 1e-6  # of target angles [rad]


@dataclass(frozen=True, kw_only=True)
class Setting:
    """A controller that an entry may be set to, and the one fluid that it is meant for, if it is."""

    controller: AnyController
    label: str = ""
    fluid: str | None = None

    @cached_property
    def wide(self) -> bool:
        """Whether it may leave the targets within ±1 rad that the limit is of: it drives torques, or angles beyond."""
        if isinstance(self.controller, ClosedLoop):  # whose targets are clipped
            return False
        if self.controller.drives == "torque":
            return True
        commands = self.controller.commands(np.arange(0.0, _LONGEST, 1 / _PHYSICS_RATE), Robot().n_joints)
        return bool(np.abs(commands).max() > 1 + _ROUNDING)


@dataclass(frozen=True, kw_only=True)
class Entry:
    """What is scored; `digest` is the file's SHA-256, or of a controller without a file its own."""

    name: str
    digest: str
    information: Information
    control_rate: int
    settings: tuple[Setting, ...]

    def own(self) -> Setting | None:
        """The first setting for all fluids, for tasks in which it is not told the fluid; None if there is none."""
        return next((one for one in self.settings if one.fluid is None), None)

    @property
    def tasks(self) -> tuple[str, ...]:
        """Those that it can swim: without a setting for all fluids, `known` only."""
        return TASKS if self.own() else TASKS[:1]

    def told(self, fluid: str) -> list[Setting]:
        """Its settings in a fluid that it may be told: those meant for it, or else those for all."""
        own = [one for one in self.settings if one.fluid == fluid]
        return own or [one for one in self.settings if one.fluid is None]

    def check(self) -> None:
        """Make sure that all its controllers fit the robot and the rates of the tasks."""
        for one in self.settings:
            if isinstance(one.controller, ClosedLoop):
                one.controller.begin(Robot(), self.control_rate)
                if isinstance(one.controller, GainSchedule):
                    _check_estimator(one.controller)
            else:
                one.controller.commands(np.zeros(1), Robot().n_joints)
        if _MOST_ACTIONS % self.control_rate:
            raise InvalidValue(f"control_rate = {self.control_rate} Hz: a divisor of {_MOST_ACTIONS} Hz is needed")


def _check_estimator(schedule: GainSchedule) -> None:
    """Make sure that the network fits what it is given."""
    sensors = np.zeros((WINDOW, len(columns(["sensors"], Robot().n_joints))), np.float32)
    try:
        schedule.estimator(features(sensors, schedule.gaits[0], 0.0))
    except (ValueError, TypeError, IndexError) as error:
        raise InvalidValue(f"the layers of the gain schedule's estimator do not fit: {error}") from None


def read_entry(path: Path, trust: bool = False) -> Entry:
    """The entry in a file: gaits (.json), a policy (.safetensors, .onnx), or an archive of Stable-Baselines3 (.zip).

    Raises:
        InvalidValue: when it cannot be read or does not fit; for an archive of Stable-Baselines3, which may run code,
            without `trust`.
    """
    if path.suffix not in (*SAFE, ".zip"):
        raise InvalidValue(
            f"{path} is no entry: {', '.join(SAFE)} are allowed, and a trusted .zip of Stable-Baselines3"
        )
    if path.suffix == ".zip" and not trust:
        raise InvalidValue(f"{path} may run code when it is loaded: only --trust, or trust=True, loads it")
    try:
        if path.exists() and not (path.is_file() and path.stat().st_size <= _LARGEST):
            raise InvalidValue(f"{path}: a file of at most {_LARGEST // 10**6} MB is needed")
        content = path.read_bytes()
    except OSError as error:
        raise InvalidValue(f"cannot read {path}: {error.strerror}") from None
    made = {"name": path.stem, "seed": file_digest(content)}
    if path.suffix == ".json":
        return _of_gaits(path, content, **made)
    if path.suffix == ".safetensors":
        return entry_of(Policy.load(path), **made)
    if path.suffix == ".onnx":
        return _of_onnx(path, content, **made)
    return _of_archive(path, **made)


def entry_of(controller: AnyController, name: str = "", seed: str | None = None) -> Entry:
    """A controller as an entry; a preference-conditioned policy can be set to several powers."""
    check_controller(controller)
    information, rate, settings = _information(controller), 30, [Setting(controller=controller)]
    if isinstance(controller, Policy):
        rate = controller.card.control_rate
        if controller.card.prices:
            settings = _settings(controller.at, controller.card.prices)
    elif isinstance(controller, GainSchedule):
        rate = controller.control_rate
        settings = _settings(controller.at, controller.prices)
    elif isinstance(controller, Predictor):
        rate = controller.control_rate
    return _checked(name or type(controller).__name__, seed or controller.digest(), information, rate, settings)


def _checked(name: str, seed: str, information: Information, rate: int, settings: Sequence[Setting]) -> Entry:
    entry = Entry(name=name, digest=seed, information=information, control_rate=rate, settings=tuple(settings))
    entry.check()
    return entry


def _of_gaits(path: Path, content: bytes, name: str, seed: str) -> Entry:
    found = parsed_object(content, path, "gait", "a kind and its fields")
    if found.get("kind") == SCHEDULE:
        return entry_of(GainSchedule(**found), name, seed)
    if found.get("kind") != TABLE:
        return entry_of(gait_of(found), name, seed)
    rows = found.get("gaits")
    if not isinstance(rows, list) or not 0 < len(rows) <= _MOST_GAITS or found.keys() != {"kind", "gaits"}:
        raise InvalidValue(f"{path} is no table of gaits: only a list gaits of 1 to {_MOST_GAITS} rows is needed")
    settings = [_row(path, k, row) for k, row in enumerate(rows)]
    return _checked(name, seed, "open loop", 30, settings)


def _row(path: Path, k: int, row: object) -> Setting:
    """The setting of a row: {"fluid": null or a name, "gait": {…}}."""
    if not isinstance(row, dict) or row.keys() != {"fluid", "gait"} or not isinstance(row["gait"], Mapping):
        raise InvalidValue(f"{path}: gaits.{k}: an object with fluid, a name or null, and gait is needed")
    fluid = row["fluid"] if row["fluid"] is None else str(row["fluid"])
    if fluid not in (None, *PAPERS):
        raise UnknownName.among("fluid", str(fluid), PAPERS)
    return Setting(controller=gait_of(row["gait"]), label=f"gait {k + 1}", fluid=fluid)


def _of_onnx(path: Path, content: bytes, name: str, seed: str) -> Entry:
    try:
        from snakebench.deployment.onnx_policy import OnnxPolicy
    except ModuleNotFoundError as error:
        raise missing(str(path), error.name, "onnx") from None
    card = (model := OnnxPolicy(content, str(path))).card
    made = digest([seed, code_digest("deployment.onnx_policy"), package_version("onnxruntime")])
    made_for = partial(Predictor, model, card.feels, joints=card.joints, control_rate=card.control_rate, name=made)
    settings = [Setting(controller=made_for())]
    if card.prices:
        settings = _settings(lambda price: made_for(price=price), card.prices)
    return _checked(name, seed, _information(settings[0].controller), card.control_rate, settings)


def _of_archive(path: Path, name: str, seed: str) -> Entry:
    try:
        from snakebench.learning.archive import load_archive
    except ModuleNotFoundError as error:
        raise missing(str(path), error.name, "learning") from None
    return entry_of(load_archive(path), name, seed)


def _settings(at: Callable[[float], AnyController], prices: tuple[float, float]) -> list[Setting]:
    """What is `at` each preference of a range."""
    low, high = prices
    tried = np.clip(np.geomspace(low, high, _PREFERENCES), low, high).tolist()
    return [Setting(controller=at(price), label=f"preference {price:.3g} 1/W") for price in tried]


def _information(controller: AnyController) -> Information:
    """What it uses; of a policy in code of which nothing is known, the most."""
    if not isinstance(controller, ClosedLoop):
        return "open loop"
    if isinstance(controller, GainSchedule):
        return "sensors"
    if isinstance(controller, Policy):
        feels: Sequence[str] | None = controller.card.feels
    else:
        feels = controller.feels if isinstance(controller, Predictor) else None
    joints = Robot().n_joints
    seen = columns(feels, joints) if feels else columns(["privileged"], joints)
    return "privileged" if set(seen) & set(columns(["privileged"], joints)) else "sensors"
