"""The Gymnasium environment: one robot in the evaluator itself, so that an episode's return is the evaluator's J."""

import warnings
from collections.abc import Mapping, Sequence
from typing import Any, ClassVar

import gymnasium
import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from snakebench.channel import Channel, parts_of, perturbed_robot
from snakebench.errors import InvalidValue
from snakebench.fluid import Medium
from snakebench.learning.control_step import ControlStep, action_space, observation_space, random_fluid
from snakebench.observation import Senses, of_one
from snakebench.perturbation import checked_ranges, drawn
from snakebench.physics.kinematics import link_poses
from snakebench.physics.record import Record
from snakebench.predictor import Shown, shown
from snakebench.reward import PUBLISHED_PRICE, WEIGHTS, check_price, preferred
from snakebench.robot import Robot
from snakebench.scenario import Scenario, scenario_of
from snakebench.simulation import Swim, check_scenario

_MOST_STEPS = 900  # of an episode that `gymnasium.make` gives: the default duration
_CUT = (
    f"the episode ended after {_MOST_STEPS} steps, before its duration: that is the limit of gymnasium.make;"
    " give it max_episode_steps=-1 as well as the duration"
)
_NOT_RUNNING = "no episode is running: call reset first"
# Of the picture, which NumPy draws, with no window and no other library.
_SIZE = 240, 480  # rows and columns; even numbers, as video formats want them
_ROOM = 1.6  # width of the image, in lengths of the robot
_MESH = 0.25  # distance between the lines that stay in place [m]
_WATER, _LINE = np.array([222, 238, 245]), np.array([190, 214, 226])
_BODY, _HEAD = np.array([38, 70, 83]), np.array([231, 111, 81])


