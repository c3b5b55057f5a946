"""Claims about nature that hold whatever the numbers: symmetry, momentum, energy, and an independent engine."""

from __future__ import annotations

import numpy as np
import pytest

import snakebench as sb
from snakebench.accuracy import energy_gap, stored_energy
from snakebench.engines import bullet, load_engine
from snakebench.errors import InvalidValue
from snakebench.physics import swimmer as swimmer_module
from snakebench.physics.hydrodynamics import added_mass
from snakebench.physics.joints import torque_under
from snakebench.physics.kinematics import link_rates, place_links

VACUUM = sb.Fluid(kinematic_viscosity=1e-7, density=1e-12)
LOOSE = sb.Robot(joint_stiffness=0.0, joint_damping=0.0)


def carried_energy(trajectory: sb.Trajectory, density: float) -> np.ndarray:
    """Kinetic energy of the added mass [J], shape (n_times,)."""
    robot, links = trajectory.robot, trajectory.links
    moving = np.ascontiguousarray(trajectory.head_rate), np.ascontiguousarray(trajectory.joint_rate)
    rates = link_rates(robot.link_lengths, links, *moving)
    v_n = rates[..., 1] * links[..., 3] - rates[..., 0] * links[..., 4]
    return 0.5 * v_n**2 @ np.array([added_mass(density, length, robot.diameter) for length in robot.lengths])


def run_of(commands, *, robot=None, fluid=None, rate=480, drives="torque"):
    robot = robot or sb.Robot()
    with bullet.open_simulation(robot, fluid or sb.named_fluid("water"), drives, rate, len(commands)) as simulation:
        simulation.advance(commands)
        return simulation.trajectory()


def test_the_mirror_image_swims_mirrored_at_equal_speed():
    commands = sb.SinusoidalTorque(amplitude=3.5, frequency=0.70, phase=0.84).commands(np.arange(7200) / 480, 7)
    left, right = run_of(commands), run_of(-commands)
    assert right.center[:, 0] == pytest.approx(left.center[:, 0], abs=1e-6)
    assert right.center[:, 1] == pytest.approx(-left.center[:, 1], abs=1e-6)
    assert right.joint_angle == pytest.approx(-left.joint_angle, abs=1e-6)


@pytest.mark.parametrize("turned", [0.5, 2.0, -3.0])
def test_turning_the_world_turns_the_force(turned):
    rng = np.random.default_rng(3)
    robot, q, dq = sb.Robot(), rng.uniform(-0.6, 0.6, 7), rng.normal(size=7)
    head, rate = np.array([0.3, -0.2, 0.4]), np.array([0.3, -0.1, 0.5])
    cos, sin = np.cos(turned), np.sin(turned)
    turn = np.array([[cos, -sin, 0], [sin, cos, 0], [0, 0, 1]])
    loads = []
    for place, motion in ((head, rate), (turn @ head + [0, 0, turned], turn @ rate)):
        swimmer = swimmer_module.swimmer_at_rest(robot, sb.named_fluid("oil1"), "torque", 1 / 480)
        place_links(robot.link_lengths, place, q, swimmer["place"][0])
        swimmer_module._immerse.py_func(swimmer.view(np.recarray)[0], motion, dq, 0.0)
        loads.append(swimmer["load"][0, :10].copy())
    assert turn @ loads[0][:3] == pytest.approx(loads[1][:3])
    assert loads[0][3:] == pytest.approx(loads[1][3:])


def test_without_fluid_momentum_stays_zero():
    gait = sb.SinusoidalTorque(amplitude=1.0, frequency=1.0, phase=0.8)
    runs = [sb.simulate(gait, fluid=VACUUM, physics_rate=rate, duration=2.0) for rate in (480, 960, 1920)]
    drift = [np.abs(run.center - run.center[0]).max() for run in runs]
    assert drift[0] < 1e-5
    assert drift[0] / drift[1] > 3.5 and drift[1] / drift[2] > 3.5  # of second order at least


def test_without_fluid_and_damping_energy_is_kept_better_and_better():
    commands = np.zeros((960, 7))
    commands[:240] = 0.3 * np.cos(np.arange(7))
    lost = []
    for refinement in (1, 2, 4):
        trajectory = run_of(np.repeat(commands, refinement, axis=0), robot=LOOSE, fluid=VACUUM, rate=480 * refinement)
        energy = stored_energy(trajectory)[240 * refinement :]
        lost.append(abs(energy[-1] / energy[0] - 1))
    assert lost[0] < 0.01
    assert lost[0] / lost[1] > 3.5 and lost[1] / lost[2] > 3.5  # of second order at least


