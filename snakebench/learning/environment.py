"""The Gymnasium environment: one robot in the evaluator itself, so that an episode's return is the evaluator's J."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from typing import Any, ClassVar

import gymnasium
import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from snakebench.errors import InvalidValue
from snakebench.fluid import Medium
from snakebench.learning.picture import picture
from snakebench.learning.task import Earned, Task, action_space, observation_space, random_fluid
from snakebench.observation import LARGEST, columns, of_one
from snakebench.predictor import Shown, shown
from snakebench.reward import PUBLISHED_PRICE, Weights, check_price, preferred
from snakebench.robot import Robot
from snakebench.scenario import Scenario
from snakebench.simulation import Swim, check_scenario

_MOST_STEPS = 900  # of an episode that `gymnasium.make` gives: the default duration
_CUT = (
    f"the episode ended after {_MOST_STEPS} steps, before its duration: that is the limit of gymnasium.make;"
    " give it max_episode_steps=-1 as well as the duration"
)
_NOTHING = Earned(*np.zeros((3, 1)))  # in a step, before the first


class SwimEnv(gymnasium.Env[Shown, NDArray[np.float32]]):
    """A robot that swims in an unknown fluid; `gymnasium.make("snakebench.envs:snakebench/Swim-v0")`.

    The reward of a step is r_n times the control step, so that rewards add up to the return J; with a `price` of power
    it is what the step is worth at that price (`snakebench.reward.preferred`) times the control step. An episode ends
    as truncated after `duration`, and as terminated when the robot diverges, which costs the termination penalty.
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
        render_mode: str | None = None,
    ) -> None:
        if render_mode not in (None, *self.metadata["render_modes"]):
            raise InvalidValue(f"render_mode = {render_mode!r}: allowed are None and 'rgb_array'")
        self._draws = fluid is None
        self._scenario = Scenario(
            fluid="water" if fluid is None else fluid,
            robot=robot or Robot(),
            engine=engine,
            control_rate=control_rate,
            duration=duration,
            **({} if physics_rate is None else {"physics_rate": physics_rate}),
        )
        check_scenario(self._scenario, "angle")
        robot = self._scenario.robot
        self.observation_space = _felt_space(feels, robot.n_joints)
        self.action_space = action_space(robot.n_joints)
        self._task, self._feels = Task(robot, control_rate), feels
        self._charges = price is not None
        self._price = np.array([PUBLISHED_PRICE if price is None else check_price(price)])
        self.render_mode = render_mode
        self.metadata = self.metadata | {"render_fps": control_rate}
        self._swim: Swim | None = None
        self._rewards: list[float] = []
        self._earned = _NOTHING

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Shown, dict[str, Any]]:
        """Begin an episode at rest; `options={"fluid": …}` puts it into that fluid, field or name.

        Raises:
            InvalidValue: for an unknown option or fluid.
        """
        super().reset(seed=seed)
        asked = dict(options or {})
        if asked.keys() - {"fluid"}:
            raise InvalidValue(f"options {sorted(asked)}: only fluid is one")
        if self._draws and not asked:
            asked["fluid"] = random_fluid(self.np_random)
        self.close()
        self._swim, self._rewards, self._earned = Swim(self._scenario.but(**asked)), [], _NOTHING
        self._task.begin(of_one(self._swim.now))
        self._start = float(self._swim.now.center[0])
        return self._observe(self._swim), self._about(self._swim)

    def step(self, action: NDArray[np.float32]) -> tuple[Shown, float, bool, bool, dict[str, Any]]:
        """Hold target angles [rad], clipped to [-1, 1], for a control step.

        Raises:
            InvalidValue: before the first `reset`, after the end of an episode, and for actions that do not fit.
        """
        swim = self._swim
        if swim is None or swim.over:
            raise InvalidValue("no episode is running: call reset first")
        target = np.clip(np.asarray(action, np.float64), -1.0, 1.0)
        swim.hold(target)
        self._earned = earned = self._task.step(target[None], of_one(swim.now))
        self._rewards += earned.reward.tolist()
        worth = preferred(*earned, self._price) if self._charges else earned.reward
        reward = (float(worth[0]) + self._penalty(swim)) / self._scenario.control_rate
        return self._observe(swim), reward, not swim.alive, swim.over and swim.alive, self._about(swim)

    def render(self) -> NDArray[np.uint8] | None:
        """The robot from above, as `snakebench.learning.picture.picture`; None without a render mode.

        Raises:
            InvalidValue: before the first `reset`.
        """
        if self.render_mode is None:
            return None
        if self._swim is None:
            raise InvalidValue("no episode is running: call reset first")
        return picture(self._scenario.robot, self._swim.now)

    def close(self) -> None:
        """Free the engine."""
        if self._swim is not None:
            self._swim.__exit__()
            if self._swim.steps == _MOST_STEPS and not self._swim.over:
                warnings.warn(_CUT, stacklevel=2)
            self._swim = None

    def _observe(self, swim: Swim) -> Shown:
        whole = self._task.observe(of_one(swim.now), np.array([swim.viscosity]), self._price)
        return shown(whole[0], self._feels, self._scenario.robot.n_joints)

    def _about(self, swim: Swim) -> dict[str, Any]:
        rate = self._scenario.control_rate
        return {
            "return": float(sum(self._rewards, self._penalty(swim)) / rate),
            "viscosity": swim.viscosity,
            "speed": (float(swim.now.center[0]) - self._start) * rate / max(swim.steps, 1),
            "velocity": float(self._earned.velocity[0]),
            "power": float(self._earned.power[0]),
        }

    def _penalty(self, swim: Swim) -> float:
        return 0.0 if swim.alive else Weights().termination


