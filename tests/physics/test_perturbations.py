"""What perturbed robots do, against closed forms and robots that are perturbed in another way."""

from __future__ import annotations

import math

import numpy as np
import pytest

import snakebench as sb
from snakebench.channel import Channel
from snakebench.controllers import HeldTargets
from snakebench.engines import load_engine
from snakebench.engines.perturbed import scale_drag
from snakebench.errors import InvalidValue
from snakebench.execution import Case, Evaluator, evaluation_key
from snakebench.perturbation import NAMES, Specimen, drawn, one_of
from snakebench.physics.body import BODY, describe, immerse
from snakebench.physics.hydrodynamics import added_mass, normal_resistance, tangential_resistance
from snakebench.physics.record import as_record, row_width
from snakebench.store import EvaluationCache
from snakebench.workers import open_workers

ENGINES = {"planar": 480, "pybullet": 960}
SNAKE = sb.SeaSnake(amplitude=0.9, frequency=0.6, phase=0.7)
WAVE = sb.SinusoidalTorque(amplitude=3.0, frequency=0.7, phase=0.8)
NOTHING = sb.Perturbations()
RANGES = {"angle_noise": (0.0, 0.01), "delay": (0.0, 2.0), "jitter": (0.0, 1.0), "mass": (0.9, 1.1)}


class Wave:
    """A policy that commands a wave, whatever it observes, and keeps what it observes."""

    drives = "angle"

    def __init__(self) -> None:
        self.seen: list = []

    def begin(self, robot, control_rate):
        self.seen.clear()

        def target(now, viscosity):
            time = len(self.seen) / control_rate
            self.seen.append([now.joint_angle.copy(), now.joint_rate.copy(), now.head_rate.copy()])
            return wave(time)

        return target

    def digest(self) -> str:
        return "wave"


def wave(time: float) -> np.ndarray:
    return 0.5 * np.sin(2 * np.pi * 0.7 * time - 0.8 * np.arange(7))


@pytest.fixture(scope="module")
def policy(request):
    return sb.Policy.load(request.config.rootpath / "results/teacher_student/policies/student-10.safetensors")


@pytest.fixture(params=ENGINES)
def scenario(request):
    return sb.Scenario(fluid="oil1", engine=request.param, physics_rate=ENGINES[request.param], duration=3.0)


def swim(controller, scenario, **sizes):
    return sb.simulate(*sb.perturbed(controller, scenario, sb.Perturbations(**sizes)))


def rows_of(trajectory) -> list[np.ndarray]:
    return [trajectory.head, trajectory.joint_angle, trajectory.joint_rate]


def same(one, other, tolerance=0.0) -> bool:
    return all(np.allclose(a, b, rtol=0, atol=tolerance) for a, b in zip(rows_of(one), rows_of(other), strict=True))


def test_without_perturbations_controller_and_scenario_are_the_given_ones(policy, scenario):
    for controller in (policy, SNAKE, WAVE):
        found = sb.perturbed(controller, scenario, NOTHING)
        assert found[0] is controller and found[1] is scenario
        assert sb.perturbed(controller, scenario, sb.Perturbations(seed=7))[0] is controller


def test_each_perturbation_has_its_own_key(policy, scenario):
    sizes = {"dead_joint": 3, "speed_limit": 6.0}
    each = [sb.Perturbations(**{name: sizes.get(name, 0.5)}) for name in NAMES if name != "jitter"]
    keys = {evaluation_key(*sb.perturbed(policy, scenario, one)) for one in each}
    assert len(keys | {evaluation_key(policy, scenario)}) == len(NAMES)


