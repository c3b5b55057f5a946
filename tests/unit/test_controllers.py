"""Gaits against the paper's formulas."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import snakebench as sb
from snakebench.controllers import GAITS, gait_of
from snakebench.errors import InvalidValue, UnknownName

TIMES = np.linspace(0, 4, 41)


def test_sea_snake_is_the_papers_formula():
    gait = sb.SeaSnake(amplitude=0.9, frequency=0.6, phase=0.7)
    expected = 3 / 7 * 0.9 * np.sin(2 * np.pi * 0.6 * 1.3 + (7 - 3) * 0.7)
    assert gait.commands(np.array([1.3]), 7)[0, 2] == pytest.approx(expected)


def test_sinusoidal_torque_is_a_wave_from_head_to_tail():
    gait = sb.SinusoidalTorque(amplitude=3.5, frequency=0.7, phase=0.84)
    delay = 0.84 / (2 * np.pi * 0.7)
    commands = gait.commands(TIMES, 7)
    assert commands[:, 0] == pytest.approx(3.5 * np.sin(2 * np.pi * 0.7 * TIMES))
    assert gait.commands(TIMES + delay, 7)[:, 1] == pytest.approx(commands[:, 0])


@given(amplitude=st.floats(0, 1), frequency=st.floats(0.1, 2), phase=st.floats(-2, 2))
def test_a_fourier_gait_can_be_any_sea_snake_gait(amplitude, frequency, phase):
    i = np.arange(1, 8)
    shift = (7 - i) * phase
    fourier = sb.Fourier(
        frequency=frequency,
        cosine=(tuple(i / 7 * amplitude * np.sin(shift)),),
        sine=(tuple(i / 7 * amplitude * np.cos(shift)),),
    )
    sea_snake = sb.SeaSnake(amplitude=amplitude, frequency=frequency, phase=phase)
    assert fourier.commands(TIMES, 7) == pytest.approx(sea_snake.commands(TIMES, 7), abs=1e-9)


def test_fourier_targets_are_clipped_like_actions():
    gait = sb.Fourier(frequency=1.0, cosine=((3.0, 0.2),), sine=((0.0, 0.0),))
    commands = gait.commands(TIMES, 2)
    assert commands[:, 0].max() == 1.0 and commands[:, 0].min() == -1.0
    assert abs(commands[:, 1]).max() < 1


def test_a_replayed_waveform_repeats_and_joins_its_ends():
    gait = sb.ReplayedTorque(period=2.0, torque=((0.0,), (1.0,), (0.0,), (-1.0,)))
    assert gait.commands(np.array([0.25, 0.5, 1.75, 2.25, 20.5]), 1)[:, 0] == pytest.approx([0.5, 1, -0.5, 0.5, 1])


KNOTS = sb.PeriodicTargets(period=2.0, targets=((0.0,), (3.0,), (0.0,), (-3.0,)))


def test_periodic_targets_are_linear_between_knots_repeat_and_are_not_clipped():
    commands = KNOTS.commands(np.array([0.25, 0.5, 1.75, 2.25, 20.5]), 1)[:, 0]
    assert commands == pytest.approx([1.5, 3.0, -1.5, 1.5, 3.0])


def test_a_controller_holds_periodic_targets_of_the_middle_of_each_step_or_of_each_knot():
    held, stepped = KNOTS.held(4.0, 1.0), KNOTS.stepped(4.0, 3.0)
    assert held.rate == stepped.rate == 4.0
    assert np.ravel(held.targets) == pytest.approx([0.75, 2.25, 2.25, 0.75])
    assert np.ravel(stepped.targets).tolist() == [0, 0, 3, 3, 0, 0, -3, -3, 0, 0, 3, 3]
    with pytest.raises(InvalidValue, match=r"knots 1.5 control steps apart: whole control steps are needed"):
        KNOTS.stepped(3.0, 1.0)


def test_held_targets_are_clipped_and_the_last_row_stays():
    gait = sb.HeldTargets(rate=2.0, targets=((0.5,), (3.0,), (-3.0,)))
    assert gait.commands(np.array([0.0, 0.49, 0.51, 1.01, 9.0]), 1)[:, 0].tolist() == [0.5, 0.5, 1.0, -1.0, -1.0]


@pytest.mark.parametrize(
    "gait",
    [
        sb.Fourier(frequency=1.0, cosine=((0.1, 0.2),), sine=((0.1, 0.2),)),
        sb.ReplayedTorque(period=1.0, torque=((0.1, 0.2), (0.0, 0.0))),
    ],
)
def test_a_gait_made_for_other_joints_is_refused(gait):
    with pytest.raises(InvalidValue, match="2 joints, the robot has 7"):
        sb.simulate(gait, duration=1.0)


@pytest.mark.parametrize(
    "fields",
    [
        {"amplitude": -1.0},
        {"frequency": 0.0},
        {"frequency": float("inf")},
        {"phase": float("nan")},
        {"amplitude": "much"},
    ],
)
@pytest.mark.parametrize("gait", [sb.SeaSnake, sb.SinusoidalTorque])
def test_impossible_gaits_are_refused(gait, fields):
    with pytest.raises(InvalidValue, match=next(iter(fields))):
        gait(**({"amplitude": 0.5, "frequency": 0.5, "phase": 0.5} | fields))


def test_ragged_waveforms_are_refused():
    with pytest.raises(InvalidValue, match="shape"):
        sb.Fourier(frequency=1.0, cosine=((0.1, 0.2),), sine=((0.1,),))
    with pytest.raises(InvalidValue, match=r"torque = .*: as many joints in every row are needed"):
        sb.ReplayedTorque(period=1.0, torque=((0.1, 0.2), (0.1,)))


def test_a_gait_is_found_by_its_kind():
    assert {kind: GAITS[kind].model_fields["kind"].default for kind in GAITS} == {kind: kind for kind in GAITS}
    fields = {"amplitude": 0.9, "frequency": 0.6, "phase": 0.7}
    assert gait_of({"kind": "sea-snake"} | fields) == sb.SeaSnake(**fields)
    with pytest.raises(UnknownName, match="did you mean sea-snake"):
        gait_of({"kind": "seasnake"} | fields)
    with pytest.raises(InvalidValue, match="a gait needs a kind: sea-snake"):
        gait_of(fields)


def test_equal_gaits_have_equal_digests():
    one, same, other = (sb.SeaSnake(amplitude=a, frequency=0.5, phase=0.5) for a in (0.5, 0.5, 0.6))
    torque = sb.SinusoidalTorque(amplitude=0.5, frequency=0.5, phase=0.5)
    assert one.digest() == same.digest()
    assert len({one.digest(), other.digest(), torque.digest()}) == 3
