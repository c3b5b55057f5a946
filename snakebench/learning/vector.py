"""Many environments at once on the planar engine, for training: a Stable-Baselines3 `VecEnv`."""

import json
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np
from numpy.typing import NDArray
from stable_baselines3.common.vec_env import VecEnv

from snakebench.engines.planar import Batch
from snakebench.fluid import Medium
from snakebench.learning.control_step import ControlStep, action_space, observation_space, random_fluid
from snakebench.learning.settings import Randomisation, Swimming
from snakebench.observation import Groups, grouped
from snakebench.physics.joints import Drives
from snakebench.physics.stepping import WORK, swim_in_turn
from snakebench.reward import PUBLISHED_PRICE, WEIGHTS, preferred
from snakebench.robot import Robot
from snakebench.value import FloatArray


class SplitBatch(Batch):
    """A batch whose halves swim at the same time; numba's own threads would wait busily beside a learner."""

    def __init__(self, robots: Sequence[Robot], media: Sequence[Medium], drives: Drives, physics_rate: int) -> None:
        self._beside, self._room = ThreadPoolExecutor(1), np.empty((2, 1), WORK)
        super().__init__(robots, media, drives, physics_rate)

    def _swim(self, tables: FloatArray, n_steps: int, rows: FloatArray) -> None:
        def swim(half: slice, room: NDArray[np.void]) -> None:
            places, rates = self._places[half], self._rates[half]
            rate = float(self.physics_rate)
            swim_in_turn(self._members[half], tables[half], rate, n_steps, places, rates, rows[half], room)

        self.rows, middle = rows, len(self) // 2
        other = self._beside.submit(swim, slice(middle), self._room[0])
        swim(slice(middle, None), self._room[1])
        other.result()


