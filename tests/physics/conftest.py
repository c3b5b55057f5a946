"""An independent engine for the physics tests: the same chain in MuJoCo."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

import snakebench as sb


def _mujoco_run(robot: sb.Robot, gait: sb.SinusoidalTorque, duration: float) -> np.ndarray:
    lengths, hinge = robot.lengths, f'stiffness="{robot.joint_stiffness}" damping="{robot.joint_damping}"'
    text = ""
    for i in reversed(range(robot.n_links)):
        place = 0 if i == 0 else -lengths[i - 1]
        moments = f"{robot.axial_inertias[i]} {robot.link_inertias[i]} {robot.link_inertias[i]}"
        joint = "<freejoint/>" if i == 0 else f'<joint type="hinge" axis="0 0 1" {hinge}/>'
        mass = f'<inertial pos="{-lengths[i] / 2} 0 0" mass="{robot.link_masses[i]}" diaginertia="{moments}"/>'
        text = f'<body pos="{place} 0 0">{joint}{mass}{text}</body>'
    model = mujoco.MjModel.from_xml_string(
        f'<mujoco><option timestep="0.0002" gravity="0 0 0" integrator="RK4"/><worldbody>{text}</worldbody></mujoco>'
    )
    data = mujoco.MjData(model)
    for k in range(round(duration * 5000)):
        data.qfrc_applied[6:] = gait.commands(np.array([(k + 0.5) / 5000]), robot.n_joints)[0]  # held over the step
        mujoco.mj_step(model, data)
    return data.qpos[7:].copy()


@pytest.fixture
def mujoco_run():
    """Joint angles at the end of a run without fluid, by Runge-Kutta at 5 kHz: `mujoco_run(robot, gait, duration)`."""
    return _mujoco_run