def test_a_changed_mass_stiffness_and_servo_are_the_changed_robots(policy, scenario):
    usual = scenario.robot
    p = {"mass": 1.1, "cover_stiffness": 0.7, "servo_strength": 0.8, "speed_limit": 9.0}
    robot = sb.Robot(
        masses=tuple(1.1 * mass for mass in usual.masses),
        cover_mass=1.1 * usual.cover_mass,
        joint_stiffness=0.7 * usual.joint_stiffness,
        proportional_gain=0.8 * usual.proportional_gain,
        derivative_gain=0.8 * usual.derivative_gain,
        torque_limit=0.8 * 8.3,
        speed_limit=9.0,
    )
    assert same(swim(SNAKE, scenario, **p), sb.simulate(SNAKE, scenario, robot=robot))
    assert same(swim(Wave(), scenario, **p), sb.simulate(Wave(), scenario, robot=robot))


def test_a_stronger_servo_exerts_so_many_times_the_torque_of_a_torque_gait(scenario):
    strong = WAVE.but(amplitude=1.2 * WAVE.amplitude)
    assert same(swim(WAVE, scenario, servo_strength=1.2), sb.simulate(strong, scenario), 1e-3)


def test_a_delayed_gait_is_the_same_gait_later_in_its_period(scenario):
    """Its motion from the time on that the first command arrives is that of the gait itself, from rest."""
    late, steps = swim(SNAKE, scenario, delay=2.0), 2 * scenario.physics_rate // 30
    usual = sb.simulate(SNAKE, scenario)
    assert np.abs(late.joint_angle[: steps // 2]).max() < 1e-12
    assert np.allclose(late.joint_angle[steps:], usual.joint_angle[:-steps], atol=2e-3)
    assert np.allclose(late.head[steps:], usual.head[:-steps], atol=2e-3)


@pytest.mark.parametrize("delay", [0.5, 1.0, 2.0])
def test_a_policys_delayed_actions_are_the_same_targets_held_later(scenario, delay):
    n, parts = 90, 2
    targets = np.repeat([wave(k / 30) for k in range(n)], parts, axis=0)
    shift = round(delay * parts)
    shifted = np.concatenate([np.zeros((shift, 7)), targets])[: n * parts]
    held = HeldTargets(rate=30.0 * parts, targets=tuple(map(tuple, shifted.tolist())))
    assert same(swim(Wave(), scenario, delay=delay), sb.simulate(held, scenario), 1e-9)


@pytest.mark.parametrize("joint", [1, 4, 7])
@pytest.mark.parametrize("controller", [SNAKE, WAVE, Wave()], ids=["target angles", "torques", "policy"])
def test_a_dead_joints_command_torque_is_zero_and_all_others_are_not(scenario, joint, controller):
    trajectory = swim(controller, scenario, dead_joint=joint)
    torque = np.abs(trajectory.command_torque[1:-1]).max(axis=0)
    assert torque[joint - 1] < 1e-12
    assert (np.delete(torque, joint - 1) > 0.1).all()
    assert np.abs(trajectory.joint_angle[:, joint - 1]).max() > 1e-3  # the others and the water move it


@pytest.mark.parametrize("engine", ["planar", "pybullet"])
def test_a_dead_joint_moves_as_one_without_a_servo(engine):
    """In the limit of small steps, to which the error falls in proportion to the step."""
    usual = sb.Robot(lengths=(0.6, 0.6), masses=(2.0, 2.0))
    free = usual.but(proportional_gain=1e-9, derivative_gain=0.0)
    still, bent = HeldTargets(rate=30.0, targets=((0.0,),)), sb.Perturbations(start=0.2, seed=1)

    def angle(robot, rate, **more):
        where = sb.Scenario(fluid="oil1", engine=engine, robot=robot, physics_rate=rate, duration=2.0)
        return sb.simulate(*sb.perturbed(still, where, bent.but(**more))).joint_angle[:: rate // 960]

    expected, coarse, dead = angle(free, 3840), angle(usual, 1920, dead_joint=1), angle(usual, 3840, dead_joint=1)
    size = np.abs(expected).max()
    assert np.abs(2 * dead - coarse - expected).max() < 0.002 * size
    assert np.abs(angle(usual, 3840) - expected).max() > 0.2 * size


def test_the_rest_of_a_dead_servo_vanishes_with_the_step():
    """Within a step it resists as an inertia that is in proportion to the step: to first order."""
    where = sb.Scenario(fluid="oil1", engine="planar", duration=6.0)
    v = [
        sb.evaluate(*sb.perturbed(SNAKE, where.but(physics_rate=r), one_of("dead_joint", 7))).speed
        for r in (480, 960, 1920)
    ]
    assert abs(v[2] - v[1]) < 0.7 * abs(v[1] - v[0]) < 1e-3 * v[2]


@pytest.mark.parametrize("v_t, v_n", [(0.3, 0.2), (0.01, -0.4), (1e-3, 1e-9)])
@pytest.mark.parametrize("fluid", ["water", "oil2"])
def test_each_drag_is_scaled_by_its_own_factor(fluid, v_t, v_n):
    factors = pressure, viscous, normal, head, tail = 0.9, 1.15, 1.07, 0.85, 1.1
    robot, bodies = sb.Robot(), np.zeros(2, BODY).view(np.recarray)
    for body in bodies:
        describe(body, robot, "angle")
        immerse(body, sb.FLUIDS[fluid])
    scale_drag(bodies[1], factors, 8)
    parts = [forces(body, v_t, v_n) for body in bodies]
    assert parts[1]["pressure"] == pytest.approx(pressure * parts[0]["pressure"], rel=1e-12)
    assert parts[1]["viscous"] == pytest.approx(viscous * parts[0]["viscous"], rel=1e-12)
    for name, factor in (("middle", normal), ("head", head * normal), ("tail", tail * normal)):
        assert parts[1][name] == pytest.approx(factor * parts[0][name], rel=1e-12)
    assert parts[1]["added"] == pytest.approx(viscous**2 / pressure * parts[0]["added"], rel=1e-12)


def forces(body, v_t: float, v_n: float) -> dict[str, float]:
    """Resistances of a link: the tangential one's two parts are told by the speeds at which one of them is alone."""
    viscosity, density, diameter, length = body.viscosity[0], body.density[0], body.diameter, body.length[1]
    along = (viscosity, density, length, diameter)
    viscous = tangential_resistance(0.0, v_n, *along)
    both = tangential_resistance(v_t, 0.0, *along)
    root = tangential_resistance(1e-12, 0.0, *along) * math.sqrt(v_t / 1e-12)
    normals = {
        n: normal_resistance(v_n, *along, body.drag_multiple[i]) for n, i in (("head", 0), ("middle", 3), ("tail", 7))
    }
    return {"viscous": viscous, "pressure": both - root, "added": added_mass(density, length, diameter)} | normals


def test_without_factors_a_specimen_swims_as_the_robot(scenario, policy):
    engine = load_engine(f"perturbed {scenario.engine}")
    usual = Specimen(**{name: getattr(scenario.robot, name) for name in sb.Robot.model_fields})
    there = scenario.but(robot=usual, engine=f"perturbed {scenario.engine}", physics_rate=scenario.physics_rate)
    assert same(sb.simulate(SNAKE, there), sb.simulate(SNAKE, scenario))
    assert engine.stable_rate(usual, "angle") == load_engine(scenario.engine).stable_rate(scenario.robot, "angle")


def test_a_rough_start_has_the_stated_spread_and_is_at_rest(scenario):
    starts = [swim(SNAKE, scenario.but(duration=0.1), start=0.2, seed=seed) for seed in range(30)]
    angles = np.array([trajectory.joint_angle[0] for trajectory in starts])
    assert angles.std() == pytest.approx(0.2, rel=0.2)  # 210 angles: a standard deviation of 5 %
    assert all(np.abs(trajectory.joint_rate[0]).max() < 1e-9 for trajectory in starts)


def test_both_engines_agree_on_a_robot_that_is_perturbed_in_every_way(policy):
    sizes = {"rate_noise": 1.0, "delay": 1.0, "normal_drag": 1.1, "viscous_drag": 0.9, "dead_joint": 5, "mass": 1.05}
    speeds = [
        sb.evaluate(
            *sb.perturbed(policy, sb.Scenario(engine=engine, physics_rate=960, duration=8.0), sb.Perturbations(**sizes))
        ).speed
        for engine in ENGINES
    ]
    assert speeds[0] == pytest.approx(speeds[1], rel=5e-3)


@pytest.mark.parametrize(
    "name, column, size", [("angle_noise", 0, 0.01), ("rate_noise", 1, 1.5), ("gyro_noise", 2, 0.2)]
)
def test_noise_is_uniform_with_the_stated_bounds_and_only_in_what_is_measured(name, column, size):
    where = sb.Scenario(engine="planar", duration=20.0)
    quiet, noisy = Wave(), Wave()
    usual, perturbed = swim(quiet, where), swim(noisy, where, **{name: size})
    assert same(usual, perturbed)  # the policy does not look
    for k in range(3):
        gap = np.array([now[k] for now in noisy.seen]) - np.array([now[k] for now in quiet.seen])
        noise = gap[:, 2] if k == 2 else gap
        if k == column:
            assert np.abs(noise).max() <= size and np.abs(noise.mean()) < size / 10
            assert noise.std() == pytest.approx(size / math.sqrt(3), rel=0.1)
            assert (gap[:, :2] == 0).all() or k != 2  # the head's velocity is privileged
        else:
            assert (gap == 0).all()


def test_a_joint_offset_is_measured_and_held_by_the_servo(scenario):
    """The true angle is off by as much as the measured one is not: at rest the robot is bent by the offset."""
    still = HeldTargets(rate=30.0, targets=((0.0,) * 7,))
    long = scenario.but(duration=6.0)
    trajectory = swim(still, long, joint_offset=0.02, seed=3)
    servo, cover = scenario.robot.proportional_gain, scenario.robot.joint_stiffness
    offsets = -trajectory.joint_angle[-1] * (servo + cover) / servo
    assert np.abs(offsets).max() <= 0.0201 and np.abs(offsets).max() > 0.005
    seen = Wave()
    trajectory = swim(seen, long.but(duration=0.2), joint_offset=0.02, seed=3)
    shown = seen.seen[0][0] - trajectory.joint_angle[0]
    assert np.abs(shown).max() <= 0.02 and np.unique(shown).size == 7
    assert offsets == pytest.approx(shown, abs=1e-3)


def test_dropouts_repeat_what_was_measured_for_a_tenth_of_a_second_as_often_as_stated():
    channel = Channel([sb.Perturbations(dropouts=1.0)] * 50, 2, 30, 1, np.random.default_rng(0))
    shown = []
    for k in range(900):
        row = np.zeros((50, row_width(2)))
        row[:, 6:8] = k
        channel.measure(as_record(row, 2))
        shown.append(channel.seen(as_record(row, 2)).joint_angle[:, 0].copy())
        channel.delayed(np.zeros((50, 2)))
    repeated = np.diff(np.array(shown), axis=0) == 0
    starts = (repeated[1:] & ~repeated[:-1]).sum()
    assert repeated.sum() / starts == pytest.approx(3.0, rel=0.05)  # control steps, of which few follow at once
    assert starts / (50 * 30.0) == pytest.approx(1 / 1.1, rel=0.1)  # a second, of which 0.1 s are lost


def test_late_actions_arrive_in_their_order_and_within_delay_and_jitter():
    channel = Channel([sb.Perturbations(delay=0.5, jitter=2.0)], 1, 30, 8, np.random.default_rng(1))
    arrived = np.concatenate([channel.delayed(np.array([[float(k + 1)]]))[:, 0, 0] for k in range(400)])
    assert (np.diff(arrived) >= 0).all()
    age = np.arange(len(arrived)) / 8 - (arrived - 1)  # of the action that acts [control steps]
    assert age[arrived > 0].min() >= 0.5 and age[arrived > 0].max() <= 2.5 + 1 + 1 / 8
    assert np.ptp(age[80:]) > 1.5


def test_what_is_random_depends_on_the_seed_alone(policy):
    where = sb.Scenario(engine="planar", fluid="oil1", duration=2.0)
    noise = {"rate_noise": 1.5, "delay": 1.0, "jitter": 1.0, "dropouts": 1.0, "joint_offset": 0.02, "start": 0.1}
    runs = [swim(policy, where, **noise, seed=seed) for seed in (1, 1, 2)]
    assert same(runs[0], runs[1]) and not same(runs[0], runs[2], 1e-3)


def test_the_number_of_workers_changes_no_perturbed_evaluation(policy, tmp_path):
    where = sb.Scenario(engine="planar", duration=1.0)
    cases = [Case(*sb.perturbed(policy, where, drawn(RANGES, np.random.default_rng(k)))) for k in range(4)]
    answers = []
    for workers in (1, 2):
        with open_workers(workers) as crew, EvaluationCache(tmp_path / str(workers)) as cache:
            answers.append(Evaluator(cache, crew)(cases))
    assert answers[0] == answers[1]


def test_draws_lie_in_their_ranges_and_every_second_has_a_dead_joint_which_is_any_of_them():
    ranges = RANGES | {"dead_joint": (0.0, 7.0)}
    draws = [drawn(ranges, np.random.default_rng(k)) for k in range(300)]
    for name, (low, high) in RANGES.items():
        values = np.array([getattr(p, name) for p in draws])
        assert low <= values.min() < low + 0.1 * (high - low) + 1e-9 and high >= values.max()
        assert values.mean() == pytest.approx((low + high) / 2, abs=0.1 * (high - low))
    assert {p.dead_joint for p in draws} == set(range(8))
    assert np.mean([p.dead_joint > 0 for p in draws]) == pytest.approx(0.5, abs=0.1)
    rng = np.random.default_rng(0)
    assert {drawn({"dead_joint": (4.0, 5.0)}, rng).dead_joint for _ in range(50)} == {4, 5}
    assert {drawn({"dead_joint": (0.0, 0.0)}, rng).dead_joint for _ in range(50)} == {0}


@pytest.mark.parametrize(
    "sizes, line",
    [
        ({"mass": 0.0}, "mass = 0.0: allowed are 0.1 to 10"),
        ({"delay": 9.0}, "delay = 9.0: allowed are 0 to 3"),
        ({"noise": 1.0}, "unknown field 'noise'"),
        ({"dead_joint": 1.5}, "dead_joint = 1.5"),
    ],
)
def test_what_is_out_of_range_is_refused_in_one_line(sizes, line):
    with pytest.raises(InvalidValue, match=line) as error:
        sb.Perturbations(**sizes)
    assert "\n" not in str(error.value)


def test_a_perturbed_swim_is_written_and_read_as_that_of_the_robot_that_it_seems_to_be(scenario, tmp_path):
    trajectory = swim(SNAKE, scenario, dead_joint=2, mass=1.1, joint_offset=0.02)
    trajectory.save(tmp_path / "swim.npz")
    again = sb.Trajectory.load(tmp_path / "swim.npz")
    assert same(trajectory, again)
    assert type(again.robot) is sb.Robot
    assert again.robot.total_mass == pytest.approx(1.1 * scenario.robot.total_mass)


def test_an_engine_of_perturbed_robots_is_not_for_others():
    with pytest.raises(InvalidValue, match="need a scenario from"):
        sb.simulate(SNAKE, engine="perturbed planar", duration=0.1)
    with pytest.raises(InvalidValue, match="allowed are pybullet, planar"):
        sb.simulate(SNAKE, engine="perturbed", duration=0.1)


def test_a_joint_that_the_robot_does_not_have_is_refused(scenario):
    with pytest.raises(InvalidValue, match="dead_joint = 8: the robot has 7 joints"):
        sb.perturbed(SNAKE, scenario, sb.Perturbations(dead_joint=8))
    damped = scenario.but(robot=sb.Robot(proportional_gain=0.0))
    with pytest.raises(InvalidValue, match="a proportional_gain above 0 is needed"):
        sb.perturbed(SNAKE, damped, sb.Perturbations(dead_joint=3))
