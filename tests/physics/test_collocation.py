"""The limit's equations, derivatives and optima, against the engines, differences, and each other."""

import casadi as ca
import numpy as np
import pytest

import snakebench as sb
from snakebench.collocation.equations import FluidSymbols, Motion, command_torques, imbalance, levers
from snakebench.collocation.sharpening import sharpen
from snakebench.collocation.solver import Goal, Optimum, cycle_of, on_mesh, plain, solve
from snakebench.collocation.starts import periodic_gait, steady_cycle
from snakebench.collocation.transcription import SHORTEST, Mesh, Transcription
from snakebench.physics.body import immerse
from snakebench.physics.chain import CHAIN, SCRATCH, accelerate, describe_chain

SMALL = sb.Robot.with_joints(3)
WAVE = sb.SeaSnake(amplitude=1.0, frequency=0.8, phase=0.8)
MESH = Mesh(8)


def chain_acceleration(robot, fluid, angle, rate, target):
    """The planar engine's, of the links' angles and the centre of mass."""
    chain, scratch = np.recarray(1, CHAIN), np.recarray(1, SCRATCH)
    describe_chain(chain[0], robot, "angle")
    immerse(chain[0], fluid)
    place, speed = np.concatenate([[0.0, 0.0], angle]), np.concatenate([rate[-2:], rate[:-2]])
    accelerate(chain[0], 0.0, place, speed, place, speed, 0.0, target, scratch[0])
    a = scratch[0].acceleration[: robot.n_links + 2].copy()
    return np.concatenate([a[2:], a[:2]])


@pytest.mark.parametrize("fluid", ["water", "oil2"])
@pytest.mark.parametrize("robot", [sb.Robot(), SMALL], ids=["seven joints", "three joints"])
def test_the_planar_engines_accelerations_balance_the_equations(robot, fluid):
    n, random, medium = robot.n_links, np.random.default_rng(0), sb.named_fluid(fluid)
    for _ in range(5):
        angle, rate = random.normal(0, 0.5, n), random.normal(0, 2.0, n + 2)
        target = random.uniform(-1, 1, n - 1)
        gain = chain_acceleration(robot, medium, angle, rate, target)
        motion = Motion(*map(ca.DM, (angle, rate, gain, target)))
        left = imbalance(robot, motion, FluidSymbols(medium.kinematic_viscosity, medium.density, 1e-9))
        still = imbalance(
            robot,
            motion._replace(gain=ca.DM.zeros(n + 2)),
            FluidSymbols(medium.kinematic_viscosity, medium.density, 1e-9),
        )
        assert np.abs(np.array(left)).max() < 1e-7 * np.abs(np.array(still)).max()


def test_the_links_lie_where_the_levers_put_them_about_the_centre_of_mass():
    robot, angle = sb.Robot(), np.linspace(-0.5, 0.9, 8)
    axes = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    places = levers(robot) @ axes
    np.testing.assert_allclose(robot.link_masses @ places, 0, atol=1e-12)
    ends = places[:-1] - robot.link_lengths[:-1, None] / 2 * axes[:-1]  # the rear of a link is the front of the next
    np.testing.assert_allclose(ends, places[1:] + robot.link_lengths[1:, None] / 2 * axes[1:], atol=1e-12)


def test_the_servo_is_the_robots():
    angle, rate, target = np.array([0.1, 0.4, 0.2]), np.array([1.0, -1.0, 0.5, 0, 0]), np.array([0.3, -0.2])
    robot = sb.Robot.with_joints(2)
    u_in, turn = command_torques(robot, Motion(*map(ca.DM, (angle, rate, np.zeros(5), target))))
    expected = 4.0 * (target - np.diff(angle)) - 0.3 * np.diff(rate[:3])
    np.testing.assert_allclose(np.array(u_in).ravel(), expected)
    np.testing.assert_allclose(np.array(turn).ravel(), np.diff(rate[:3]))