class SwimEnv(gymnasium.Env[Shown, NDArray[np.float32]]):
    """A robot that swims in an unknown fluid; `gymnasium.make("snakebench.envs:snakebench/Swim-v0")`.

    The reward of a step is r_n times the control step, so that rewards add up to the return J; with a `price` of power
    `snakebench.reward.preferred` takes the place of r_n. An episode ends as truncated after `duration`, and as
    terminated when the robot diverges, which costs the termination penalty.
    `info` has `return`, J so far at the published weights, equal to the evaluator's for the same actions to the last
    bit; `viscosity` at the head [m^2/s]; `speed` since the start [m/s]; and over the last step `velocity` [m/s] and
    `power` [W], as the reward counts them.

    `gymnasium.make` ends episodes after 900 steps, the default duration: for a longer `duration`, give it
    `max_episode_steps=-1` as well.

    Args:
        fluid: a fluid or a field that varies along time or x, or a name; None draws a fluid for each episode.
        robot: the paper's by default.
        engine: "pybullet", the shared evaluator, or "planar".
        physics_rate: steps per second [Hz]; the engine's own by default.
        control_rate: actions per second [Hz].
        duration: length of an episode [s].
        price: of power, observed and charged [1/W]; None for the published reward.
        feels: what is observed, as one array: names of groups or of quantities; None for a dict of all groups.
        perturbations: ranges of perturbations of the robot by name, drawn for each episode (`sb.Perturbations`).
        render_mode: "rgb_array" to see the robot from above by `render`; None for no picture.

    Raises:
        InvalidValue: for an invalid setting.

    Example:
        >>> env = gymnasium.make("snakebench.envs:snakebench/Swim-v0", engine="planar", render_mode="rgb_array")
        >>> observation, info = env.reset(seed=0)
        >>> env.render().shape
        (240, 480, 3)
    """

    metadata: dict[str, Any] = {"render_modes": ["rgb_array"], "render_fps": 30}  # noqa: RUF012  # as Gymnasium has it

    def __init__(
        self,
        fluid: Medium | str | None = None,
        robot: Robot | None = None,
        engine: str = "pybullet",
        physics_rate: int | None = None,
        control_rate: int = 30,
        duration: float = 30.0,
        price: float | None = None,
        feels: Sequence[str] | None = None,
        perturbations: Mapping[str, tuple[float, float]] | None = None,
        render_mode: str | None = None,
    ) -> None:
        if render_mode not in (None, *self.metadata["render_modes"]):
            raise InvalidValue(f"render_mode = {render_mode!r}: allowed are None and 'rgb_array'")
        settings = {"robot": robot, "engine": engine, "control_rate": control_rate, "duration": duration}
        self._scenario = scenario_of(None, None, fluid=fluid, **settings, physics_rate=physics_rate)
        check_scenario(self._scenario, "angle")
        n_joints = self._scenario.robot.n_joints
        self.observation_space = observation_space(feels, n_joints)
        self.action_space = action_space(n_joints)
        self.render_mode, self.metadata = render_mode, self.metadata | {"render_fps": control_rate}
        self._random, self._priced, self._feels = fluid is None, price is not None, feels
        self._price = np.array([PUBLISHED_PRICE if price is None else check_price(price)])
        self._control_step = ControlStep(self._scenario.robot, control_rate)
        self._measured = Senses(self._scenario.robot)
        self._ranges = checked_ranges(perturbations or {})
        self._swim: Swim | None = None
        self._channel: Channel | None = None

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Shown, dict[str, Any]]:
        """Begin an episode at rest; `options={"fluid": …}` puts it into that fluid, field or name.

        Raises:
            InvalidValue: for an unknown option or fluid.
        """
        super().reset(seed=seed)
        changes = dict(options or {})
        if changes.keys() - {"fluid"}:
            raise InvalidValue(f"options {sorted(changes)}: only fluid is one")
        if self._random and not changes:
            changes["fluid"] = random_fluid(self.np_random)
        self.close()
        self._swim = swim = self._begin(self._scenario.but(**changes))
        self._control_step.begin(of_one(swim.now))
        self._rewards: list[float] = []
        self._start = float(swim.now.center[0])
        return self._observe(swim), self._info(swim, 0.0, 0.0)

    def step(self, action: NDArray[np.float32]) -> tuple[Shown, float, bool, bool, dict[str, Any]]:
        """Hold target angles [rad], clipped to [-1, 1], for a control step.

        Raises:
            InvalidValue: before the first `reset`, after the end of an episode, and for actions that do not fit.
        """
        swim = self._swim
        if swim is None or swim.over:
            raise InvalidValue(_NOT_RUNNING)
        target = np.clip(np.asarray(action, np.float64), -1.0, 1.0)
        self._hold(swim, target)
        published, velocity, power = self._control_step.step(target[None], of_one(swim.now))
        if not swim.alive:  # what a robot did before it diverged in this control step does not count
            published, velocity, power = (np.zeros_like(part) for part in (published, velocity, power))
        self._rewards += published.tolist()
        priced = preferred(published, velocity, power, self._price) if self._priced else published
        reward = (float(priced[0]) + _penalty(swim)) / self._scenario.control_rate
        info = self._info(swim, float(velocity[0]), float(power[0]))
        return self._observe(swim), reward, not swim.alive, swim.over and swim.alive, info

    def render(self) -> NDArray[np.uint8] | None:
        """The robot from above in red, green and blue, shape (240, 480, 3); None without a render mode.

        Raises:
            InvalidValue: before the first `reset`.
        """
        if self.render_mode is None:
            return None
        if self._swim is None:
            raise InvalidValue(_NOT_RUNNING)
        return _picture(self._scenario.robot, self._swim.now)

    def close(self) -> None:
        """Free the engine."""
        if self._swim is not None:
            self._swim.__exit__()
            if self._swim.steps == _MOST_STEPS * self._parts and not self._swim.over:
                warnings.warn(_CUT, stacklevel=2)
            self._swim = None

    def _begin(self, scenario: Scenario) -> Swim:
        """A run; if there are ranges to draw perturbations from, on a perturbed robot behind a channel."""
        self._channel, self._parts = None, 1
        if not self._ranges:
            return Swim(scenario)
        p = drawn(self._ranges, self.np_random)
        here, rate = perturbed_robot(scenario, p), scenario.control_rate
        self._parts = parts_of(here, p)
        self._channel = Channel([p], here.robot.n_joints, rate, self._parts, np.random.default_rng(p.seed))
        swim = Swim(here.but(control_rate=rate * self._parts))
        self._channel.measure(of_one(swim.now))
        return swim

    def _hold(self, swim: Swim, target: NDArray[np.float64]) -> None:
        """Hold target angles [rad] for a control step, as late as they come."""
        if self._channel is None:
            swim.hold(target)
            return
        if target.shape != self.action_space.shape:
            raise InvalidValue(f"an action of shape {target.shape}: {self.action_space.shape} is needed")
        for part in self._channel.delayed(target[None])[:, 0]:
            if swim.alive:
                swim.hold(part)
        self._channel.measure(of_one(swim.now))

    def _observe(self, swim: Swim) -> Shown:
        seen = of_one(swim.now)
        senses: Senses = self._control_step
        if self._channel:
            seen, senses = self._channel.seen(seen), self._measured
            senses.act(self._control_step.state()["action"], seen)
            if not swim.steps:
                senses.rest()
        whole = senses.observation(seen, np.array([swim.viscosity]), self._price)
        return shown(whole[0], self._feels, self._scenario.robot.n_joints)

    def _info(self, swim: Swim, velocity: float, power: float) -> dict[str, Any]:
        rate = self._scenario.control_rate
        return {
            "return": float(sum(self._rewards, _penalty(swim)) / rate),
            "viscosity": swim.viscosity,
            "speed": (float(swim.now.center[0]) - self._start) * swim.scenario.control_rate / max(swim.steps, 1),
            "velocity": velocity,
            "power": power,
        }


