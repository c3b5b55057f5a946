"""Recovery after a change of the fluid, on made-up motions, whose figures are known in closed form."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from snakebench.fluid import Fluid, FluidField
from snakebench.studies.adaptation.recovery import ideal_swim, period_speed, recovery

RATE = 200.0
THIN, THICK = Fluid(kinematic_viscosity=1e-6), Fluid(kinematic_viscosity=1e-3)


def motion(speeds):
    """The way made at a speed at each of the times 0, 1/RATE, ... [m]."""
    return np.concatenate([[0.0], np.cumsum(speeds)]) / RATE


def stages(*lengths_and_speeds):
    return motion(np.concatenate([np.full(round(length * RATE), speed) for length, speed in lengths_and_speeds]))


@pytest.mark.parametrize(
    ("before", "after", "tau", "period"), [(0.6, 0.1, 1.5, 0.8), (0.1, 0.6, 2.0, 1.3), (0.3, 0.2, 4.0, 0.5)]
)
def test_an_exponential_approach_is_back_when_its_period_mean_is_within_5_percent(before, after, tau, period):
    start, end = 10.0, 40.0
    time = np.arange(round(end * RATE) + 1) / RATE
    since = np.maximum(time - start, 0.0)
    position = np.where(
        time < start,
        before * time,
        before * start + after * since + (before - after) * tau * (1 - np.exp(-since / tau)),
    )
    distance = abs(before - after) * tau / period * (1 - np.exp(-period / tau))  # of the first period's mean
    moment = tau * np.log(distance / (0.05 * after))
    back = recovery(position, RATE, start, end, period, after)
    assert moment > 0
    assert back["seconds"] == pytest.approx(moment + period, abs=1 / RATE)
    length = end - period - start
    assert back["held"] == pytest.approx((length - moment) / length, abs=2 / RATE / length)
    whole = (end - start) // period * period
    assert back["loss"] == pytest.approx((after - before) * tau * (1 - np.exp(-whole / tau)))


@pytest.mark.parametrize("period", [0.4, 1.0, 3.0])
def test_no_swimmer_is_back_before_its_period_ends(period):
    unchanged = stages((10, 0.2), (20, 0.2))
    assert recovery(unchanged, RATE, 10.0, 30.0, period, 0.2)["seconds"] == pytest.approx(period)


def test_the_loss_is_over_whole_periods_and_negative_where_a_swimmer_glides():
    slow, fast = (stages((10, 0.3), (1, speed), (19, 0.2)) for speed in (0.0, 0.5))
    assert recovery(slow, RATE, 10.0, 30.0, 3.0, 0.2)["loss"] == pytest.approx(0.2)
    assert recovery(fast, RATE, 10.0, 30.0, 3.0, 0.2)["loss"] == pytest.approx(-0.3)
    late = stages((28.5, 0.2), (1.5, 0.0))  # after 6 whole periods
    assert recovery(late, RATE, 10.0, 30.0, 3.0, 0.2)["loss"] == pytest.approx(0.0)


def test_one_that_never_comes_back_has_no_recovery():
    back = recovery(stages((10, 0.5), (20, 0.22)), RATE, 10.0, 30.0, 1.0, 0.2)
    assert np.isnan(back["seconds"]) and back["held"] == 0


def test_one_that_leaves_again_later_is_back_but_not_held():
    position = stages((10, 0.5), (12, 0.2), (8, 0.1))
    back = recovery(position, RATE, 10.0, 30.0, 1.0, 0.2)
    assert back["seconds"] == 1.0
    leaves = 11.0 + 0.1  # a period that begins so late has 0.1 s, and with it 5 % of its mean, in the slower part
    assert back["held"] == pytest.approx(leaves / 19.0, abs=2 / RATE)


def test_a_brief_return_is_no_recovery():
    position = stages((10, 0.5), (3, 0.2), (4, 0.1), (13, 0.2))
    back = recovery(position, RATE, 10.0, 30.0, 1.0, 0.2)
    assert back["seconds"] == pytest.approx(8.0 - 0.1, abs=2 / RATE)  # a period with 0.1 s of the slower part will do


def test_nothing_is_known_of_a_fluid_that_lasts_less_than_a_period():
    back = recovery(stages((10, 0.5), (1, 0.2)), RATE, 10.0, 11.0, 2.0, 0.2)
    assert np.isnan([*back.values()]).all()


def test_the_mean_over_a_period_does_not_beat_with_the_gait():
    time = np.arange(2000) / RATE
    position = 0.3 * time + 0.05 * np.sin(2 * np.pi * time / 0.8)
    assert period_speed(position, RATE, 0.8) == pytest.approx(0.3)


def steady(*rows):
    """A swimmer's speed and powers at viscosities."""
    return pd.DataFrame(rows, columns=["viscosity", "speed", "power", "positive_power"])


SWIMMER = steady((1e-6, 0.5, 8.0, 9.0), (1e-3, 0.2, 12.0, 15.0))


def test_an_ideal_swim_in_one_fluid_is_speed_times_time():
    assert ideal_swim(THIN, 30.0, -0.7, [SWIMMER]) == pytest.approx((0.5 * 30, 8.0 * 30, 9.0 * 30))


def test_an_ideal_swim_through_a_change_in_time_is_the_sum_of_both():
    field = FluidField(along="time", knots=(0.0, 20.0), fluids=(THIN, THICK), between="step")
    sums = (0.5 * 20 + 0.2 * 30, 8.0 * 20 + 12.0 * 30, 9.0 * 20 + 15.0 * 30)
    assert ideal_swim(field, 50.0, 0.0, [SWIMMER]) == pytest.approx(sums)


def test_an_ideal_swim_along_the_way_takes_its_time_to_the_change():
    field = FluidField(along="x", knots=(0.0, 4.0), fluids=(THIN, THICK), between="step")
    until = (4.0 - (-0.7)) / 0.5
    distance, work, _ = ideal_swim(field, 30.0, -0.7, [SWIMMER])
    late = 0.02  # it may learn of the change a step of the sum later [s]
    assert distance == pytest.approx(4.7 + 0.2 * (30 - until), abs=(0.5 - 0.2) * late)
    assert work == pytest.approx(8.0 * until + 12.0 * (30 - until), abs=(12 - 8) * late)


def test_between_viscosities_it_is_exact_at_the_rows_and_linear_in_the_logarithm():
    rows = steady((1e-2, 0.1, 9.0, 12.0), (1e-6, 0.6, 5.0, 6.0), (1e-4, 0.4, 6.0, 8.0))
    for viscosity, *values in [*rows.to_numpy().tolist(), (1e-5, 0.5, 5.5, 7.0)]:
        assert ideal_swim(Fluid(kinematic_viscosity=viscosity), 1.0, 0.0, [rows]) == pytest.approx(values)


def test_switching_takes_the_fastest_that_is_known():
    quick, diverged, slow = (
        steady((1e-6, *values)) for values in ((0.3, 5.0, 6.0), (np.nan, np.nan, np.nan), (0.2, 9.0, 9.0))
    )
    for gaits in ([quick, diverged, slow], [slow, diverged, quick]):
        assert ideal_swim(THIN, 1.0, 0.0, gaits) == pytest.approx((0.3, 5.0, 6.0))