@pytest.mark.parametrize("fluid", ["water", "oil2"])
def test_without_actuation_energy_never_rises(fluid):
    density = sb.named_fluid(fluid).density
    commands = np.zeros((1440, 7))
    commands[:240] = 1.5 * np.cos(np.arange(7))
    trajectory = run_of(commands, fluid=sb.named_fluid(fluid), rate=1920)
    energy = (stored_energy(trajectory) + carried_energy(trajectory, density))[241:]
    assert energy[0] > 0.01
    assert np.diff(energy).max() <= 0.005 * energy[0]
    assert energy[-1] < 0.3 * energy[0]


@pytest.mark.parametrize("fluid", ["water", "oil1", "oil2"])
def test_work_is_change_of_energy_and_dissipation_up_to_an_error_that_shrinks_with_the_step(calibration_run, fluid):
    gaps = [energy_gap(calibration_run(fluid, rate)) for rate in (480, 960)]
    assert abs(gaps[0]) < 1e-3
    assert gaps[0] / gaps[1] == pytest.approx(4, rel=0.1)


def test_positive_work_is_never_less_than_work(calibration_run):
    trajectory = calibration_run("water")
    assert np.all(trajectory.positive_work >= trajectory.command_work)
    assert np.all(np.diff(trajectory.positive_work) >= 0)


def test_a_fluid_that_never_changes_is_the_same_as_a_field_of_it():
    gait = sb.SeaSnake(amplitude=0.8, frequency=0.6, phase=0.7)
    oil = sb.named_fluid("oil1")
    plain = sb.simulate(gait, fluid=oil, duration=3.0)
    for along in ("time", "x"):
        field = sb.FluidField(along=along, knots=(-1.0, 1.0), fluids=(oil, oil))
        assert sb.simulate(gait, fluid=field, duration=3.0).center == pytest.approx(plain.center, abs=1e-9)


def test_a_step_in_time_acts_from_that_time_on():
    gait = sb.SeaSnake(amplitude=0.8, frequency=0.6, phase=0.7)
    water, oil = sb.named_fluid("water"), sb.named_fluid("oil2")
    field = sb.FluidField(along="time", knots=(0.0, 2.0), fluids=(water, oil), between="step")
    plain, stepped = (sb.simulate(gait, fluid=fluid, duration=6.0) for fluid in (water, field))
    assert np.array_equal(plain.center[:961], stepped.center[:961])
    assert stepped.center[-1, 0] < 0.7 * plain.center[-1, 0] + 0.3 * plain.center[0, 0]


def test_a_field_in_space_acts_on_each_link_where_it_is():
    # From rest, with thick oil over the rear half only: the rear joints move less than in water, the front ones do not.
    gait = sb.SinusoidalTorque(amplitude=1.0, frequency=1.0, phase=0.0)
    water, oil = sb.named_fluid("water"), sb.Fluid(kinematic_viscosity=1e-2)
    rear = sb.FluidField(along="x", knots=(-9.0, -0.8), fluids=(oil, water), between="step")
    plain, mixed = (np.ptp(sb.simulate(gait, fluid=fluid, duration=1.0).joint_angle, axis=0) for fluid in (water, rear))
    assert mixed[-1] < 0.8 * plain[-1]
    assert mixed[0] > 0.9 * plain[0]


def test_the_end_stop_and_the_torque_limit_hold():
    gait = sb.SinusoidalTorque(amplitude=3.5, frequency=0.7, phase=0.84)
    free = sb.simulate(gait, duration=5.0)
    stopped = sb.simulate(gait, robot=sb.Robot(angle_limit=0.5), duration=5.0)
    limited = sb.simulate(gait, robot=sb.Robot(torque_limit=1.0), duration=5.0)
    assert np.abs(free.joint_angle).max() > 0.9
    assert np.abs(stopped.joint_angle).max() < 0.65  # the stop is elastic, 100 N m/rad
    assert np.abs(limited.command_torque).max() == 1.0


def test_a_servos_torque_falls_to_zero_at_its_no_load_speed():
    # 2 N m and 6 rad/s: against the motion all of it, along it what the line from rest to the no-load speed leaves.
    robot = sb.Robot(torque_limit=2.0, speed_limit=6.0, joint_stiffness=0.0, joint_damping=0.0)
    rate = np.array([-9.0, -6.0, -3.0, 0.0, 3.0, 6.0, 9.0])
    for drives, strong in (("torque", 50.0), ("angle", 1e3)):
        ahead, back = (torque_under(robot, drives, np.full(7, c), np.zeros(7), rate) for c in (strong, -strong))
        assert ahead == pytest.approx([2.0, 2.0, 2.0, 2.0, 1.0, 0.0, 0.0], abs=1e-12)
        assert back == pytest.approx([0.0, 0.0, -1.0, -2.0, -2.0, -2.0, -2.0], abs=1e-12)
    weak = torque_under(robot, "torque", np.full(7, 0.5), np.zeros(7), rate)
    assert weak == pytest.approx([0.5, 0.5, 0.5, 0.5, 0.5, 0.0, 0.0], abs=1e-12)
    assert robot.damping("torque") == pytest.approx(2.0 / 6.0) and robot.damping("angle") == pytest.approx(2.0 / 6.0)


