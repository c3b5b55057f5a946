"""The planar engine against closed forms, independent integrators, MuJoCo, PyBullet's limit, and its own step."""

from __future__ import annotations

import numpy as np
import pytest
from adversaries import targets
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

import snakebench as sb
from snakebench.accuracy import energy_gap, stored_energy
from snakebench.controllers import HeldTargets
from snakebench.engines.planar import Batch, open_simulation, stable_rate
from snakebench.errors import UnstableRate
from snakebench.physics import chain as chain_module
from snakebench.physics.body import immerse
from snakebench.physics.chain import CHAIN, SCRATCH, accelerate, describe_chain
from snakebench.physics.hydrodynamics import C_F, C_MU
from snakebench.physics.kinematics import joint_mobility

VACUUM = sb.Fluid(kinematic_viscosity=1e-7, density=1e-12)
WATER = sb.named_fluid("water")
LOOSE = sb.Robot(joint_stiffness=0.0, joint_damping=0.0)
CALIBRATION = sb.SinusoidalTorque(amplitude=3.5, frequency=0.70, phase=0.84)
SEA_SNAKE = sb.SeaSnake(amplitude=1.0, frequency=0.6, phase=0.66)


class Motion:
    """The compiled equations of motion as a plain function of time and state, for integrators that are not ours."""

    def __init__(self, robot, fluid, drives, commands, function=accelerate, tow=0.0):
        self.n, self.commands, self.function, self.tow = robot.n_links, commands, function, tow
        self.mass, record = robot.total_mass, np.zeros(1, CHAIN)
        describe_chain(record[0], robot, drives)
        immerse(record[0], fluid)
        self.chain, self.scratch = record[0], np.zeros(1, SCRATCH)[0]
        if function is not accelerate:  # plain Python reads fields as attributes
            self.chain, self.scratch = record.view(np.recarray)[0], np.zeros(1, SCRATCH).view(np.recarray)[0]

    def __call__(self, time, state):
        place, rate = state[: self.n + 2].copy(), state[self.n + 2 :].copy()
        command = self.commands(time)
        self.function(self.chain, time, place, rate, place, rate, 0.0, command, self.scratch)
        acceleration = np.array(self.scratch["acceleration"][: self.n + 2])
        acceleration[0] += self.tow / self.mass
        return np.concatenate([rate, acceleration])

    def from_rest(self, until, **tolerances):
        return solve_ivp(self, (0, until), np.zeros(2 * self.n + 4), **tolerances).y[:, -1]


def joint_angles(state, n_links):
    return np.diff(state[2 : n_links + 2])


# --- against closed forms and independent integrators ---------------------------------------------------------------


def axial_drag(robot, fluid):
    """Coefficients a [kg/m] and b [kg m^-1/2 s^-1/2] of the axial force a v^2 + b v^1.5 of a straight robot."""
    surface = fluid.density * np.pi * robot.diameter
    a = 0.5 * C_F * surface * robot.link_lengths.sum()
    return a, C_MU * surface * np.sqrt(fluid.kinematic_viscosity * robot.link_lengths).sum()


@pytest.mark.parametrize("fluid", ["water", "oil1", "oil2"])
@pytest.mark.parametrize("drives", ["torque", "angle"])
def test_a_coasting_straight_robot_slows_down_as_the_closed_form_says(fluid, drives):
    # m dv/dt = -a v^2 - b v^1.5 has the solution t = m [F(s) - F(s_0)] with v = s^2 and
    # F(s) = 2/(b s) + 2 a/b^2 ln(s/(a s + b)).
    robot, medium, start, seconds = sb.Robot(), sb.named_fluid(fluid), 0.5, 5.0
    a, b = axial_drag(robot, medium)
    batch = Batch([robot], [medium], drives, 240)
    batch._rates[0, 0] = start
    end = batch.advance(np.zeros((1, 7)), round(seconds * 240)).center_rate[0, 0]

    def when(v):
        s = np.sqrt(v)
        return robot.total_mass * (2 / (b * s) + 2 * a / b**2 * np.log(s / (a * s + b)))

    assert when(end) - when(start) == pytest.approx(seconds, rel=1e-4 if drives == "angle" else 1e-7)


