"""The engines for a `Specimen`: another force law, a dead joint, sensors that are off, another first pose.

Their compiled code is that of the engines.

The force law depends on factors of its coefficients only through the fluid's viscosity and density, the links' diameter
and the multiples of the normal drag, which are numbers of an engine's record, apart from those of the body's inertia.
With k_F, k_V and k_N the factors of C_F, of C_mu and C_nu, and of C_D,

    diameter and viscosity times (k_V / k_F)^2,   density times k_F^3 / k_V^2,   multiples times k_N / k_F

scale every drag by its own factor at equal Reynolds numbers. The added mass, 1 % of the displaced mass, is not free: it
changes by k_V^2 / k_F. (All of it ours.)
"""

from collections.abc import Sequence
from types import SimpleNamespace
from typing import Any

import numpy as np

from snakebench.controllers import Controller
from snakebench.engines import Simulation, commands_of
from snakebench.engines.planar import PlanarSimulation
from snakebench.errors import InvalidValue
from snakebench.perturbation import Specimen
from snakebench.physics.joints import Drives
from snakebench.sources import code_digest
from snakebench.value import FloatArray, digest

_CODE = code_digest("engines.perturbed")


def scale_drag(body: Any, drag: Sequence[float], n_links: int) -> None:
    """Scale the drag of a robot in its medium, in an engine's record, by factors in the order of `Specimen.drag`."""
    pressure, viscous, normal, head, tail = drag
    wider = (viscous / pressure) ** 2
    body["diameter"] *= wider
    body["viscosity"] *= wider
    body["density"] *= pressure / wider
    body["drag_multiple"][:n_links] *= normal / pressure
    body["drag_multiple"][0] *= head
    body["drag_multiple"][n_links - 1] *= tail


class _Offset:
    """A gait that commands target angles, as servos whose sensors are off by `offset` [rad] follow it."""

    drives: Drives = "angle"

    def __init__(self, gait: Controller, offset: FloatArray) -> None:
        self._gait, self._offset = gait, offset

    def commands(self, times: FloatArray, n_joints: int) -> FloatArray:
        """True target angles [rad]."""
        return self._gait.commands(times, n_joints) - self._offset

    def digest(self) -> str:
        """A hash of everything that determines the commands."""
        return digest([self._gait.digest(), self._offset.tolist()])


class _Perturbed(Simulation):
    """A simulation of a robot whose angle sensors may be off, and of which one servo may exert no torque.

    A gait of torques commands none there. A servo with a PD law is asked, at each physics step, for the angle at which
    it exerts none. Within a step it then acts as an inertia of half a step times K_d and a damper of half a step times
    K_p would.
    """

    _robot: Specimen

    def __init__(self, robot: Specimen, medium: Any, drives: Drives, physics_rate: int, n_steps: int) -> None:
        _check(robot)
        super().__init__(robot, medium, drives, physics_rate, n_steps)  # type: ignore[call-arg, arg-type]

    def _hold(self, commands: FloatArray) -> bool:
        if self._robot.offset and self._drives == "angle":
            commands = commands - np.array(self._robot.offset)
        return self._step_by_step(commands) if self._robot.dead_joint else super()._hold(commands)  # type: ignore[safe-super]

    def _follow(self, controller: Controller, n_steps: int) -> bool:
        if self._robot.offset and self._drives == "angle":
            controller = _Offset(controller, np.array(self._robot.offset))
        if not self._robot.dead_joint:
            return super()._follow(controller, n_steps)  # type: ignore[safe-super]
        times = (np.arange(n_steps) + 0.5) / self._rate
        return self._step_by_step(commands_of(controller, times, self._robot.n_joints))

    def _step_by_step(self, commands: FloatArray) -> bool:
        j = self._robot.dead_joint - 1
        for row in np.array(commands):
            row[j] = limp_target(self._robot, self.now.joint_angle[j], self.now.joint_rate[j], self._drives)
            if not super()._hold(row[None]):  # type: ignore[safe-super]
                break
        return self._alive


def _check(robot: object) -> None:
    if not isinstance(robot, Specimen):
        raise InvalidValue("engine: engines of perturbed robots need a scenario from sb.perturbed, which chooses them")


def limp_target(robot: Any, angle: Any, rate: Any, drives: str = "angle") -> Any:
    """The command at which a joint's servo exerts no torque, at an angle [rad] and a rate [rad/s]."""
    return 0.0 if drives == "torque" else angle + robot.derivative_gain / robot.proportional_gain * rate


class _Planar(_Perturbed, PlanarSimulation):
    def __init__(self, robot: Specimen, medium: Any, drives: Any, physics_rate: int, n_steps: int) -> None:
        super().__init__(robot, medium, drives, physics_rate, n_steps)
        if robot.pose:
            self._batch.restart([0], joint_angles=np.array([robot.pose]))
            self._rows[:1] = self._batch.rows[0]
        scale_drag(self._batch._members["chain"][0], robot.drag, robot.n_links)


def variant(base: Any) -> Any:
    """The engine of specimens that is made of one for robots, a module."""

    def inputs(robot: Specimen, medium: Any, drives: Any, physics_rate: int) -> bytes:
        _check(robot)
        further = repr((robot.dead_joint, robot.drag, robot.pose, robot.offset)).encode()
        return bytes(base.inputs(robot, medium, drives, physics_rate) + further)

    return SimpleNamespace(
        VERSION=f"{base.VERSION}, perturbed, code {_CODE}",
        open_simulation=_Planar if base.__name__.endswith("planar") else _bullet(),
        inputs=inputs,
        stable_rate=base.stable_rate,
    )


def _bullet() -> type[Simulation]:
    from snakebench.engines import bullet
    from snakebench.physics.swimmer import begin

    pybullet = vars(bullet)["pybullet"]

    class _Bullet(_Perturbed, bullet.BulletSimulation):
        def __init__(self, robot: Specimen, medium: Any, drives: Any, physics_rate: int, n_steps: int) -> None:
            super().__init__(robot, medium, drives, physics_rate, n_steps)
            scale_drag(self._swimmer[0], robot.drag, robot.n_links)
            for j, angle in enumerate(robot.pose):
                pybullet.resetJointState(self._snake, j, angle, physicsClientId=self._client)
                self._swimmer["pose"][0, 4 + j] = angle
            begin(self._swimmer, self._rows)

    return _Bullet
