"""PyBullet's traps, each with a test that fails when it is reopened."""

from __future__ import annotations

import subprocess
import sys

import numpy as np
import pybullet
import pytest

import snakebench as sb
from snakebench.engines import bullet
from snakebench.errors import UnstableRate
from snakebench.physics.kinematics import joint_mobility

WATER = sb.named_fluid("water")
VACUUM = sb.Fluid(kinematic_viscosity=1e-7, density=1e-12)
LOOSE = sb.Robot(joint_stiffness=0.0, joint_damping=0.0)
GAIT = sb.SinusoidalTorque(amplitude=3.5, frequency=0.7, phase=0.84)


def simulation(robot=LOOSE, fluid=VACUUM, drives="torque", rate=480, n_steps=480):
    return bullet.open_simulation(robot, fluid, drives, rate, n_steps)


def test_links_keep_the_inertia_that_the_urdf_gives_them():
    with simulation() as run:
        loaded = [pybullet.getDynamicsInfo(run._snake, link, run._client)[2] for link in range(-1, 7)]
    expected = np.stack([LOOSE.axial_inertias, LOOSE.link_inertias, LOOSE.link_inertias], axis=1)
    assert np.array(loaded) == pytest.approx(expected)


@pytest.mark.parametrize(("velocity", "spin"), [((0.5, 0.0), 0.0), ((0.0, 0.0), 0.5)])
def test_a_coasting_robot_is_not_damped(velocity, spin):
    # Bullet's default damping of 0.04 would leave exp(-0.2) after 5 s.
    with simulation(n_steps=2400) as run:
        pybullet.resetBaseVelocity(run._snake, (*velocity, 0.0), (0.0, 0.0, spin), run._client)
        across = spin * (run.now.center[0] - run.now.head[0])  # the centre of mass goes round the head
        run._swimmer["momentum"][0] = LOOSE.total_mass * np.array([velocity[0], velocity[1] + across])
        run.advance(np.zeros((2400, 7)))
        trajectory = run.trajectory()
    assert trajectory.center_rate[-1, 0] == pytest.approx(velocity[0], abs=1e-6)
    assert trajectory.head_rate[-1, 2] == pytest.approx(spin, abs=1e-6)


def test_joints_are_not_damped_behind_our_back():
    # A joint damping of 0.01 N m s/rad would leave 0.0002 rad/s after 4 s.
    with simulation(n_steps=2400) as run:
        kick = np.zeros((2400, 7))
        kick[0] = [0.3, -0.2, 0.1, 0.2, -0.3, 0.2, 0.1]
        run.advance(kick)
        rate = run.trajectory().joint_rate
    assert np.abs(rate[-480:]).mean() > 0.1 * np.abs(rate[1]).max()


def test_no_motor_swallows_a_torque():
    # One step from rest: the torque acts from its beginning, half a step before the velocity in its middle.
    torque = np.array([0.3, -0.2, 0.1, 0.25, -0.3, 0.2, 0.1])
    with simulation() as run:
        run.advance(torque[None, :])
        moved = run.trajectory().joint_angle[-1]
    assert moved == pytest.approx(joint_mobility(LOOSE, np.zeros(7)) @ torque / 480**2 / 2, rel=1e-9)


def test_a_torque_acts_for_one_step_only():
    torque = np.full(7, 0.1)
    with simulation() as run:
        run.advance(np.vstack([torque, np.zeros((2, 7))]))
        rate = run.trajectory().joint_rate
    assert rate[3] == pytest.approx(rate[1], rel=1e-3)


def test_recorded_links_are_where_bullet_puts_them_after_the_step():
    with simulation(sb.Robot(), WATER, n_steps=960) as run:
        run.advance(GAIT.commands(np.arange(960) / 480, 7))
        trajectory = run.trajectory()
        states = pybullet.getLinkStates(
            run._snake, range(7), computeLinkVelocity=1, computeForwardKinematics=1, physicsClientId=run._client
        )
        head = pybullet.getBaseVelocity(run._snake, run._client)
        joints = pybullet.getJointStates(run._snake, range(7), run._client)
        middle = run._swimmer["d"][0, :10]
    assert trajectory.links[-1, 1:, :2] == pytest.approx(np.array([state[0][:2] for state in states]), abs=1e-9)
    assert middle == pytest.approx([*head[0][:2], head[1][2], *(joint[1] for joint in joints)], abs=1e-9)