@pytest.mark.parametrize("fluid", ["water", "oil2"])
def test_a_towed_straight_robot_reaches_its_terminal_speed(fluid):
    robot, medium, tow = sb.Robot(), sb.named_fluid(fluid), 2.0
    a, b = axial_drag(robot, medium)
    expected = brentq(lambda v: a * v**2 + b * v**1.5 - tow, 1e-6, 10.0)
    still = np.zeros(7)
    end = Motion(robot, medium, "torque", lambda _: still, tow=tow).from_rest(100.0, rtol=1e-8, atol=1e-10)
    assert end[robot.n_links + 2] == pytest.approx(expected, rel=1e-5)


@pytest.mark.slow
def test_isotropic_drag_in_proportion_to_mass_cannot_swim(monkeypatch):
    # Equal mass per length and drag c m v in every direction: no gait moves the centre of mass, however it bends.
    robot = sb.Robot(masses=(*(2.0 * length for length in sb.Robot().lengths),), cover_mass=0.0)
    isotropic = {
        "tangential_resistance": lambda v_t, v_n, viscosity, density, length, diameter: 5.0 * length,
        "normal_resistance": lambda v_n, viscosity, density, length, diameter, shape: 5.0 * length,
        "added_mass": lambda density, length, diameter: 0.0,
    }
    swim = {}
    for name, law in {"isotropic": isotropic, "paper": {}}.items():
        with monkeypatch.context() as patch:
            for part in ("_move", "_press", "_assemble", "factorise", "solve"):
                patch.setattr(chain_module, part, getattr(chain_module, part).py_func)
            for part, replacement in law.items():
                patch.setattr(chain_module, part, replacement)
            commands = lambda time: CALIBRATION.commands(np.array([time]), 7)[0]  # noqa: E731
            motion = Motion(robot, WATER, "torque", commands, accelerate.py_func)
            swim[name] = motion.from_rest(0.6, rtol=1e-5, atol=1e-8)
    assert np.ptp(joint_angles(swim["isotropic"], 8)) > 0.3
    assert np.hypot(*swim["isotropic"][:2]) < 1e-6
    assert np.hypot(*swim["paper"][:2]) > 0.01


@pytest.mark.parametrize("gait", [CALIBRATION, SEA_SNAKE], ids=["torque", "angle"])
@pytest.mark.parametrize("fluid", ["water", "oil2"])
def test_an_integrator_that_is_not_ours_finds_the_same_motion(gait, fluid):
    medium, seconds = sb.named_fluid(fluid), 1.5
    motion = Motion(sb.Robot(), medium, gait.drives, lambda t: gait.commands(np.array([t]), 7)[0])
    expected = motion.from_rest(seconds, method="LSODA", rtol=1e-9, atol=1e-11)
    run = sb.simulate(gait, fluid=medium, engine="planar", physics_rate=1920, duration=seconds)
    assert run.joint_angle[-1] == pytest.approx(joint_angles(expected, 8), abs=2e-6)
    assert run.center[-1] - run.center[0] == pytest.approx(expected[:2], abs=2e-6)


def test_without_fluid_the_engine_agrees_with_mujoco_to_four_digits(mujoco_run):
    gait = sb.SinusoidalTorque(amplitude=1.0, frequency=0.8, phase=0.7)
    reference = mujoco_run(sb.Robot(), gait, 1.5)
    run = sb.simulate(gait, fluid=VACUUM, engine="planar", duration=1.5)
    assert np.abs(run.joint_angle[-1] - reference).max() < 1e-4 * np.abs(reference).max()


@pytest.mark.parametrize("fluid", ["water", "oil1", "oil2"])
def test_the_published_limits_are_reached_at_120_hz(fluid):
    published = {"water": (0.3035, 4.039), "oil1": (0.1963, 5.257), "oil2": (0.0795, 8.448)}
    evaluation = sb.evaluate(CALIBRATION, fluid=fluid, engine="planar", physics_rate=120)
    assert evaluation.steady
    assert (evaluation.speed, evaluation.power) == pytest.approx(published[fluid], rel=1e-3)  # they have four digits


