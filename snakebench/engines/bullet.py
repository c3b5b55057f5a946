"""The shared evaluator: PyBullet integrates the body, one compiled call per step supplies every force on it."""

import contextlib
import ctypes
import math
import os
import struct
import sys
import tempfile
from collections.abc import Iterator, Sequence
from operator import itemgetter
from pathlib import Path
from threading import Lock

import numpy as np

from snakebench.controllers import Controller, WaveformGait
from snakebench.engines import Simulation, commands_of
from snakebench.errors import InvalidValue
from snakebench.fluid import Medium
from snakebench.physics.joints import Drives
from snakebench.physics.kinematics import joint_mobility
from snakebench.physics.swimmer import begin, command, react, swimmer_at_rest
from snakebench.physics.waveform import HELD
from snakebench.robot import Robot
from snakebench.sources import code_digest, package_version
from snakebench.value import FloatArray

_C = ctypes.CDLL(None if os.name == "posix" else "ucrtbase")
_SILENCING = Lock()  # two threads would each restore what the other one has put in place


@contextlib.contextmanager
def _silence() -> Iterator[None]:
    """Drop what native code prints: Bullet tells when it was built, and warns of robots. Steps print nothing."""
    with _SILENCING, contextlib.ExitStack() as restored:
        _C.fflush(None)  # what was printed before, in the buffers of C
        nothing = os.open(os.devnull, os.O_WRONLY)
        restored.callback(os.close, nothing)
        for stream in (1, 2):
            with contextlib.suppress(OSError):  # it is closed: there is nothing to silence
                kept = os.dup(stream)
                restored.callback(os.close, kept)
                restored.callback(os.dup2, kept, stream)
                os.dup2(nothing, stream)
        restored.callback(_C.fflush, None)
        yield


@contextlib.contextmanager
def _file(text: str) -> Iterator[str]:
    """The name of a file with this text; on Linux it is in memory only, so that nothing is left of a killed process."""
    if hasattr(os, "memfd_create"):
        with os.fdopen(os.memfd_create("snake"), "w") as file:
            file.write(text)
            file.flush()
            yield f"/proc/self/fd/{file.fileno()}"
        return
    with tempfile.TemporaryDirectory(prefix="snakebench-") as directory:
        path = Path(directory) / "snake.urdf"
        path.write_text(text)
        yield str(path)


try:
    with _silence():
        import pybullet
except ModuleNotFoundError:
    distribution = "pybullet" if sys.version_info < (3, 12) else "pybullet-arm64"
    raise InvalidValue(
        f"engine = pybullet: PyBullet is not installed: pip install {distribution}, or take engine = planar"
    ) from None

VERSION = f"pybullet {package_version('pybullet')}, code {code_digest('engines.bullet')}"
_JOINT_RATE_MAX = 1e6  # [rad/s]; Bullet's own default, 100, would clamp silently


class BulletSimulation(Simulation):
    """One robot in PyBullet, in a client of its own: planar, weightless, without contact, damping or motors."""

    engine = "pybullet"

    def __init__(self, robot: Robot, medium: Medium, drives: Drives, physics_rate: int, n_steps: int) -> None:
        super().__init__(robot, drives, physics_rate, n_steps)
        self._swimmer = swimmer_at_rest(robot, medium, drives, 1 / physics_rate)
        self._rows[0, 0] = self._swimmer["pose"][0, 0]
        begin(self._swimmer, self._rows)
        self._client = pybullet.connect(pybullet.DIRECT)
        try:
            self._snake = _load(robot, physics_rate, self._client)
        except BaseException:
            self.__exit__()
            raise

    def __exit__(self, *_: object) -> None:
        with _silence():
            pybullet.disconnect(self._client)

    def _hold(self, commands: FloatArray) -> bool:
        return self._advance(np.ascontiguousarray(commands, np.float64), len(commands), late=0)

    def _follow(self, controller: Controller, n_steps: int) -> bool:
        commands = commands_of(controller, np.arange(n_steps + 1) / self._rate, self._robot.n_joints)
        held = isinstance(controller, WaveformGait) and controller.waveform(self._robot.n_joints).kind == HELD
        return self._advance(commands[:-1], n_steps, late=0) if held else self._advance(commands, n_steps, late=1)

    def _advance(self, commands: FloatArray, n_steps: int, late: int) -> bool:
        """Make steps, of which step i begins with row i of `commands` and ends with row i + `late`."""
        if not self._alive or n_steps == 0:
            return self._alive
        n, k, client, snake = self._robot.n_joints, self._step, self._client, self._snake
        swimmer, rows = self._swimmer, self._rows
        pose, calls = memoryview(swimmer["pose"][0]), memoryview(swimmer["calls"][0])
        joints, angle_of = tuple(range(n)), itemgetter(0)
        write, read = struct.Struct(f"{n + 4}d").pack_into, struct.Struct(f"{n + 5}d").unpack_from
        command(swimmer, rows, k, commands, 0)
        for i in range(n_steps):
            _step(snake, client, joints, read(calls))
            (x, y, _), (_, _, z, w) = pybullet.getBasePositionAndOrientation(snake, client)
            write(pose, 0, x, y, z, w, *map(angle_of, pybullet.getJointStates(snake, joints, client)))
            k += 1
            if not react(swimmer, rows, k, commands, i, late):
                self._alive = False
                break
        self._step = k
        return self._alive

    def replay(self, loads: Sequence[Sequence[float]]) -> None:
        """Make the calls of `advance` with given loads and nothing else: no fluid, no control, no record.

        It is the least that steps can cost; benchmarks compare with it. `loads` says what a load is.
        """
        client, snake, joints = self._client, self._snake, tuple(range(self._robot.n_joints))
        for load in loads:
            _step(snake, client, joints, load)
            pybullet.getBasePositionAndOrientation(snake, client)
            pybullet.getJointStates(snake, joints, client)

    def loads(self, commands: FloatArray) -> list[list[float]]:
        """What Bullet is given at each step of `commands`, shape (n_steps, n_joints).

        Force x, y on the head [N], the place x, y where it acts [m], a moment on the head and the joint torques [N m].
        """
        given = []
        for i in range(len(commands)):
            command(self._swimmer, self._rows, self._step, commands, i)
            given.append(self._swimmer["calls"][0, : self._robot.n_joints + 5].tolist())
            self.advance(commands[i : i + 1])
        return given