@pytest.mark.parametrize("limit", [None, 1.0])
def test_without_a_speed_limit_the_law_is_the_papers_to_the_last_bit(limit):
    robot, rng = LOOSE.but(torque_limit=limit), np.random.default_rng(0)
    command, angle, rate = rng.normal(0, 3, (3, 10_000))
    for drives, asked in (("torque", command), ("angle", 4.0 * (command - angle) - 0.3 * rate)):
        bounded = asked if limit is None else np.clip(asked, -limit, limit)
        assert np.array_equal(torque_under(robot, drives, command, angle, rate), bounded)


@pytest.mark.parametrize("engine", ["pybullet", "planar"])
def test_a_servo_drives_a_joint_to_its_no_load_speed_and_no_further(engine):
    # Two rods on a hinge, nothing around them: the rate rises as w (1 - exp(-(2 / J) u t / w)) while they are straight.
    torque, no_load = 5.0, 3.0
    robot = LOOSE.but(
        lengths=(0.4, 0.4), masses=(1.5, 1.5), cover_mass=0.0, diameter=0.05, torque_limit=torque, speed_limit=no_load
    )
    with load_engine(engine).open_simulation(robot, VACUUM, "torque", 7680, 500) as simulation:
        simulation.advance(np.full((500, 1), 50.0))
        run = simulation.trajectory()
    decay = 2 / robot.link_inertias[0] * torque / no_load  # [1/s]
    assert run.joint_rate[:, 0] == pytest.approx(no_load * (1 - np.exp(-decay * run.time)), abs=0.015 * no_load)
    assert 0.99 * no_load < run.joint_rate[-1, 0] < 1.01 * no_load


@pytest.mark.parametrize("engine", ["pybullet", "planar"])
@pytest.mark.parametrize(
    "gait",
    [
        sb.SinusoidalTorque(amplitude=8.0, frequency=0.5, phase=0.8),
        sb.SeaSnake(amplitude=1.0, frequency=2.0, phase=0.7),
    ],
    ids=["torque", "angle"],
)
def test_no_servo_drives_beyond_its_no_load_speed(engine, gait):
    driven = []
    for robot in (sb.Robot(torque_limit=8.0), sb.Robot(torque_limit=8.0, speed_limit=6.0)):
        run = sb.simulate(gait, robot=robot, engine=engine, physics_rate=1920, duration=2.0)
        power = (run.command_torque * run.joint_rate)[np.abs(run.joint_rate) >= 6.0]
        driven.append(power.max(initial=0.0))
    assert driven[0] > 1.0 and driven[1] == 0.0


@pytest.mark.parametrize(
    ("fields", "complaint"),
    [
        ({"speed_limit": 6.0}, "needs a torque_limit"),
        ({"speed_limit": 0.0, "torque_limit": 2.0}, "speed_limit = 0.0"),
        ({"speed_limit": -6.0, "torque_limit": 2.0}, "speed_limit = -6.0"),
    ],
)
def test_a_speed_limit_that_means_nothing_is_refused_in_a_line(fields, complaint):
    with pytest.raises(InvalidValue, match=complaint) as refused:
        sb.Robot(**fields)
    assert "\n" not in str(refused.value)


def test_without_fluid_pybullet_converges_to_mujoco(mujoco_run):
    gait, duration = sb.SinusoidalTorque(amplitude=1.0, frequency=0.8, phase=0.7), 1.5
    reference = mujoco_run(sb.Robot(), gait, duration)
    errors = [
        np.abs(sb.simulate(gait, fluid=VACUUM, physics_rate=rate, duration=duration).joint_angle[-1] - reference).max()
        for rate in (1920, 3840, 7680)
    ]
    assert errors[-1] < 1e-4 * np.abs(reference).max()
    assert errors[0] / errors[1] == pytest.approx(4, rel=0.1) and errors[1] / errors[2] == pytest.approx(4, rel=0.3)


def test_two_simulations_in_one_process_do_not_meet():
    gait = sb.SinusoidalTorque(amplitude=2.0, frequency=0.7, phase=0.84)
    commands = gait.commands(np.arange(480) / 480, 7)
    alone = run_of(commands)
    with (
        bullet.open_simulation(sb.Robot(), sb.named_fluid("water"), "torque", 480, 480) as one,
        bullet.open_simulation(sb.Robot.with_joints(3), sb.named_fluid("oil2"), "torque", 480, 480) as other,
    ):
        for k in range(0, 480, 16):
            one.advance(commands[k : k + 16])
            other.advance(commands[k : k + 16, :3])
        assert np.array_equal(one.trajectory().center, alone.center)