@pytest.mark.parametrize(
    "gait",
    [SEA_SNAKE, sb.SinusoidalTorque(amplitude=4.0, frequency=0.4, phase=1.0)],
    ids=["sea snake", "slow torque"],
)
@pytest.mark.parametrize("fluid", ["water", "oil2"])
def test_pybullets_limit_is_the_planar_limit(gait, fluid):
    coarse, fine = (sb.evaluate(gait, fluid=fluid, physics_rate=rate, duration=15.0) for rate in (960, 1920))
    limit = sb.evaluate(gait, fluid=fluid, engine="planar", physics_rate=1920, duration=15.0)
    assert (4 * fine.speed - coarse.speed) / 3 == pytest.approx(limit.speed, rel=1e-4)
    assert (4 * fine.power - coarse.power) / 3 == pytest.approx(limit.power, rel=1e-4)


# --- order, stability, conservation -------------------------------------------------------------------------------


def errors_at(rates, gait, fluid):
    """Largest error of a joint angle after three seconds at each rate [rad]."""

    def state(rate):
        return sb.simulate(gait, fluid=fluid, engine="planar", physics_rate=rate, duration=3.0).joint_angle[-1]

    limit = state(7680)
    return [np.abs(state(rate) - limit).max() for rate in rates]


@pytest.mark.parametrize(
    ("gait", "fluid", "ratio"),
    [(CALIBRATION, "water", 16), (SEA_SNAKE, "water", 4), (SEA_SNAKE, "oil2", 4)],
    ids=["torque", "angle", "angle in oil2"],
)
def test_the_order_is_four_under_torques_and_two_under_target_angles(gait, fluid, ratio):
    errors = errors_at((120, 240, 480), gait, fluid)
    for coarse, fine in zip(errors, errors[1:], strict=False):
        assert coarse / fine == pytest.approx(ratio, rel=0.3)


def test_in_thick_fluid_the_kinks_of_the_force_law_end_the_order_far_below_any_figure_shown():
    # The viscous force goes with the root of |v|, so it has a kink wherever a link's velocity changes sign.
    errors = errors_at((120, 240, 480), CALIBRATION, "oil2")
    assert errors[0] < 2e-5 and errors[2] < 2e-6


def test_thirty_hertz_control_costs_a_handful_of_right_hand_sides():
    # At 90 Hz, three steps of two solutions each, speed and power of a swimming policy are within half a percent.
    phase = 2 * np.pi * np.arange(600)[:, None] / 30 - 0.84 * np.arange(7)
    policy = HeldTargets(rate=30, targets=tuple(map(tuple, (0.6 * np.sin(phase)).tolist())))
    for fluid in ("water", "oil1", "oil2"):
        quick, fine = (
            sb.evaluate(policy, fluid=fluid, engine="planar", physics_rate=rate, duration=20.0) for rate in (90, 1920)
        )
        assert quick.speed == pytest.approx(fine.speed, rel=0.005)
        assert quick.power == pytest.approx(fine.power, rel=0.005)


