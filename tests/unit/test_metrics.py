"""Metrics of made-up motions whose figures are known in closed form."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import snakebench as sb
from snakebench import metrics
from snakebench.errors import InvalidValue
from snakebench.reward import Weights, episode_return

RATE = 480


def motion(
    *, v=0.3, swing=0.05, frequency=0.7, turning=0.0, power=4.0, duration=30.0, settle=0.0, drives="torque", course=0.0
) -> sb.Trajectory:
    """A robot that moves at v + swing sin(4 pi f t), settling from rest; its last joint moves by 0.5 rad at f.

    Power goes into the fluid; what springs and links store comes and goes.
    """
    t = np.arange(round(duration * RATE) + 1) / RATE
    zeros = np.zeros((len(t), 7))
    angle = zeros.copy()
    angle[:, -1] = 0.5 * np.sin(2 * np.pi * frequency * t)
    rise = 1 - np.exp(-t / settle) if settle else np.ones_like(t)
    speed = v * rise + swing * np.sin(4 * np.pi * frequency * t)
    along = np.concatenate([[0.0], np.cumsum((speed[1:] + speed[:-1]) / 2 / RATE)])
    direction = np.array([np.cos(course), np.sin(course)])
    center = along[:, None] * direction
    rate = speed[:, None] * direction
    head = np.column_stack([center, turning * t])
    work = power * t
    run = sb.Trajectory(
        robot=sb.Robot(),
        drives=drives,
        engine="none",
        physics_rate=RATE,
        rate=RATE,
        diverged=False,
        head=head,
        head_rate=np.column_stack([rate, np.full_like(t, turning)]),
        joint_angle=angle,
        joint_rate=np.gradient(angle, 1 / RATE, axis=0),
        command=zeros,
        command_torque=zeros,
        torque=zeros,
        center=center,
        center_rate=rate,
        energy=np.zeros((len(t), 4)),
    )
    stored = metrics.stored_energy(run)
    return replace(run, energy=np.column_stack([work + stored - stored[0], 2 * np.abs(work), 0 * t, work]))


@pytest.mark.parametrize("frequency", [0.1, 0.2345, 0.47, 0.7, 1.3, 2.0])
def test_swim_frequency_is_finer_than_the_fft_bin(frequency):
    # 20 s are analysed: a bin is 0.05 Hz wide
    assert metrics.swim_frequency(motion(frequency=frequency)) == pytest.approx(frequency, abs=2e-3)


@pytest.mark.parametrize(("length", "frequency"), [(1.3, 0.7), (0.8, 0.47), (-1.0, 1.1)])
def test_the_wave_of_bending_runs_a_wavelength_a_period(length, frequency):
    still = motion(frequency=frequency)
    place = np.cumsum(still.robot.link_lengths)[:-1]
    turns = frequency * still.time[:, None] - place / length
    wave = replace(still, joint_angle=np.linspace(0.2, 0.6, 7) * np.sin(2 * np.pi * turns))
    assert metrics.wave_speed(wave, frequency) == pytest.approx(length * frequency, rel=1e-3)
    assert metrics.wave_speed(still, frequency) is None  # a single joint swings
    assert metrics.wave_speed(wave, None) is None


def test_a_steady_run_is_measured_over_two_velocity_cycles():
    trajectory = motion()
    window = metrics.steady_window(trajectory, 0.7)
    assert window.steady
    assert window.duration == pytest.approx(1 / 0.7, rel=1e-3)
    assert window.end > 28


def test_metrics_of_a_steady_run():
    evaluation = sb.measure(motion(course=0.2, turning=0.01))
    assert evaluation.status == "ok" and evaluation.steady
    assert evaluation.speed == pytest.approx(0.3 * np.cos(0.2), rel=1e-4)
    assert evaluation.path_speed == pytest.approx(0.3, rel=1e-4)
    assert evaluation.power == pytest.approx(4.0, rel=1e-7)
    assert evaluation.positive_power == pytest.approx(8.0, rel=1e-9)
    assert evaluation.cost_of_transport == pytest.approx(4.0 / (5.499 * 9.80665 * evaluation.speed), rel=1e-7)
    plus = 8.0 / (5.499 * 9.80665 * evaluation.speed)
    assert evaluation.positive_cost_of_transport == pytest.approx(plus, rel=1e-9)
    assert evaluation.joint_amplitude == pytest.approx(0.5, rel=1e-4)
    assert evaluation.heading_drift == pytest.approx(0.01, rel=1e-3)
    assert evaluation.episode_return is None


def test_tail_amplitude_is_across_the_course():
    # Only the last joint moves, by 0.5 rad about the straight pose: the tail's tip swings 0.322 sin(0.5) to each side.
    assert sb.measure(motion()).tail_amplitude == pytest.approx(0.322 * np.sin(0.5), rel=1e-4)


@pytest.mark.parametrize("trouble", [{"settle": 20.0}, {"swing": 0.0}, {"duration": 1.5}])
def test_a_run_that_is_not_steady_falls_back_to_whole_periods_and_says_so(trouble):
    trajectory = motion(**trouble)
    window = metrics.steady_window(trajectory, 0.7)
    assert not window.steady
    periods = window.duration * 0.7
    assert periods == pytest.approx(round(periods)) and periods >= 1 - 1e-9
    assert sb.measure(trajectory).steady is False


@pytest.mark.parametrize("duration", [30.0, 30.5, 31.1])
@pytest.mark.parametrize(
    ("aside", "turning"), [(0.01, 0.0), (0.0, 0.01), (0.0, -0.02), (0.01, 0.02)], ids=["aside", "left", "right", "both"]
)
@pytest.mark.parametrize("swing", [0.0, 0.05], ids=["many periods", "one period"])
def test_a_slow_drift_or_turn_does_not_move_the_tail(swing, aside, turning, duration):
    # The tail's tip swings 0.322 sin(0.5) to each side of a robot that runs along a circle and is carried aside.
    straight = motion(swing=swing, duration=duration)
    heading = turning * straight.time
    steps = np.diff(straight.center[:, 0]) * np.exp(1j * (heading[1:] + heading[:-1]) / 2)
    place = np.concatenate([[0.0], np.cumsum(steps)]) + 1j * aside * straight.time
    center = np.column_stack([place.real, place.imag])
    drifting = replace(straight, head=np.column_stack([center, heading]), center=center)
    assert sb.measure(straight).tail_amplitude == pytest.approx(0.322 * np.sin(0.5), rel=2e-3)
    assert sb.measure(drifting).tail_amplitude == pytest.approx(0.322 * np.sin(0.5), rel=5e-3)


def test_amplitudes_are_those_of_a_gait_period():
    # Joint 7 swings about an angle that creeps by 0.05 rad/s, and torques about one that creeps by 0.1 N m/s: not
    # settled, so over 10 periods of 1 / 0.7 s. A period sees 0.5 rad, and what creeps in the half of it between peaks.
    still = motion(swing=0.0)
    creep = 0.05 * still.time[:, None] * np.eye(7)[-1]
    run = replace(still, joint_angle=still.joint_angle + creep, torque=2 * (still.joint_angle + creep))
    evaluation = sb.measure(run)
    assert not evaluation.steady
    assert evaluation.joint_amplitude == pytest.approx(0.5, abs=0.05 / 0.7 / 2)
    assert evaluation.torque_amplitude == pytest.approx(1.0, abs=0.1 / 0.7 / 2)


def test_a_window_of_less_than_a_period_begins_earlier_for_what_is_of_a_period():
    run = motion(turning=0.01)
    half = metrics.Window(20.2, 20.2 + 0.5 / 0.7, steady=True)
    for metric, expected in {
        metrics.joint_amplitude: 0.5,
        metrics.heading_drift: 0.01,
        metrics.path_speed: 0.3,
    }.items():
        assert metric(run, half, 0.7) == pytest.approx(expected, rel=2e-3)
    assert metrics.joint_amplitude(run, half, None) < 0.5  # nobody knows what a period is


def test_four_velocity_peaks_in_a_gait_period_do_not_halve_amplitudes_and_turns():
    run = motion(swing=0.0, turning=0.01)
    speed = 0.3 + 0.05 * np.sin(8 * np.pi * 0.7 * run.time)
    fast = replace(run, center_rate=np.column_stack([speed, 0 * speed]))
    evaluation = sb.measure(fast)
    assert evaluation.steady and metrics.steady_window(fast, 0.7).duration == pytest.approx(0.5 / 0.7, rel=1e-3)
    assert evaluation.joint_amplitude == pytest.approx(0.5, rel=1e-3)
    assert evaluation.tail_amplitude == pytest.approx(0.322 * np.sin(0.5), rel=0.05)
    assert evaluation.heading_drift == pytest.approx(0.01, rel=1e-3)


@pytest.mark.parametrize("engine", ["planar", "pybullet"])
def test_the_net_power_of_a_weak_gait_is_what_dampers_and_water_take(engine):
    """Springs store 14 J at a time, of which a period spends 0.02 J."""
    weak = sb.SinusoidalTorque(amplitude=3.4263, frequency=0.1, phase=1.168)
    run = sb.simulate(weak, "water", engine=engine, physics_rate=480)
    evaluation, window = sb.measure(run), metrics.steady_window(run, 0.1)
    rows = metrics.inside(run, window)
    dampers, water = (run.energy[rows, k][-1] - run.energy[rows, k][0] for k in (2, 3))
    assert evaluation.power > 1.2 * dampers / window.duration > 1e-3
    assert evaluation.power == pytest.approx((dampers + water) / window.duration, rel=0.02)
    assert evaluation.positive_power > 500 * evaluation.power


def test_a_robot_that_starts_bent_and_gives_back_what_it_stored_is_valid():
    still = sb.HeldTargets(rate=30, targets=((0.0,) * 7,))
    bent = sb.perturbed(still, sb.Scenario(engine="planar", duration=5.0), sb.Perturbations(start=0.2))
    evaluation = sb.evaluate(*bent)
    assert evaluation.status == "ok" and evaluation.speed == pytest.approx(0.0, abs=1e-3)


@pytest.mark.parametrize("swing", [0.0, 0.05], ids=["many periods", "one period"])
def test_what_a_servo_must_stand(swing):
    # u_in of joints 1 to 7 is k/7 of 3 sin(w t) + 1: mean square (k/7)^2 (9 / 2 + 1), largest 4. Joint 7 moves as
    # 0.5 sin(w t). The mean of (k/7)^2 summed over k is 140 / 49.
    run = motion(swing=swing)
    wave = 3 * np.sin(2 * np.pi * 0.7 * run.time) + 1
    evaluation = sb.measure(replace(run, command_torque=wave[:, None] * np.arange(1, 8) / 7))
    assert evaluation.command_torque_rms == pytest.approx(np.sqrt(5.5), rel=1e-3)
    assert evaluation.heat == pytest.approx(5.5 * 140 / 49, rel=1e-3)
    assert evaluation.command_torque_peak == pytest.approx(4.0, rel=1e-4)
    assert evaluation.joint_speed_peak == pytest.approx(0.5 * 2 * np.pi * 0.7, rel=1e-3)


def test_backward_swimming_has_no_cost_of_transport():
    evaluation = sb.measure(motion(v=-0.2))
    assert evaluation.speed == pytest.approx(-0.2, rel=1e-3)
    assert evaluation.cost_of_transport is evaluation.positive_cost_of_transport is None


def test_negative_power_in_steady_swimming_is_invalid():
    assert sb.measure(motion(power=-1.0)).status == "invalid"


@pytest.mark.parametrize(("kept", "status"), [(0.95, "ok"), (0.8, "invalid"), (1.05, "ok"), (1.2, "invalid")])
def test_a_run_whose_energies_do_not_close_is_invalid(kept, status):
    run = motion(power=4.0)
    command, _, dampers, fluid = run.energy.T
    leaking = replace(run, energy=np.column_stack([command, command, dampers, kept * fluid]))
    evaluation = sb.measure(leaking)
    assert evaluation.energy_gap == pytest.approx(1 - kept, abs=0.02)
    assert evaluation.status == status


def test_negative_work_over_a_run_that_never_settles_is_invalid():
    evaluation = sb.measure(motion(power=-1.0, settle=20.0))
    assert not evaluation.steady and evaluation.status == "invalid"
    assert evaluation.cost_of_transport is None


@pytest.mark.parametrize(("frequency", "duration"), [(0.01, 5.0), (1e-4, 30.0)])
def test_less_than_one_swing_has_no_frequency(frequency, duration):
    assert metrics.swim_frequency(motion(frequency=frequency, duration=duration)) is None


def test_a_control_rate_that_does_not_divide_the_physics_rate_is_refused():
    with pytest.raises(InvalidValue, match="control rate 31"):
        sb.measure(motion(drives="angle"), control_rate=31)


def test_a_thinned_trajectory_has_no_return():
    assert episode_return(motion(drives="angle").thinned(16), 30) is None


def test_a_motionless_robot_has_no_frequency():
    evaluation = sb.evaluate(sb.SinusoidalTorque(amplitude=0.0, frequency=1.0, phase=0.5), duration=2.0)
    assert evaluation.swim_frequency is None
    assert evaluation.speed == evaluation.power == evaluation.tail_amplitude == 0.0
    assert not evaluation.steady


def test_the_weights_of_the_reward_are_the_papers():
    assert Weights() == (10.0, -0.08, -0.002, -0.02, -0.005, -10_000.0)


def test_return_of_constant_motion():
    # v_x = 0.3 m/s and P = 4 W throughout, targets at zero; joint 7 moves as 0.5 sin(w t), so that its torque is
    # -(K + D d/dt) of that and changes between control steps by 2 sin(w / 60) times its amplitude.
    robot, omega = sb.Robot(), 2 * np.pi * 0.7
    stiffness, damping = robot.stiffness("angle"), robot.damping("angle")
    change = 2 * np.sin(omega / 60) * 0.5 * np.hypot(stiffness, damping * omega)
    weights = Weights()
    rate = weights.propulsion * 0.3 + weights.work * 4.0
    rate += weights.joint_rate * (0.5 * omega) ** 2 / 2 + weights.torque_rate * change**2 / 2
    assert episode_return(motion(swing=0.0, drives="angle"), 30) == pytest.approx(30 * rate, rel=2e-4)


def test_return_has_no_hole_between_the_control_steps():
    # The same distance and work in 30 s give the same return, however they are spread in time.
    even, pulsed = motion(swing=0.0, drives="angle"), motion(swing=0.25, frequency=7.5, drives="angle")
    still = {"joint_rate": np.zeros((14401, 7)), "joint_angle": np.zeros((14401, 7))}
    from dataclasses import replace

    one, other = (episode_return(replace(run, **still), 30) for run in (even, pulsed))
    assert one == pytest.approx(other, rel=1e-3)


@pytest.mark.parametrize("rate", [24, 60, 480])
def test_a_peak_between_rows_is_found_to_fourth_order(rate):
    # The crest of sin(2 pi t) + 0.3 sin(4 pi t + 1), found on a fine grid, against the one found from coarse rows.
    wave = lambda t: np.sin(2 * np.pi * t) + 0.3 * np.sin(4 * np.pi * t + 1)  # noqa: E731
    fine = np.linspace(0, 1, 2_000_001)
    true = fine[np.argmax(wave(fine))]
    rows = (np.arange(3 * rate) + 0.37) / rate
    k = rate + int(np.argmax(wave(rows[rate : 2 * rate])))
    found = (metrics._crest(wave(rows), k) + 0.37) / rate - 1
    assert abs(found - true) < 3 * (2 * np.pi / rate) ** 4 / 24 + 1e-6


@pytest.mark.parametrize("rate", [24, 60, 480])
def test_a_value_between_rows_is_found_to_fourth_order(rate):
    t = np.arange(2 * rate) / rate
    for place in (0.2, 3.7, rate + 0.5, 2 * rate - 1.3):
        expected = np.sin(2 * np.pi * place / rate)
        assert abs(metrics._between(np.sin(2 * np.pi * t), place) - expected) < (2 * np.pi / rate) ** 4 / 16


def test_without_four_rows_a_value_is_interpolated_linearly():
    assert metrics._between(np.array([1.0, 3.0]), 0.25) == 1.5


def test_stray_is_the_widest_angle_of_travel():
    straight = motion(duration=20.0)
    way = straight.center[:, 0]
    bent = replace(straight, center=np.column_stack([way, -np.tan(0.5) * np.maximum(way - way[-1] / 2, 0.0)]))
    assert metrics.stray(straight) == 0.0 and metrics.stray(bent) == pytest.approx(0.5)
    assert metrics.stray(motion(duration=2.0, course=0.3)) == pytest.approx(0.3)
