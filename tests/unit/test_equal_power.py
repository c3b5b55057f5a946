"""Fronts as lines, and what they are at equal power, against closed forms."""

from __future__ import annotations

import moocore
import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st

from snakebench.report.equal_power import fastest_within, powers_needed, speeds_within, top_power
from snakebench.studies.indicators import hypervolume

REFERENCE = (0.0, 30.0)
points_of = st.lists(st.tuples(st.integers(0, 12), st.integers(1, 12)), min_size=1, max_size=25).map(
    lambda rows: np.array(rows, float)
)


def front(*points, **columns):
    """Points of speed and P; their P+ is three times as much."""
    speed, power = np.array(points, float).T
    return pd.DataFrame({"speed": speed, "power": power, "positive_power": 3 * power} | columns)


def test_neighbours_are_joined_up_to_twice_the_power_and_a_step_is_across_more():
    points = front((0.1, 1.0), (0.3, 2.0), (0.4, 5.0))
    assert speeds_within(points, np.array([1.0, 1.5, 2.0, 4.9, 5.0])) == pytest.approx([0.1, 0.2, 0.3, 0.3, 0.4])


def test_a_front_is_extrapolated_neither_below_its_least_power_nor_beyond_its_fastest_point():
    points = front((0.1, 1.0), (0.2, 2.0))
    assert speeds_within(points, np.array([0.99, 50.0])) == pytest.approx([np.nan, 0.2], nan_ok=True)
    assert fastest_within(points, 0.99).empty and top_power(points) == 2.0
    assert fastest_within(points, 50.0)[["speed", "power"]].to_numpy().tolist() == [[0.2, 2.0]]


def test_points_that_others_dominate_and_points_without_a_number_are_not_on_the_line():
    points = front((0.1, 1.0), (0.05, 1.5), (0.1, 1.6), (0.2, 2.0), (0.9, np.nan), (np.nan, 1.1))
    assert speeds_within(points, np.array([1.5])) == pytest.approx([0.15])


def test_a_row_at_a_power_has_both_powers_there_and_names_of_the_point_before():
    points = front((0.1, 1.0), (0.2, 2.0), (0.3, 8.0), gait=["slow", "middle", "fast"])
    between, step = fastest_within(points, 1.25), fastest_within(points, 5.0)
    assert between.to_dict("list") == {
        "speed": [pytest.approx(0.125)],
        "power": [1.25],
        "positive_power": [3.75],
        "gait": ["slow"],
    }
    assert step[["speed", "power", "gait"]].to_numpy().tolist() == [[0.2, 2.0, "middle"]]


def test_each_group_has_a_front_of_its_own():
    points = front((0.1, 1.0), (0.3, 2.0), (0.5, 2.0), (0.2, 9.0), seed=[0, 0, 1, 2])
    found = fastest_within(points, 2.0, ["seed"]).set_index("seed")["speed"]
    assert found.to_dict() == {0: 0.3, 1: 0.5}


def test_a_front_of_positive_power_is_of_the_points_that_need_least_of_it():
    points = front((0.1, 1.0), (0.3, 2.0)).assign(positive_power=[4.0, 3.0])
    assert speeds_within(points, np.array([3.0, 4.0]), "positive").tolist() == [0.3, 0.3]
    assert np.isnan(speeds_within(points, np.array([2.9]), "positive"))


@given(points_of, st.integers(0, 13))
def test_the_power_of_a_speed_and_the_speed_of_a_power_are_inverse(points, speed):
    table = front(*points)
    power = powers_needed(table, np.array([float(speed)]))
    slowest, fastest = speeds_within(table, np.array([points[:, 1].min(), 1e9]))
    assert np.isnan(power).item() == (not slowest <= speed <= fastest)
    if not np.isnan(power):
        just_less = speeds_within(table, power * (1 - 1e-9))
        assert speeds_within(table, power) >= speed - 1e-9
        assert np.isnan(just_less) or just_less <= speed + 1e-9


@given(points_of)
def test_the_area_below_a_staircase_is_what_the_points_dominate(points):
    assert hypervolume(points, (0.0, 10.0), widest=1) == pytest.approx(
        moocore.hypervolume(points, ref=(0.0, 10.0), maximise=[True, False])
    )


@given(points_of, st.integers(0, 12), st.integers(1, 13))
def test_the_area_below_a_line_is_at_least_that_below_its_staircase(points, speed, power):
    reference = (float(speed), float(power))
    staircase = hypervolume(points, reference, widest=1)
    assert staircase - 1e-9 <= hypervolume(points, reference) <= hypervolume(points, reference, widest=np.inf) + 1e-9


def test_the_area_below_a_straight_front_is_a_trapezoid_and_a_rectangle():
    points = np.array([[0.2, 10.0], [0.4, 20.0]])
    assert hypervolume(points, REFERENCE) == pytest.approx(10 * 0.3 + 10 * 0.4)
    # From 0.3 m/s, which it passes at 15 W, to 18 W, where it has 0.36 m/s: a triangle.
    assert hypervolume(points, (0.3, 18.0)) == pytest.approx(3 * 0.06 / 2)
    assert hypervolume(points, (0.4, 30.0)) == hypervolume(points, (0.0, 10.0)) == 0
    assert hypervolume(points[:0], REFERENCE) == 0


def test_the_area_below_a_quarter_circle_converges_to_its_own_at_second_order():
    def area(n):
        angle = np.linspace(0, np.pi / 2, n + 1)
        return hypervolume(np.column_stack([np.sin(angle), 2 - np.cos(angle)]), (0.0, 2.0))

    errors = [np.pi / 4 - area(n) for n in (20, 40, 80)]
    assert errors[0] / errors[1] == pytest.approx(4, rel=0.01) and errors[1] / errors[2] == pytest.approx(4, rel=0.01)
    assert 0 < errors[2] < 1e-3