@pytest.mark.parametrize("robot", [sb.Robot(), sb.Robot.with_joints(12), sb.Robot.with_joints(3)], ids=str)
def test_the_stable_rate_separates_ringing_from_rest(monkeypatch, robot):
    # 5 % margin: just above the rate a kicked chain comes to rest, below it the kick grows.
    needed = stable_rate(robot, "torque")
    monkeypatch.setattr("snakebench.engines.planar.check_rate", lambda *_: None)
    worst = []
    for rate in (int(needed) + 1, int(0.9 * needed)):
        kick = np.zeros((20 * rate, robot.n_joints))
        kick[: rate // 10 + 1] = 0.3 * np.cos(3.1 * np.arange(robot.n_joints))
        with open_simulation(robot, VACUUM, "torque", rate, len(kick)) as run:
            run.advance(kick)
            trajectory = run.trajectory()
        worst.append(np.inf if trajectory.diverged else np.abs(trajectory.joint_rate[-rate:]).max())
    assert worst[0] < 0.2 and worst[1] > 1.0


def test_a_rate_too_low_for_torques_is_refused_with_the_rate_that_is_needed():
    with pytest.raises(UnstableRate, match=r"30 Hz is unstable .* in planar: at least 45 Hz is needed, such as 60"):
        sb.evaluate(CALIBRATION, engine="planar", physics_rate=30)
    with pytest.raises(UnstableRate, match="at least 198 Hz is needed, such as 210"):
        sb.evaluate(CALIBRATION, engine="planar", physics_rate=120, robot=sb.Robot(angle_limit=1.0))


@pytest.mark.parametrize("gait", [SEA_SNAKE, targets("bang-bang", 5)], ids=["gait", "jumps"])
@pytest.mark.parametrize("robot", [sb.Robot(), sb.Robot(angle_limit=0.3), sb.Robot.with_joints(7, 0.07)], ids=str)
def test_target_angles_are_stable_at_any_rate(gait, robot):
    coarse, fine = (
        sb.simulate(gait, robot=robot, engine="planar", physics_rate=rate, duration=5.0) for rate in (30, 960)
    )
    assert not coarse.diverged
    assert np.abs(coarse.center[-1] - fine.center[-1]).max() < 0.03
    assert coarse.positive_work[-1] == pytest.approx(fine.positive_work[-1], rel=0.2)


@pytest.mark.parametrize("gait", [CALIBRATION, SEA_SNAKE, targets("alternating", 5)], ids=["torque", "angle", "jumps"])
def test_without_fluid_momentum_stays_zero_to_rounding(gait):
    run = sb.simulate(gait, fluid=VACUUM, engine="planar", duration=5.0)
    assert np.abs(run.center - run.center[0]).max() < 1e-11


def test_without_fluid_and_damping_energy_is_kept():
    kick = np.zeros((2400, 7))
    kick[:120] = 0.3 * np.cos(np.arange(7))
    with open_simulation(LOOSE, VACUUM, "torque", 480, len(kick)) as run:
        run.advance(kick)
        energy = stored_energy(run.trajectory())[120:]
    assert energy[0] > 0.01
    assert np.ptp(energy) < 1e-6 * energy[0]


@pytest.mark.parametrize("turned", [0.7, -2.5])
def test_turning_the_robot_turns_its_course(turned):
    batch = Batch([sb.Robot()] * 2, [WATER] * 2, "torque", 120)
    batch._places[:, :2] = 0.0
    batch._places[1, 2:] = turned
    straight, other = batch.follow([CALIBRATION.waveform(7)] * 2, 600).center
    turn = np.array([[np.cos(turned), -np.sin(turned)], [np.sin(turned), np.cos(turned)]])
    assert np.hypot(*straight) > 0.5
    assert other == pytest.approx(turn @ straight, abs=1e-9)


def test_the_mirror_image_swims_mirrored():
    commands = CALIBRATION.commands((np.arange(1200) + 0.5) / 240, 7)
    runs = []
    for sign in (1, -1):
        with open_simulation(sb.Robot(), WATER, "torque", 240, 1200) as simulation:
            simulation.advance(sign * commands)
            runs.append(simulation.trajectory().center)
    assert runs[1][:, 0] == pytest.approx(runs[0][:, 0], abs=1e-12)
    assert runs[1][:, 1] == pytest.approx(-runs[0][:, 1], abs=1e-12)


# --- the energy ledger ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("fluid", ["water", "oil1", "oil2"])
@pytest.mark.parametrize("kind", ["random", "bang-bang", "alternating"])
def test_the_ledger_closes_under_adversarial_targets(kind, fluid):
    run = sb.simulate(targets(kind, 5), fluid=fluid, engine="planar", duration=5.0)
    command, driving, dampers, into_fluid = run.energy[-1]
    gap = command - stored_energy(run)[-1] - dampers - into_fluid
    assert abs(gap) < 0.01 * abs(command)
    assert energy_gap(run) == pytest.approx(gap / driving)


@pytest.mark.parametrize("fluid", ["water", "oil1", "oil2"])
def test_the_ledger_closes_for_gaits(fluid):
    for gait in (CALIBRATION, SEA_SNAKE):
        assert abs(sb.evaluate(gait, fluid=fluid, engine="planar").energy_gap) < 1e-4


@pytest.mark.parametrize("kind", ["random", "bang-bang", "alternating"])
def test_pybullets_gap_shrinks_with_its_step(kind):
    gaps = [energy_gap(sb.simulate(targets(kind, 2), physics_rate=rate, duration=2.0)) for rate in (960, 1920, 3840)]
    assert 0 < abs(gaps[2]) < abs(gaps[1]) < abs(gaps[0]) < 0.01
    assert gaps[1] / gaps[2] == pytest.approx(4, rel=0.3)


def test_nobody_earns_power_by_flipping_targets():
    for fluid in ("water", "oil1", "oil2"):
        for rate in (120, 240):
            run = sb.simulate(targets("alternating", 5), fluid=fluid, engine="planar", physics_rate=rate, duration=5.0)
            assert run.command_work[-1] > 0
            assert abs(run.center[-1, 0] - run.center[0, 0]) < 0.05


# --- the same scenario in both engines ------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("gait", "robot"),
    [
        (CALIBRATION, sb.Robot(torque_limit=3.0, speed_limit=4.0)),
        (SEA_SNAKE, sb.Robot(torque_limit=2.0, speed_limit=2.0)),
    ],
    ids=["torque", "angle"],
)
def test_the_engines_agree_on_a_swim_with_a_no_load_speed(gait, robot):
    free, planar, bullet = (
        sb.evaluate(gait, robot=robot, engine=engine, physics_rate=rate, duration=6.0)
        for robot, engine, rate in ((sb.Robot(), "planar", 960), (robot, "planar", 960), (robot, "pybullet", 3840))
    )
    assert planar.speed < 0.97 * free.speed  # the limit does something
    assert bullet.speed == pytest.approx(planar.speed, rel=0.01)
    assert bullet.power == pytest.approx(planar.power, rel=0.01)