def _penalty(swim: Swim) -> float:
    return 0.0 if swim.alive else WEIGHTS.termination


def _picture(robot: Robot, now: Record) -> NDArray[np.uint8]:
    """The robot from above, in the middle, +x to the right: red, green and blue, shape (240, 480, 3)."""
    rows, columns = _SIZE
    pixel = _ROOM * float(robot.link_lengths.sum()) / columns  # [m]
    x = now.center[0] + (np.arange(columns) - columns / 2 + 0.5) * pixel
    y = now.center[1] - (np.arange(rows)[:, None] - rows / 2 + 0.5) * pixel
    lines = (np.mod(x, _MESH) < pixel) | (np.mod(y, _MESH) < pixel)
    image = np.where(lines[..., None], _LINE, _WATER)
    links = link_poses(robot.link_lengths, np.array([now.head]), np.array([now.joint_angle]))[0]
    gaps = []  # of each link: how far points lie from its axis [m]
    for (link_x, link_y, _, cos, sin), length in zip(links, robot.lengths, strict=True):
        along, across = (x - link_x) * cos + (y - link_y) * sin, (y - link_y) * cos - (x - link_x) * sin
        gaps.append(np.hypot(np.maximum(np.abs(along) - length / 2, 0.0), across))
    for gap, colour in ((np.min(gaps, axis=0), _BODY), (gaps[0], _HEAD)):
        covered = np.clip(0.5 + (robot.diameter / 2 - gap) / pixel, 0.0, 1.0)[..., None]
        image = (1 - covered) * image + covered * colour
    return image.astype(np.uint8)


class MOSwimEnv(SwimEnv):
    """`SwimEnv` with a vector for a reward, as MO-Gymnasium has it.

    It is `gymnasium.make("snakebench.envs:snakebench/MO-Swim-v0")`, or the same with `mo_gymnasium.make`.
    The reward of a step is (v, -P) times the control step, v and P as in the published reward: the sum over an episode
    is the distance made good along x [m] and, negative, the command work done [J]. For weights w the scalar reward
    w[0] v - w[1] P is their dot product; with `PUBLISHED`, (10, 0.005), and with `info["remaining"]`, the other terms
    of the published reward, added, it is the reward of `SwimEnv`. A robot that diverges gets no (v, -P) for that step:
    it pays the termination penalty in v, at the published weight: -33 m at 30 actions per second.

    Args:
        **settings: as `SwimEnv`, but no price: weights are the learner's own.

    Attributes:
        reward_space: of the vectors, unbounded.
        reward_dim: 2.

    Raises:
        InvalidValue: for an invalid setting.
    """

    PUBLISHED: ClassVar[tuple[float, float]] = (WEIGHTS.propulsion, PUBLISHED_PRICE)  # [s/m], [1/W]

    def __init__(self, **settings: Any) -> None:
        if "price" in settings:
            raise InvalidValue("price: a vector reward has none, its weights are the learner's own")
        super().__init__(**settings)
        self.reward_space = spaces.Box(-np.inf, np.inf, (2,), np.float64)
        self.reward_dim = 2

    def step(  # type: ignore[override]  # a vector in place of a number
        self, action: NDArray[np.float32]
    ) -> tuple[Shown, NDArray[np.float64], bool, bool, dict[str, Any]]:
        """As `SwimEnv.step`, with a reward of shape (2,)."""
        observation, reward, terminated, truncated, info = super().step(action)
        rates = (info["velocity"], -info["power"])
        if terminated:
            rates = (WEIGHTS.termination / WEIGHTS.propulsion, 0.0)
        vector = np.array(rates) * (1 / self._scenario.control_rate)
        return observation, vector, terminated, truncated, info | {"remaining": reward - self.PUBLISHED @ vector}


# As text, so that a specification can be written as JSON.
gymnasium.register(
    id="snakebench/Swim-v0", entry_point="snakebench.learning.environment:SwimEnv", max_episode_steps=_MOST_STEPS
)
gymnasium.register(  # the checker wants scalar rewards
    id="snakebench/MO-Swim-v0",
    entry_point="snakebench.learning.environment:MOSwimEnv",
    max_episode_steps=_MOST_STEPS,
    disable_env_checker=True,
)