@pytest.mark.parametrize("currency", ["net", "positive"])
def test_the_programs_derivatives_are_those_of_its_values(currency):
    program = Transcription(SMALL, Mesh(2), currency, limited=True)
    parts, derivatives = program.program
    x0, p = ca.DM(np.random.default_rng(1).normal(0.3, 0.3, program.size)), ca.DM([1e-4, 900, 1e-2, 7.0])
    value = ca.Function("value", [parts["x"], parts["p"]], [parts["f"], parts["g"]])
    weights = ca.DM(np.random.default_rng(2).normal(size=parts["g"].shape[0]))
    lagrangian = parts["f"] + ca.dot(weights, parts["g"])
    slope = ca.Function("slope", [parts["x"], parts["p"]], [ca.gradient(lagrangian, parts["x"])])
    way = ca.DM(np.random.default_rng(3).normal(size=program.size))
    step = 1e-6
    _, g_1 = value(x0 + step * way, p)
    _, g_0 = value(x0 - step * way, p)
    _, jacobian = derivatives["jac_g"](x0, p)
    np.testing.assert_allclose(np.array(jacobian @ way), np.array((g_1 - g_0) / (2 * step)), rtol=1e-5, atol=1e-5)
    hessian = ca.triu2symm(derivatives["hess_lag"](x0, p, 1.0, weights))
    difference = (slope(x0 + step * way, p) - slope(x0 - step * way, p)) / (2 * step)
    np.testing.assert_allclose(np.array(hessian @ way), np.array(difference), rtol=1e-4, atol=1e-3)


def optimum(power, currency="net", mesh=MESH, start=None, fluid="water", robot=SMALL, **bounds):
    medium = sb.named_fluid(fluid)
    cycle = start or plain(steady_cycle(WAVE, robot, medium, mesh, 1.0))
    goal = Goal(medium.kinematic_viscosity, medium.density, currency, power, bounds.pop("bound", 1.0), **bounds)
    return Optimum(*solve(robot.model_dump(mode="json"), list(goal), list(mesh), cycle, start is not None))


@pytest.fixture(scope="module")
def fast():
    return optimum(1.0)


@pytest.fixture(scope="module")
def fine(fast):
    return optimum(1.0, mesh=Mesh(8, 3), start=fast.cycle)


def test_an_optimum_swims_as_it_says_in_both_engines(fast, fine):
    assert fast.found
    assert fast.power == pytest.approx(1.0, rel=1e-3)
    gait = periodic_gait(cycle_of(fine.cycle))
    for engine, rate in (("planar", 480), ("pybullet", 960)):
        swim = sb.evaluate(gait, "water", robot=SMALL, engine=engine, physics_rate=rate)
        assert swim.path_speed == pytest.approx(fine.speed, rel=0.01)
        assert swim.power == pytest.approx(fine.power, rel=0.02)


def test_in_viscous_fluids_less_smoothing_is_faster_and_nearer_to_simulation():
    start = optimum(1.0, fluid="oil1").cycle
    smooth = optimum(1.0, fluid="oil1", mesh=Mesh(8, 3), start=start)
    oil, mesh, robot = sb.named_fluid("oil1"), list(Mesh(8, 3)), SMALL.model_dump(mode="json")
    goal = list(Goal(oil.kinematic_viscosity, oil.density, "net", 1.0, 1.0))
    sharp = Optimum(*sharpen(robot, goal, mesh, smooth.cycle, 1e-4))
    gaps = []
    for one in (smooth, sharp):
        gait = periodic_gait(cycle_of(one.cycle))
        swim = sb.evaluate(gait, "oil1", robot=SMALL, engine="planar", physics_rate=480, duration=20)
        gaps.append((swim.path_speed - one.multiplier * (swim.power - 1.0)) / one.speed - 1)  # at equal power
    assert sharp.found
    assert sharp.speed > 1.003 * smooth.speed
    assert gaps[0] > 0.002
    assert abs(gaps[1]) < gaps[0] / 3


