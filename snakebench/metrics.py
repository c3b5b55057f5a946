"""Trajectory to numbers: one function a metric, over one window of steady swimming (paper, evaluation setup).

A window is a whole number of gait periods, or half of one where the velocity has four peaks in it, so that periodic
parts cancel. Positions and work are interpolated at its ends, which need not fall on a physics step. What springs and
links store does not cancel where a window is not quite a period: its change is no power that swimming needs (ours).
Amplitudes and turns are those of whole gait periods, the mean over those in the window, or the last one of the run if
there is none (ours): a slow drift over many periods is none.
"""

import math
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from numpy.polynomial import Polynomial
from scipy.integrate import cumulative_trapezoid
from scipy.signal import find_peaks
from scipy.signal.windows import hann

from snakebench.physics.kinematics import link_rates
from snakebench.trajectory import Trajectory
from snakebench.value import FloatArray

GRAVITY = 9.80665  # [m/s^2]
_SETTLED = 0.02  # largest relative change of speed and power against the window before, to count as steady (ours)
_EXCHANGED = 1e-3  # changes of power below this share of the positive power do not matter (ours)
_STILL = 1e-4  # changes of speed below this do not matter [m/s] (ours)
_CLEAR = 0.25  # least prominence of a velocity peak, as a share of the velocity's range (ours)
_EVEN = 0.15  # largest relative difference between the two intervals of three peaks (ours)
_FINEST = 1e-6  # oscillations below this are numerical noise [rad or m/s]
_LEAST_SWING = 0.02  # of the widest swing: a joint that swings less has no phase to speak of
_SHORT = 0.05  # of a gait period that a window may lack to hold a whole one (ours)


class Window(NamedTuple):
    """The part of a run that is measured."""

    start: float  # [s]
    end: float  # [s]
    steady: bool  # between three clear peaks of a velocity that has settled

    @property
    def duration(self) -> float:
        """Length of the window [s]."""
        return self.end - self.start


def spectrum(signal: FloatArray, rate: float) -> tuple[FloatArray, FloatArray]:
    """Frequencies [Hz] and amplitudes [unit of the signal] of a Hann-windowed FFT, zero-padded."""
    window = hann(len(signal), sym=False)
    amplitude = 2 * np.abs(np.fft.rfft((signal - signal.mean()) * window, 8 * len(signal))) / window.sum()
    return np.fft.rfftfreq(8 * len(signal), 1 / rate).astype(np.float64), amplitude