def _step(snake: int, client: int, joints: Sequence[int], load: Sequence[float]) -> None:
    """Make a step under a load: force x, y on the head, the place x, y where it acts, a moment, the joints' torques."""
    force_x, force_y, x, y, moment, *torques = load
    pybullet.applyExternalForce(snake, -1, (force_x, force_y, 0.0), (x, y, 0.0), pybullet.WORLD_FRAME, client)
    if moment:
        pybullet.applyExternalTorque(snake, -1, (0.0, 0.0, moment), pybullet.WORLD_FRAME, client)
    pybullet.setJointMotorControlArray(snake, joints, pybullet.TORQUE_CONTROL, forces=torques, physicsClientId=client)
    pybullet.stepSimulation(client)


open_simulation = BulletSimulation


def inputs(robot: Robot, medium: Medium, drives: Drives, physics_rate: int) -> bytes:
    """All numbers that a run is computed from, beside the commands."""
    return swimmer_at_rest(robot, medium, drives, 1 / physics_rate).tobytes() + robot.urdf().encode()


def stable_rate(robot: Robot, drives: Drives) -> float:
    """The lowest physics rate [Hz] at which Bullet integrates the joints' law stably.

    Damping is solved for; stiffness k enters explicitly: in a mode of inverse inertia mu the leapfrog is stable while
    sqrt(k mu) dt < 2 (ours). The straight chain has the largest mu. Gaits of torque, which have next to no damping,
    blow up between 0.95 and 1 times that rate (measured); the rate returned lies 5 % above it.
    """
    mu = np.linalg.eigvalsh(joint_mobility(robot, np.zeros(robot.n_joints)))[-1]
    return float(1.05 * math.sqrt(robot.stiffness(drives) * mu) / 2)


def _load(robot: Robot, physics_rate: int, client: int) -> int:
    """Put the robot into a fresh world, straight, at rest, heading +x, its head's tip at the origin."""
    try:
        with _silence(), _file(robot.urdf()) as name:  # each client remembers files by their names
            snake = pybullet.loadURDF(
                name,
                basePosition=(-robot.lengths[0] / 2, 0.0, 0.0),
                flags=pybullet.URDF_USE_INERTIA_FROM_FILE,  # without it, links without a shape get no inertia
                physicsClientId=client,
            )
    except pybullet.error as error:
        raise InvalidValue(f"PyBullet cannot load the robot: {error}") from None
    pybullet.setTimeStep(1 / physics_rate, physicsClientId=client)
    pybullet.setGravity(0.0, 0.0, 0.0, physicsClientId=client)
    for link in range(-1, robot.n_joints):  # Bullet's defaults are 0.04
        undamped = {"linearDamping": 0.0, "angularDamping": 0.0, "jointDamping": 0.0}
        pybullet.changeDynamics(snake, link, **undamped, maxJointVelocity=_JOINT_RATE_MAX, physicsClientId=client)
    idle = [0.0] * robot.n_joints  # the default velocity motors would swallow torque
    pybullet.setJointMotorControlArray(
        snake, range(robot.n_joints), pybullet.VELOCITY_CONTROL, forces=idle, physicsClientId=client
    )
    return snake