def test_the_generalised_load_does_what_a_force_at_each_centre_of_mass_does():
    """The same forces in a second client in the textbook's way: link states, one external force a link, torques."""
    robot, steps = sb.Robot(), 240
    commands = GAIT.commands(np.arange(steps) / 480, 7)
    client = pybullet.connect(pybullet.DIRECT)
    snake = bullet._load(robot, 480, client)
    with simulation(robot, WATER, n_steps=steps) as run:
        for k in range(steps):
            bullet.command(run._swimmer, run._rows, k, commands, k)
            state = run._swimmer[0]
            forces = state["force"][:8] - robot.link_masses[:, None] * state["inertial"][:8]
            torques = (state["old_torque"] + state["new_torque"])[:7] / 2
            links = pybullet.getLinkStates(snake, range(7), computeForwardKinematics=1, physicsClientId=client)
            places = [pybullet.getBasePositionAndOrientation(snake, client)[0], *[link[0] for link in links]]
            for i, (place, force) in enumerate(zip(places, forces, strict=True)):
                pybullet.applyExternalForce(snake, i - 1, (*force, 0.0), place, pybullet.WORLD_FRAME, client)
            pybullet.setJointMotorControlArray(
                snake, range(7), pybullet.TORQUE_CONTROL, forces=torques.tolist(), physicsClientId=client
            )
            pybullet.stepSimulation(client)
            run.advance(commands[k : k + 1])
        ours = run.trajectory().joint_angle[-1]
    theirs = [state[0] for state in pybullet.getJointStates(snake, range(7), client)]
    pybullet.disconnect(client)
    assert np.abs(ours).max() > 0.1
    assert ours == pytest.approx(theirs, abs=1e-9)


def test_joint_speeds_are_not_clamped_but_end_the_run():
    with simulation() as run:
        alive = run.advance(np.tile([5.0, 0, 0, 0, 0, 0, -5.0], (480, 1)))
        trajectory = run.trajectory()
    assert not alive and trajectory.diverged
    assert np.abs(trajectory.joint_rate[-1]).max() > 100.0
    assert len(trajectory.time) < 481


def test_a_diverged_run_is_a_row_without_numbers():
    evaluation = sb.evaluate(sb.SinusoidalTorque(amplitude=1e4, frequency=1.0, phase=0.5))
    assert evaluation.status == "diverged"
    assert evaluation.speed is None and evaluation.power is None and not evaluation.steady


@pytest.mark.parametrize(
    "robot", [sb.Robot(), sb.Robot(joint_stiffness=50.0), sb.Robot.with_joints(4)], ids=["paper", "stiff", "short"]
)
def test_the_stable_rate_separates_swimming_from_divergence(robot):
    # 5 % margin: at the rate a small torque moves the joints a little; a tenth below it they blow up.
    gait = sb.SinusoidalTorque(amplitude=0.5, frequency=0.5, phase=0.7)
    needed = bullet.stable_rate(robot, "torque")
    worst = []
    for rate in (int(needed) + 1, int(0.9 * needed)):
        with simulation(robot, WATER, "torque", rate, 10 * rate) as run:
            run.follow(gait, 10 * rate)
            trajectory = run.trajectory()
        worst.append(np.inf if trajectory.diverged else np.abs(trajectory.joint_rate[-rate:]).max())
    assert worst[0] < 1.0
    assert worst[1] > 3.0


@pytest.mark.parametrize("derivative_gain", [0.3, 3.0, 30.0])
def test_a_servo_is_stable_however_stiff_its_damping_is(derivative_gain):
    robot, gait = sb.Robot(derivative_gain=derivative_gain), sb.SeaSnake(amplitude=0.5, frequency=0.5, phase=0.7)
    fine, coarse = (sb.simulate(gait, robot=robot, physics_rate=rate, duration=5.0) for rate in (1920, 240))
    assert not coarse.diverged
    assert np.abs(coarse.joint_angle[-1] - fine.joint_angle[-1]).max() < 0.01


def test_a_rate_at_which_springs_explode_is_refused():
    robot = sb.Robot(joint_stiffness=100.0)
    with pytest.raises(UnstableRate, match=r"240 Hz is unstable .* at least \d+ Hz is needed, such as \d+"):
        sb.evaluate(GAIT, physics_rate=240, robot=robot)


def test_torque_gaits_may_run_at_240_hz():
    assert sb.evaluate(GAIT, physics_rate=240, duration=5.0).status == "ok"


def test_work_is_exact_for_torques_held_over_a_step():
    # Without fluid, damping and springs, the kinetic energy at the end of a step equals the work done in it.
    torque = np.array([0.3, -0.2, 0.1, 0.25, -0.3, 0.2, 0.1])
    with simulation() as run:
        run.advance(torque[None, :])
        work = run.trajectory().command_work[-1]
    mobility = joint_mobility(LOOSE, np.zeros(7))
    # the torque is held for dt: the rates are W u dt, the energy is u W u dt^2 / 2
    assert work == pytest.approx(torque @ mobility @ torque / 480**2 / 2, rel=1e-5)


def test_clients_are_given_back():
    def connected() -> list[int]:
        return [client for client in range(100) if pybullet.getConnectionInfo(client)["isConnected"]]

    before = connected()
    for _ in range(50):
        with simulation(n_steps=1):
            assert len(connected()) == len(before) + 1
    assert connected() == before


def test_importing_the_engine_prints_nothing():
    answer = subprocess.run([sys.executable, "-c", "import snakebench.engines.bullet"], capture_output=True, check=True)
    assert answer.stdout == b"" and answer.stderr == b""


def test_equal_runs_are_equal_to_the_last_bit():
    one, two = (sb.simulate(GAIT, duration=3.0) for _ in range(2))
    assert np.array_equal(one.center, two.center) and np.array_equal(one.energy, two.energy)