def test_no_change_of_its_targets_at_equal_power_makes_an_optimum_faster(fine):
    """Random changes, to first order: what they gain in speed is no more than the multiplier times their power."""
    gait, random = periodic_gait(cycle_of(fine.cycle)), np.random.default_rng(0)
    changed = [gait]
    for _ in range(20):
        half = np.clip(np.array(gait.targets[:8]) + random.normal(0, 0.05, (8, 3)), -1, 1)
        changed.append(gait.but(targets=tuple(map(tuple, np.vstack([half, -half]).tolist()))))
    swims = [sb.evaluate(one, "water", robot=SMALL, engine="planar", physics_rate=480) for one in changed]
    gains = [swim.path_speed - swims[0].path_speed - fine.multiplier * (swim.power - swims[0].power) for swim in swims]
    assert max(gains) < 0.003 * fine.speed


def test_the_multiplier_is_what_more_power_is_worth(fast):
    more, less = (optimum(power, start=fast.cycle) for power in (1.03, 0.97))
    assert (more.speed - less.speed) / 0.06 == pytest.approx(fast.multiplier, rel=0.05)


def test_positive_power_buys_less_speed_than_net_power(fast):
    assert 0 < optimum(1.0, "positive", start=fast.cycle).speed < fast.speed


def test_bounds_hold_and_cost_speed(fast):
    slow = optimum(1.0, start=fast.cycle, joint_rate=2.0)
    rates = np.diff(np.array(slow.cycle["states"])[1:, 4:8])
    assert np.abs(rates).max() <= 2.0 + 1e-3
    narrow = optimum(1.0, start=fast.cycle, bound=0.6)
    assert np.abs(np.array(narrow.cycle["targets"])).max() <= 0.6 + 1e-6
    assert max(slow.speed, narrow.speed) < fast.speed


def test_a_servos_torque_limit_holds():
    limited = SMALL.but(torque_limit=1.0)
    one = optimum(0.5, robot=limited)
    states, n = np.array(one.cycle["states"])[1:], 4
    targets = np.vstack([one.cycle["targets"], -np.array(one.cycle["targets"])[:1]])
    at = np.stack([np.interp(MESH.places[1:] * 8, np.arange(9), column) for column in targets.T], 1)
    u_in = 4.0 * (at - np.diff(states[:, :n])) - 0.3 * np.diff(states[:, n : 2 * n])
    assert one.found
    assert np.abs(u_in).max() <= 1.0 + 1e-3


def test_knots_are_at_least_a_control_step_apart(fast):
    assert fast.cycle["half_period"] / 8 >= SHORTEST - 1e-9


def test_a_start_is_the_swim_it_was_made_of():
    medium = sb.named_fluid("water")
    cycle = steady_cycle(WAVE, SMALL, medium, Mesh(16), 2.0)
    swim = sb.evaluate(WAVE, "water", robot=SMALL, engine="planar", physics_rate=480)
    weights = Transcription(SMALL, Mesh(16), "net").weights
    assert weights @ cycle.states[1:, -2] == pytest.approx(swim.path_speed, rel=0.02)
    np.testing.assert_allclose(
        cycle.states[-1, :8], -cycle.states[0, :8], atol=0.02 * np.abs(cycle.states[:, :8]).max()
    )
    np.testing.assert_allclose(
        np.ptp(np.vstack([cycle.targets, -cycle.targets]), axis=0), 2 * np.array([1, 2, 3]) / 3, rtol=0.05
    )


def test_a_cycle_moves_to_another_mesh_and_back():
    medium = sb.named_fluid("water")
    cycle = steady_cycle(WAVE, SMALL, medium, MESH, 1.0)
    assert on_mesh(cycle, MESH) is cycle
    back = on_mesh(on_mesh(cycle, Mesh(16, 2)), MESH)
    np.testing.assert_allclose(back.targets, cycle.targets, atol=1e-12)  # their knots are among the finer ones
    np.testing.assert_allclose(back.states, cycle.states, atol=0.1)