class MOSwimEnv(gymnasium.Env[Shown, NDArray[np.float32]]):
    """`SwimEnv` with a vector for a reward, as MO-Gymnasium has it.

    It is `gymnasium.make("snakebench.envs:snakebench/MO-Swim-v0")`, or the same with `mo_gymnasium.make`.
    The reward of a step is (v, -P) times the control step, v and P as in the published reward: over an episode it adds
    up to the way made good along x [m] and, negative, to the command work done [J]. For weights w the scalar reward
    w[0] v - w[1] P is their dot product; with `PUBLISHED`, (10, 0.005), and `info["remaining"]` added, what the other
    terms of the published reward take, it is the reward of `SwimEnv`. A robot that diverges gets no (v, -P) for that
    step, it pays the termination penalty in v, at the published weight: -33 m at 30 actions per second.

    Args:
        **settings: as `SwimEnv`, but no price: weights are the learner's own.

    Attributes:
        reward_space: of the vectors, unbounded.
        reward_dim: 2.

    Raises:
        InvalidValue: for an invalid setting.
    """

    metadata = SwimEnv.metadata
    PUBLISHED: ClassVar[tuple[float, float]] = (Weights().propulsion, -Weights().work)  # [s/m], [1/W]

    def __init__(self, **settings: Any) -> None:
        if "price" in settings:
            raise InvalidValue("price: a vector reward has none, its weights are the learner's own")
        self._single = SwimEnv(**settings)
        self.render_mode, self.metadata = self._single.render_mode, self._single.metadata
        self._step = 1 / settings.get("control_rate", 30)  # [s]
        self.observation_space, self.action_space = self._single.observation_space, self._single.action_space
        self.reward_space = spaces.Box(-np.inf, np.inf, (2,), np.float64)
        self.reward_dim = 2

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Shown, dict[str, Any]]:
        """As `SwimEnv.reset`."""
        super().reset(seed=seed)
        return self._single.reset(seed=seed, options=options)

    def step(self, action: NDArray[np.float32]) -> tuple[Shown, NDArray[np.float64], bool, bool, dict[str, Any]]:
        """As `SwimEnv.step`, with a reward of shape (2,)."""
        observation, reward, terminated, truncated, info = self._single.step(action)
        rates = (info["velocity"], -info["power"])
        if terminated:
            rates = (Weights().termination / Weights().propulsion, 0.0)
        vector = np.array(rates) * self._step
        return observation, vector, terminated, truncated, info | {"remaining": reward - self.PUBLISHED @ vector}

    def render(self) -> NDArray[np.uint8] | None:
        """As `SwimEnv.render`."""
        return self._single.render()

    def close(self) -> None:
        """Free the engine."""
        self._single.close()


def _felt_space(feels: Sequence[str] | None, n_joints: int) -> spaces.Space[Any]:
    if feels is None:
        return observation_space(n_joints)
    return spaces.Box(-LARGEST, LARGEST, (len(columns(feels, n_joints)),), np.float32)


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