class SwimVecEnv(VecEnv):
    """`members` robots in planar, each in a fluid of its own; rewards and observations are those of `SwimEnv`.

    Episodes begin at random ages, so that they do not all end at once. One that ends begins anew at once; `infos` then
    have `terminal_observation`, `TimeLimit.truncated`, and `episode` with its return `r` at the published weights, its
    length `l`, its `viscosity`, `price` of power, `speed` and whether it was `whole`. A curriculum may set the reward's
    weight w_1, `propulsion` [s/m], and the highest price of power that is drawn, `highest_price` [1/W].
    """

    render_mode = None

    def __init__(self, members: int = 64, swimming: Swimming | None = None) -> None:
        swimming = swimming or Swimming()
        self._robot, self._randomisation, scenario = swimming.robot, swimming.randomisation, swimming.scenario()
        n = self._robot.n_joints
        super().__init__(members, observation_space(None, n), action_space(n))
        self.propulsion = WEIGHTS.propulsion
        self.highest_price = self._randomisation.prices[1] if self._randomisation.prices else PUBLISHED_PRICE
        self._rate, self._every = scenario.control_rate, scenario.physics_rate // scenario.control_rate
        self._steps = scenario.n_steps // self._every
        self._rng = np.random.default_rng(0)
        fluids = [random_fluid(self._rng)] * members
        self._batch = SplitBatch([self._robot] * members, fluids, "angle", scenario.physics_rate)
        self._control_step = ControlStep(self._robot, self._rate, members)
        self._viscosity, self._price, self._return, self._start = np.zeros((4, members))
        self._age, self._length = np.zeros((2, members), np.int64)
        self._actions = np.zeros((members, n))

    def seed(self, seed: int | None = None) -> Sequence[int | None]:
        """Choose the random stream from the next `reset` on."""
        self._rng = np.random.default_rng(seed)
        return [seed] * self.num_envs

    def reset(self) -> Groups:
        """Put all robots to rest in new fluids, at random ages."""
        self._begin(np.arange(self.num_envs))
        self._age[:] = self._rng.integers(0, self._steps, self.num_envs)
        return self.observe()

    def step_async(self, actions: NDArray[np.float32]) -> None:
        """Take the target angles [rad], shape (members, n_joints), clipped to [-1, 1]."""
        self._actions = np.clip(actions.astype(np.float64), -1.0, 1.0)

    def step_wait(self) -> tuple[Groups, NDArray[np.float32], NDArray[np.bool_], list[dict[str, Any]]]:
        """Hold them for a control step."""
        now = self._batch.advance(self._actions, self._every)
        reward, velocity, power = self._control_step.step(self._actions, now)
        alive = self._batch.alive
        reward[~alive] = velocity[~alive] = power[~alive] = 0.0
        penalty = np.where(alive, 0.0, WEIGHTS.termination)
        self._return += (reward + penalty) / self._rate
        priced = preferred(reward, velocity, power, self._price) if self._randomisation.prices else reward
        learned = priced + (self.propulsion - WEIGHTS.propulsion) * velocity + penalty
        self._age += 1
        self._length += 1
        done = ~alive | (self._age >= self._steps)
        observation, infos = self.observe(), [dict[str, Any]() for _ in range(self.num_envs)]
        for b in np.flatnonzero(done).tolist():
            last = {name: group[b].copy() for name, group in observation.items()}
            infos[b] = {"terminal_observation": last, "TimeLimit.truncated": bool(alive[b])}
            infos[b]["episode"] = self._episode(b)
        if done.any():
            self._begin(np.flatnonzero(done))
            observation = self.observe()
        return observation, (learned / self._rate).astype(np.float32), done, infos

    def observe(self) -> Groups:
        """The present observation of all members."""
        whole = self._control_step.observation(self._batch.now, self._viscosity, self._price)
        return grouped(whole, self._robot.n_joints)

    @property
    def starts(self) -> NDArray[np.bool_]:
        """Which members are at the start of an episode, shape (members,)."""
        return self._length == 0

    def state(self) -> dict[str, NDArray[Any]]:
        """Copies of all that the future depends on, with the random stream, for `restore`."""
        stream = np.frombuffer(json.dumps(self._rng.bit_generator.state).encode(), np.uint8)
        return {name: array.copy() for name, array in {**self._batch.state(), **self._own(), "stream": stream}.items()}

    def restore(self, state: Mapping[str, NDArray[Any]]) -> None:
        """Continue from what `state` returned."""
        self._batch.restore(state)
        for name, array in self._own().items():
            array[:] = state[name]
        self._rng.bit_generator.state = json.loads(state["stream"].tobytes())

    def _own(self) -> dict[str, NDArray[Any]]:
        counts = {"return": self._return, "start": self._start, "age": self._age, "length": self._length}
        return {**self._control_step.state(), **counts, "viscosity": self._viscosity, "price": self._price}

    def _begin(self, members: NDArray[np.int64]) -> None:
        rng, drawn, count = self._rng, self._randomisation, len(members)
        fluids = [random_fluid(rng, drawn.viscosities) for _ in members]
        robots = [_random_robot(self._robot, drawn, rng) for _ in members] if drawn.mass or drawn.diameter else None
        poses = rng.normal(0.0, drawn.pose, (count, self._robot.n_joints)) if drawn.pose else None
        self._batch.restart(members.tolist(), fluids, robots, poses)
        now = self._batch.now
        self._control_step.begin(now, members.tolist())
        self._viscosity[members] = [fluid.kinematic_viscosity for fluid in fluids]
        self._price[members] = PUBLISHED_PRICE
        if drawn.prices:
            self._price[members] = np.exp(rng.uniform(np.log(drawn.prices[0]), np.log(self.highest_price), count))
        self._start[members], self._return[members] = now.center[members, 0], 0.0
        self._age[members] = self._length[members] = 0

    def _episode(self, b: int) -> dict[str, float]:
        seconds = self._length[b] / self._rate
        return {
            "r": float(self._return[b]),
            "l": int(self._length[b]),
            "viscosity": float(self._viscosity[b]),
            "price": float(self._price[b]),
            "speed": float((self._batch.now.center[b, 0] - self._start[b]) / seconds),
            "whole": bool(self._length[b] == self._steps),
        }

    def close(self) -> None:
        """Nothing to free."""

    def get_attr(self, attr_name: str, indices: Any = None) -> list[Any]:
        """The attribute of the batch, once for each member asked for."""
        return [getattr(self, attr_name)] * len(list(self._get_indices(indices)))

    def set_attr(self, attr_name: str, value: Any, indices: Any = None) -> None:
        """Set an attribute of the batch."""
        del indices
        setattr(self, attr_name, value)

    def env_method(self, method_name: str, *args: Any, indices: Any = None, **settings: Any) -> list[Any]:
        """Members are no objects of their own: none has methods."""
        raise NotImplementedError(f"{method_name}: the members of a batch have no methods")

    def env_is_wrapped(self, wrapper_class: type, indices: Any = None) -> list[bool]:
        """Never."""
        del wrapper_class
        return [False] * len(list(self._get_indices(indices)))


def _random_robot(robot: Robot, drawn: Randomisation, rng: np.random.Generator) -> Robot:
    mass, diameter = 1 + rng.uniform(-1, 1, 2) * [drawn.mass, drawn.diameter]
    return robot.but(
        masses=tuple(float(m * mass) for m in robot.masses),
        cover_mass=float(robot.cover_mass * mass),
        diameter=float(robot.diameter * diameter),
    )