@pytest.mark.parametrize("rate", [120, 240])
@pytest.mark.parametrize("limits", [(4.0, 6.0), (8.0, 4.0)])
def test_energies_close_under_a_servo_that_ends_at_its_no_load_speed(limits, rate):
    robot = sb.Robot(torque_limit=limits[0], speed_limit=limits[1])
    gait = sb.SeaSnake(amplitude=1.0, frequency=1.5, phase=0.66)
    for controller in (gait, targets("bang-bang", 4), targets("alternating", 4)):
        run = sb.simulate(controller, robot=robot, engine="planar", physics_rate=rate, duration=4.0)
        assert abs(energy_gap(run)) < 5e-3


def test_a_steep_fall_of_torque_needs_a_finer_step():
    steep = sb.Robot(torque_limit=4.0, speed_limit=0.5)
    needed = stable_rate(steep, "angle")
    assert needed == pytest.approx(4.0 / 0.5 * np.linalg.eigvalsh(joint_mobility(steep, np.zeros(7)))[-1] / 50)
    with pytest.raises(UnstableRate, match=f"{needed:.0f} Hz is needed"):
        sb.simulate(SEA_SNAKE, robot=steep, engine="planar", physics_rate=240, duration=1.0)
    assert stable_rate(steep.but(speed_limit=None), "angle") == 0.0


@pytest.mark.parametrize(
    "scenario",
    [
        {"fluid": sb.FluidField(along="time", knots=(0.5, 1.5), fluids=(WATER, sb.named_fluid("oil2")))},
        {"fluid": sb.FluidField(along="x", knots=(-1.2, 0.2), fluids=(WATER, sb.named_fluid("oil1")))},
        {"robot": sb.Robot(angle_limit=0.4), "duration": 0.5},  # later, bounces amplify what is left of the step
        {"robot": sb.Robot(torque_limit=0.8)},
        {"robot": sb.Robot.with_joints(5, 0.07)},
    ],
    ids=["in time", "in space", "end stops", "torque limit", "five joints"],
)
@pytest.mark.parametrize("gait", [CALIBRATION, SEA_SNAKE], ids=["torque", "angle"])
def test_the_engines_agree_on_everything_a_scenario_can_ask(gait, scenario):
    states = []
    for engine, rate in ("planar", 3840), ("pybullet", 1920), ("pybullet", 3840):
        run = sb.simulate(gait, **({"duration": 2.0} | scenario), engine=engine, physics_rate=rate)
        states.append(np.concatenate([run.joint_angle[-1], run.center[-1]]))
    planar, coarse, fine = states
    assert fine == pytest.approx(planar, abs=2e-3)
    assert np.abs(fine - planar).max() < 0.35 * np.abs(coarse - planar).max() + 2e-4  # of second order
