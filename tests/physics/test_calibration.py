"""The published calibration case and the order of convergence in the physics rate."""

from __future__ import annotations

import pytest

import snakebench as sb

# Mean over the last seven periods of 30 s for vanishing steps; d = 0.10 m, A = 3.5 N m, f = 0.70 Hz, psi = 0.84.
LIMIT = {"water": (0.3035, 4.039), "oil1": (0.1963, 5.257), "oil2": (0.0795, 8.448)}


@pytest.mark.parametrize(("physics_rate", "tolerance"), [(480, 0.002), (960, 0.001)])
@pytest.mark.parametrize("fluid", LIMIT)
def test_calibration(calibration_run, fluid, physics_rate, tolerance):
    evaluation = sb.measure(calibration_run(fluid, physics_rate))
    speed, power = LIMIT[fluid]
    assert evaluation.steady
    assert evaluation.speed == pytest.approx(speed, rel=tolerance)
    assert evaluation.power == pytest.approx(power, rel=tolerance)
    assert evaluation.swim_frequency == pytest.approx(0.70, abs=1e-3)


@pytest.mark.parametrize("fluid", LIMIT)
def test_richardson_limit_of_two_rates_is_the_published_one(calibration_run, fluid):
    coarse, fine = (sb.measure(calibration_run(fluid, rate)) for rate in (480, 960))
    speed, power = LIMIT[fluid]
    assert (4 * fine.speed - coarse.speed) / 3 == pytest.approx(speed, abs=6e-5)
    assert (4 * fine.power - coarse.power) / 3 == pytest.approx(power, abs=6e-4)


def test_the_engine_is_second_order_in_its_step(calibration_run):
    # d = 0.07 m in water: 0.2964 m/s in the limit of small steps, measured independently.
    speeds = [sb.measure(calibration_run("water", rate, 0.07)).speed for rate in (240, 480, 960, 1920)]
    assert speeds[-1] == pytest.approx(0.2964, abs=5e-5)
    first, second, third = (b - a for a, b in zip(speeds, speeds[1:], strict=False))
    assert first / second == pytest.approx(4, abs=0.4)
    assert second / third == pytest.approx(4, abs=0.2)


def test_the_wave_from_head_to_tail_swims_head_first_and_the_other_one_backwards():
    forward, backward = (
        sb.evaluate(sb.SinusoidalTorque(amplitude=3.5, frequency=0.7, phase=phase), duration=15.0)
        for phase in (0.84, -0.84)
    )
    assert forward.speed > 0.2
    assert backward.speed < -0.05


@pytest.mark.parametrize("joints", [5, 12])
def test_robots_of_other_joints_swim(joints):
    robot = sb.Robot.with_joints(joints)
    gait = sb.SinusoidalTorque(amplitude=3.5, frequency=0.7, phase=0.84 * 7 / joints)
    evaluation = sb.evaluate(gait, robot=robot)
    assert evaluation.status == "ok"
    assert 0.05 < evaluation.speed < 0.5
    assert sb.simulate(gait, robot=robot, duration=1.0).joint_angle.shape == (481, joints)