def settled_angle(trajectory: Trajectory) -> FloatArray:
    """The last joint's angle over the last two thirds of a run [rad], whose spectrum tells the swimming frequency."""
    return trajectory.joint_angle[len(trajectory.joint_angle) // 3 :, -1]


def swim_frequency(trajectory: Trajectory) -> float | None:
    """Dominant frequency of the last joint's angle [Hz]: the interpolated peak of its FFT over the last two thirds.

    None when the joint does not move, or swings less than once in that time. The paper takes the highest FFT bin; the
    interpolation is ours.
    """
    angle = settled_angle(trajectory)
    if len(angle) < 8 or np.ptp(angle) < _FINEST:
        return None
    frequencies, amplitude = spectrum(angle, trajectory.rate)
    k = int(np.argmax(amplitude[1:-1])) + 1
    frequency = float(frequencies[k] + _vertex(np.log(amplitude[k - 1 : k + 2])) * frequencies[1])
    return frequency if frequency * len(angle) >= trajectory.rate else None


def steady_window(trajectory: Trajectory, frequency: float | None) -> Window:
    """The window between the last three peaks of the forward velocity: two cycles of it (paper, definition of v).

    Without three clear, even peaks, or before speed and power have settled, whole gait periods at the end of the run,
    as many as fit its second half, marked as not steady; the whole run if it is shorter than a period.
    """
    last = float(trajectory.time[-1])
    half = len(trajectory.time) // 2
    velocity = trajectory.center_rate[half:, 0]
    peaks, _ = find_peaks(velocity, prominence=max(_CLEAR * np.ptp(velocity), _FINEST))
    if len(peaks) >= 3:
        first, middle, end = ((half + _crest(velocity, int(k))) / trajectory.rate for k in peaks[-3:])
        window = Window(first, end, steady=True)
        even = abs((end - middle) - (middle - first)) <= _EVEN * window.duration / 2
        if even and _settled(trajectory, window):
            return window
    if frequency is None:
        return Window(last / 2, last, steady=False)
    periods = max(math.floor(last / 2 * frequency), 1)
    return Window(max(last - periods / frequency, 0.0), last, steady=False)


def speed(trajectory: Trajectory, window: Window) -> float:
    """Mean velocity of the centre of mass along x, signed: v [m/s] (paper, metric 1)."""
    return float(_gain(trajectory, trajectory.center[:, 0], window)) / window.duration


def path_speed(trajectory: Trajectory, window: Window, frequency: float | None) -> float:
    """Speed of the centre of mass along its mean course, whatever its direction [m/s] (ours).

    It is never below the speed along x; the speed across x is that of whole periods.
    """
    whole = _whole(window, frequency)
    aside = float(_gain(trajectory, trajectory.center[:, 1], whole)) / whole.duration
    return math.hypot(speed(trajectory, window), aside)


def power(trajectory: Trajectory, window: Window) -> float:
    """Mean command power P [W], braking counted as negative (paper, metric 2).

    Less what springs and links store more at the end than at the start: nothing over whole periods (ours).
    """
    work = float(_gain(trajectory, trajectory.command_work, window)) - _stored(trajectory, window)
    return work / window.duration


def positive_power(trajectory: Trajectory, window: Window) -> float:
    """Mean command power P+ [W] of the joints that drive: what a battery pays that braking does not charge (ours)."""
    return float(_gain(trajectory, trajectory.positive_work, window)) / window.duration


def cost_of_transport(power: float, speed: float, mass: float) -> float | None:
    """CoT = P / (m g v), or CoT+ of P+ [1] (paper, metric 3); None unless the robot moves forward for some power."""
    return power / (mass * GRAVITY * speed) if speed > 0 and power >= 0 else None


def command_torque_rms(trajectory: Trajectory, window: Window) -> float:
    """Root mean square of the command torque u_in of the joint where it is largest [N m] (ours)."""
    return math.sqrt(float(_mean_square_torque(trajectory, window).max()))


def command_torque_peak(trajectory: Trajectory, window: Window) -> float:
    """Largest command torque abs(u_in) of any joint [N m] (ours)."""
    return float(np.abs(trajectory.command_torque[inside(trajectory, window)]).max())


def joint_speed_peak(trajectory: Trajectory, window: Window) -> float:
    """Largest speed of any joint [rad/s] (ours)."""
    return float(np.abs(trajectory.joint_rate[inside(trajectory, window)]).max())


def heat(trajectory: Trajectory, window: Window) -> float:
    """Mean sum of all joints' squared command torque u_in [N^2 m^2] (ours).

    Motors of one kind turn as much power into heat in their windings, times a constant of the motor.
    """
    return float(_mean_square_torque(trajectory, window).sum())


def heading_drift(trajectory: Trajectory, window: Window, frequency: float | None) -> float:
    """How fast the body turns left [rad/s]: change of the links' mean angle over whole periods (ours)."""
    whole = _whole(window, frequency)
    return float(_gain(trajectory, trajectory.links[:, :, 2].mean(axis=1), whole)) / whole.duration


def tail_amplitude(trajectory: Trajectory, window: Window, frequency: float | None) -> float:
    """Half the peak-to-peak movement of the tail's tip across the swimming direction [m].

    Direction and drift are those of each gait period: across its mean course, less what the tip moves from its start
    to its end, along a line in time (ours). So neither a slow turn nor a robot that is carried aside moves its tail.
    """
    periods = _periods(window, frequency)
    return float(np.mean([_tail_swing(trajectory, part, drifts=bool(periods)) for part in periods or [window]]))


def joint_amplitude(trajectory: Trajectory, window: Window, frequency: float | None) -> float:
    """Half the peak-to-peak angle of the joint that moves most [rad] (ours)."""
    return _amplitude(trajectory, trajectory.joint_angle, window, frequency)


def torque_amplitude(trajectory: Trajectory, window: Window, frequency: float | None) -> float:
    """Half the peak-to-peak applied torque u of the joint that exerts most [N m]."""
    return _amplitude(trajectory, trajectory.torque, window, frequency)


def wave_speed(trajectory: Trajectory, frequency: float | None) -> float | None:
    """How fast the wave of bending runs along the body towards the tail [m/s] (ours).

    From the phases of all joints' angles at the swimming frequency, over the last two thirds of the run: a straight
    line through them along the body, each weighted by its amplitude. Below zero it runs towards the head. None without
    a frequency or when fewer than two joints swing.
    """
    if frequency is None:
        return None
    angles = trajectory.joint_angle[len(trajectory.joint_angle) // 3 :]
    angles = angles - angles.mean(axis=0)
    window, turns = hann(len(angles), sym=False), frequency * np.arange(len(angles)) / trajectory.rate
    swings = 2 * (window * np.exp(-2j * np.pi * turns)) @ angles / window.sum()
    swinging = np.abs(swings) > max(_FINEST, _LEAST_SWING * np.abs(swings).max())
    if swinging.sum() < 2:
        return None
    place, phase = np.cumsum(trajectory.robot.link_lengths)[:-1][swinging], np.unwrap(np.angle(swings[swinging]))
    lag = -float(np.polyfit(place, phase, 1, w=np.abs(swings[swinging]))[0])  # [rad/m]
    return 2 * np.pi * frequency / lag if lag else None


def stray(trajectory: Trajectory, stretch: float = 5.0) -> float:
    """How far the direction of travel strays from x: its largest angle over any stretch of `stretch` s [rad] (ours).

    A shorter run is one stretch.
    """
    rows = min(round(stretch * trajectory.rate), len(trajectory.time) - 1)
    x, y = (trajectory.center[rows:] - trajectory.center[: len(trajectory.center) - rows]).T
    return float(np.abs(np.arctan2(y, x)).max())


def stored_energy(trajectory: Trajectory, rows: slice = slice(None)) -> FloatArray:
    """Kinetic energy of the links and elastic energy of springs and end stops [J], shape (n_rows,).

    The added mass is the fluid's: what it carries is part of the work into the fluid.
    """
    robot, rates, angles = trajectory.robot, rates_of_links(trajectory, rows), trajectory.joint_angle[rows]
    kinetic = (rates[..., 0] ** 2 + rates[..., 1] ** 2) @ robot.link_masses + rates[..., 2] ** 2 @ robot.link_inertias
    elastic = robot.joint_stiffness * np.sum(angles**2, axis=1)
    if robot.angle_limit is not None:
        beyond = np.maximum(np.abs(angles) - robot.angle_limit, 0.0)
        elastic += robot.stop_stiffness * np.sum(beyond**2, axis=1)
    return (kinetic + elastic) / 2


def rates_of_links(trajectory: Trajectory, rows: slice) -> FloatArray:
    """Time derivatives of x, y and angle of every link in some rows, shape (n_rows, n_links, 3)."""
    head, joints = (np.ascontiguousarray(rates[rows]) for rates in (trajectory.head_rate, trajectory.joint_rate))
    rates: FloatArray = link_rates(trajectory.robot.link_lengths, trajectory.links[rows], head, joints)
    return rates


def _stored(trajectory: Trajectory, window: Window) -> float:
    """What springs and links have stored more at the end of the window than at its start [J]."""
    ends = []
    for time in (window.start, window.end):
        place = time * trajectory.rate
        first = max(min(int(place) - 1, len(trajectory.time) - 4), 0)
        ends.append(float(_between(stored_energy(trajectory, slice(first, first + 4)), place - first)))
    return ends[1] - ends[0]


def _settled(trajectory: Trajectory, window: Window) -> bool:
    """Whether speed and power are those of the window before, of equal length."""
    before = Window(2 * window.start - window.end, window.start, steady=True)
    if before.start < 0:
        return False
    little = {speed: _STILL, power: _EXCHANGED * positive_power(trajectory, window)}
    pairs = ((metric(trajectory, window), metric(trajectory, before), least) for metric, least in little.items())
    return all(abs(now - then) <= max(_SETTLED * abs(now), least) for now, then, least in pairs)


def _gain(trajectory: Trajectory, cumulated: FloatArray, window: Window) -> Any:
    """What quantities, shape (n_times, ...), gain over the window, whose ends need not fall on a row."""
    start, end = (_between(cumulated, time * trajectory.rate) for time in (window.start, window.end))
    return end - start


def _between(values: FloatArray, place: float) -> Any:
    """The cubic through the four rows around a place [rows]; linear in a shorter run."""
    first = min(max(int(place) - 1, 0), len(values) - 4)
    if first < 0:
        return np.apply_along_axis(lambda column: np.interp(place, np.arange(len(values)), column), 0, values)
    x = place - first
    a, b, c, d = values[first : first + 4]
    outer = d * x * (x - 1) * (x - 2) - a * (x - 1) * (x - 2) * (x - 3)
    return outer / 6 + (b * x * (x - 2) * (x - 3) - c * x * (x - 1) * (x - 3)) / 2


def _mean_square_torque(trajectory: Trajectory, window: Window) -> FloatArray:
    """Of each joint [N^2 m^2], shape (n_joints,)."""
    gains = [  # joint by joint: all at once would take several times the memory of the record
        _gain(trajectory, cumulative_trapezoid(u_in**2, dx=1 / trajectory.rate, initial=0), window)
        for u_in in trajectory.command_torque.T
    ]
    return np.maximum(gains, 0.0) / window.duration


def _periods(window: Window, frequency: float | None) -> list[Window]:
    """The whole gait periods in a window, one after the other from its start; none without a frequency [Hz].

    A window of less than a period begins earlier, if the run does.
    """
    if frequency is None:
        return []
    count = int(window.duration * frequency + _SHORT)
    if count == 0:
        start = window.end - 1 / frequency
        return [Window(start, window.end, window.steady)] if start >= 0 else []
    ends = [window.start + k * min(window.duration / count, 1 / frequency) for k in range(count + 1)]
    return [Window(start, end, window.steady) for start, end in pairwise(ends)]


def _whole(window: Window, frequency: float | None) -> Window:
    """The gait periods in a window, all together; the window without any."""
    periods = _periods(window, frequency)
    return Window(periods[0].start, periods[-1].end, window.steady) if periods else window


def _amplitude(trajectory: Trajectory, values: FloatArray, window: Window, frequency: float | None) -> float:
    """Half the peak-to-peak of the joint that moves most, mean over the gait periods."""
    parts = _periods(window, frequency) or [window]
    return float(np.mean([np.ptp(values[inside(trajectory, part)], axis=0) for part in parts], axis=0).max()) / 2


def _tail_swing(trajectory: Trajectory, part: Window, *, drifts: bool) -> float:
    """Half the peak-to-peak of the tail's tip across the mean course of a part of a run, less its drift [m]."""
    x, y = _gain(trajectory, trajectory.center, part)
    length, rows = math.hypot(x, y), inside(trajectory, part)
    across = np.array([-y, x]) / length if length > 0 else np.array([0.0, 1.0])
    tip = trajectory.tail_tip[rows] @ across
    if drifts:
        drift = _gain(trajectory, trajectory.tail_tip, part) @ across
        tip = tip - drift * (trajectory.time[rows] - part.start) / part.duration
    return float(np.ptp(tip)) / 2


def inside(trajectory: Trajectory, window: Window) -> slice:
    """The rows of a window, at least one."""
    start, end = np.searchsorted(trajectory.time, [window.start, window.end])
    return slice(int(start), max(int(end), int(start) + 1))


def _crest(values: FloatArray, k: int) -> float:
    """Place of the peak next to row k [rows]: of the quartic through five rows, started from a parabola's vertex."""
    place = k + _vertex(values[k - 1 : k + 2])
    near = np.arange(k - 2, k + 3)
    if near[0] < 0 or near[-1] >= len(values):
        return place
    slope = Polynomial.fit(near, values[near], 4).deriv()
    finer = float(place - slope(place) / slope.deriv()(place))
    return finer if abs(finer - k) <= 1 else place


def _vertex(three: FloatArray) -> float:
    """Offset of the vertex of the parabola through three equally spaced values, in spacings from the middle one."""
    left, middle, right = three
    bend = left - 2 * middle + right
    return float((left - right) / (2 * bend)) if bend != 0 else 0.0
