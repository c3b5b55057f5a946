"""Envelopes, the distribution of power, and ideal switching of the limit, on fronts whose optima are known."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

import snakebench as sb
from snakebench.collocation import front as published_limit
from snakebench.collocation.ideal import (
    LimitFront,
    at_power,
    distributed,
    envelope,
    ideal_curve,
    limit_front,
    upper_hull,
)
from snakebench.fluid import Fluid, FluidField

POWERS = np.linspace(0.0, 40.0, 401)  # [W], fine enough for a square root between them
NU = 1e-6, 1e-3
FLUIDS = tuple(Fluid(kinematic_viscosity=nu) for nu in NU)
A = 0.2, 0.05  # v = a √P in the two fluids [m/s/√W]
ROOTS = LimitFront(np.array(NU), POWERS, np.outer(A, np.sqrt(POWERS)))
START, DURATION = -0.7, 60.0


def test_an_envelope_has_its_corners_only():
    power, value = np.array([2.0, 0.0, 1.0, 1.0, 3.0, 4.0]), np.array([2.0, 0.0, 1.5, 1.0, 2.2, 2.1])
    assert upper_hull(power, value).tolist() == [1, 2, 0, 4]  # 1 W has two values; at 4 W the value is lower again


def test_no_point_lies_above_the_envelope_of_all():
    power, value = np.random.default_rng(0).uniform(size=(2, 200))
    rising = at_power(envelope(power, value), power)
    assert (value <= rising + 1e-12).all()


def test_an_envelope_leaves_out_what_is_not_known():
    assert envelope(np.array([1.0, np.nan, 2.0]), np.array([1.0, 5.0, np.nan])).tolist() == [[1.0, 1.0]]


def test_a_curve_has_no_value_below_its_least_power_and_stays_beyond_its_largest():
    values = at_power(np.array([(1.0, 0.2), (3.0, 0.4)]), np.array([0.9, 2.0, 5.0]))
    np.testing.assert_allclose(values, [np.nan, 0.3, 0.4])


def test_power_goes_where_the_next_watt_is_worth_most():
    steep, flat = np.array([(0.0, 0.0), (1.0, 2.0)]), np.array([(0.0, 0.0), (2.0, 1.0)])
    np.testing.assert_allclose(distributed([flat, steep], np.array([0.5, 0.5])), [(0, 0), (0.5, 1.0), (1.5, 1.5)])


@pytest.mark.parametrize("power", [0.5, 4.0, 9.0])
def test_in_two_fluids_with_square_root_fronts_the_split_is_that_of_the_closed_form(power):
    """Equal marginal speeds give powers in the ratio of a², so that D = T √(P Σ w a²)."""
    course = FluidField(along="time", knots=(0.0, 20.0), fluids=FLUIDS, between="step")
    weights = np.array([20.0, 40.0]) / DURATION
    distance = DURATION * np.sqrt(power * np.sum(weights * np.square(A)))
    assert at_power(ideal_curve(ROOTS, course, DURATION, START), power) == pytest.approx(distance, rel=1e-3)


@pytest.mark.parametrize("power", [0.5, 4.0, 9.0])
def test_along_x_with_square_root_fronts_equal_power_everywhere_is_best(power):
    """To minimise (r + P) / (a √P) takes P = r, whatever a is."""
    course = FluidField(along="x", knots=(0.0, 5.0), fluids=FLUIDS, between="step")
    fast, slow = np.array(A) * np.sqrt(power)
    distance = min(fast * DURATION, 5.7 + slow * max(DURATION - 5.7 / fast, 0.0))
    assert at_power(ideal_curve(ROOTS, course, DURATION, START), power) == pytest.approx(distance, rel=5e-3)


def test_more_power_is_worth_spending_before_a_thick_fluid_that_comes_with_time():
    course = FluidField(along="time", knots=(0.0, 30.0), fluids=FLUIDS, between="step")
    constant = DURATION / 2 * sum(A) * np.sqrt(4.0)
    assert at_power(ideal_curve(ROOTS, course, DURATION, START), 4.0) > 1.1 * constant


def limit(**changes):
    rows = [
        {"viscosity": nu, "currency": "net", "bounds": "policies", "bound": 1.0, "speed_limit": np.nan}
        | {"power": power, "positive_power": 2 * power, "speed": a * power**0.5}
        for nu, a in zip(NU, A, strict=True)
        for power in (1.0, 4.0)
    ]
    return pd.DataFrame(rows).assign(**changes)


def test_between_rows_it_is_the_published_limit_and_from_rest_a_line(monkeypatch):
    rows = [limit(power=p, speed=limit()["speed"] * np.sqrt(p)).iloc[::2] for p in (1.0, 2.0, 5.0, 9.0)]
    table = pd.concat(rows).assign(change=0.0, gap=0.0, planar_gap=0.0, multiplier=1.0)
    monkeypatch.setattr(published_limit, "_published", lambda: table)
    front = limit_front(table, "net", 1.0)
    for nu, power in [(3e-5, 1.4), (NU[0], 3.0), (NU[1], 8.0)]:
        expected = sb.limit(Fluid(kinematic_viscosity=nu), power).speed
        assert np.interp(power, front.power, front.at(np.array([nu]))[0]) == pytest.approx(expected, rel=1e-3)
    speeds = front.at(np.array([NU[0], 1e-9]))
    assert np.interp(0.5, front.power, speeds[0]) == pytest.approx(A[0] / 2)
    np.testing.assert_allclose(speeds[1], speeds[0])  # outside the range it stays


def test_a_front_of_the_limit_is_of_one_currency_and_one_bound_without_a_speed_limit():
    others = [limit(speed_limit=3.0), limit(bound=1.75), limit(bounds="held"), limit(currency="positive")]
    rows = pd.concat([limit(), *(other.assign(speed=9.0) for other in others)])
    assert limit_front(rows, "net", 1.0).speed.max() == pytest.approx(0.4)
    assert limit_front(rows, "positive", 1.0).power[[0, 1, -1]] == pytest.approx([0.0, 2.0, 8.0])
    assert limit_front(rows, "net", 1.5) is None
