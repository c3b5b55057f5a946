"""The Gymnasium environment: one robot in the evaluator itself, so that an episode's return is the evaluator's J."""

from __future__ import annotations

from typing import Any, ClassVar

import gymnasium
import numpy as np
from numpy.typing import NDArray

from snakebench.engines import PHYSICS_RATES
from snakebench.errors import InvalidValue
from snakebench.evaluation import Scenario, Swim, check_rate
from snakebench.fluid import Medium
from snakebench.learning.task import Observation, Task, action_space, observation_space, random_fluid
from snakebench.observation import of_one
from snakebench.reward import PUBLISHED_PRICE, Weights, check_price, preferred
from snakebench.robot import Robot


class SwimEnv(gymnasium.Env[Observation, NDArray[np.float32]]):
    """A robot that swims in an unknown fluid; `gymnasium.make("snakebench/Swim-v0")` once this module is imported.

    The reward of a step is r_n times the control step, so that rewards add up to the return J; with a `price` of power
    it is what the step is worth at that price (`snakebench.reward.preferred`) times the control step. An episode ends
    as truncated after `duration`, and as terminated when the robot diverges, which costs the termination penalty.
    `info` has `return`, J so far at the published weights, equal to the evaluator's for the same actions to the last
    bit; `viscosity` at the head [m^2/s]; and `speed` since the start [m/s].

    Args:
        fluid: a fluid or a field that varies along time or x, or a name; None draws a fluid for each episode.
        robot: the paper's by default.
        engine: "pybullet", the shared evaluator, or "planar".
        physics_rate: steps per second [Hz]; the engine's own by default.
        control_rate: actions per second [Hz].
        duration: length of an episode [s].
        price: of power, observed and charged [1/W]; None for the published reward.

    Raises:
        InvalidValue: for an invalid setting.
    """

    metadata: ClassVar[dict[str, Any]] = {"render_modes": []}

    def __init__(
        self,
        fluid: Medium | str | None = None,
        robot: Robot | None = None,
        engine: str = "pybullet",
        physics_rate: int | None = None,
        control_rate: int = 30,
        duration: float = 30.0,
        price: float | None = None,
    ) -> None:
        self._draws, self._scenario = (
            fluid is None,
            Scenario(
                fluid="water" if fluid is None else fluid,
                robot=robot or Robot(),
                engine=engine,
                physics_rate=PHYSICS_RATES.get(engine, 480) if physics_rate is None else physics_rate,
                control_rate=control_rate,
                duration=duration,
            ),
        )
        check_rate(self._scenario, "angle")
        robot = self._scenario.robot
        self.observation_space, self.action_space = observation_space(robot.n_joints), action_space(robot.n_joints)
        self._task = Task(robot, control_rate)
        self._charges = price is not None
        self._price = np.array([PUBLISHED_PRICE if price is None else check_price(price)])
        self._swim: Swim | None = None
        self._rewards: list[float] = []

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
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
        self._swim, self._rewards = Swim(self._scenario.but(**asked)), []
        self._task.begin(of_one(self._swim.now))
        self._start = float(self._swim.now.center[0])
        return self._observe(self._swim), self._about(self._swim)

    def step(self, action: NDArray[np.float32]) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        """Hold target angles [rad], clipped to [-1, 1], for a control step.

        Raises:
            InvalidValue: before the first `reset`, after the end of an episode, and for actions that do not fit.
        """
        swim = self._swim
        if swim is None or swim.over:
            raise InvalidValue("no episode is running: call reset first")
        target = np.clip(np.asarray(action, np.float64), -1.0, 1.0)
        swim.hold(target)
        earned = self._task.step(target[None], of_one(swim.now))
        self._rewards += earned.reward.tolist()
        worth = preferred(*earned, self._price) if self._charges else earned.reward
        reward = (float(worth[0]) + self._penalty(swim)) / self._scenario.control_rate
        return self._observe(swim), reward, not swim.alive, swim.over and swim.alive, self._about(swim)

    def close(self) -> None:
        """Free the engine."""
        if self._swim is not None:
            self._swim.__exit__()
            self._swim = None

    def _observe(self, swim: Swim) -> Observation:
        groups = self._task.observe(of_one(swim.now), np.array([swim.viscosity]), self._price)
        return {name: group[0] for name, group in groups.items()}

    def _about(self, swim: Swim) -> dict[str, Any]:
        rate = self._scenario.control_rate
        return {
            "return": float(sum(self._rewards, self._penalty(swim)) / rate),
            "viscosity": swim.viscosity,
            "speed": (float(swim.now.center[0]) - self._start) * rate / max(swim.steps, 1),
        }

    def _penalty(self, swim: Swim) -> float:
        return 0.0 if swim.alive else Weights().termination


gymnasium.register(id="snakebench/Swim-v0", entry_point=SwimEnv)
