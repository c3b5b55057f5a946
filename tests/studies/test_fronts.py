"""Fronts and their indicators, against closed forms and exhaustive search."""

from __future__ import annotations

import tracemalloc
from itertools import product

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from snakebench.studies.fronts import attainment, front, simple_sum
from snakebench.studies.indicators import hypervolume, knee

REFERENCE = (0.0, 30.0)
points_of = st.lists(st.tuples(st.integers(0, 12), st.integers(0, 12)), min_size=1, max_size=25).map(
    lambda rows: np.array(rows, float)
)


def dominates(a, b) -> bool:
    return a[0] >= b[0] and a[1] <= b[1] and (a[0] > b[0] or a[1] < b[1])


@given(points_of)
def test_a_front_is_what_nothing_dominates_once_each_by_power(points):
    expected = {tuple(p) for p in points if not any(dominates(q, p) for q in points)}
    found = [tuple(p) for p in points[front(points)]]
    assert set(found) == expected and len(found) == len(expected)
    assert found == sorted(found, key=lambda p: p[1])


@given(points_of)
def test_a_dominated_point_changes_neither_front_nor_hypervolume(points):
    worse = np.vstack([points, np.add(points[:1], (-0.5, 0.5))])
    assert front(worse).tolist() == front(points).tolist()
    assert hypervolume(worse, REFERENCE) == pytest.approx(hypervolume(points, REFERENCE), rel=1e-12)


def test_a_point_with_a_nan_is_on_no_front():
    points = np.array([[np.nan, 1.0], [0.2, np.nan], [0.1, 2.0]])
    assert front(points).tolist() == [2]
    assert front(points[:2]).tolist() == []
    assert hypervolume(points[:2], REFERENCE) == 0


def test_the_hypervolume_of_points_far_apart_is_the_area_of_their_staircase():
    stairs = np.array([[0.1, 4.0], [0.3, 10.0], [0.4, 40.0]])  # the last needs more power than the reference
    assert hypervolume(stairs, REFERENCE) == pytest.approx(0.1 * (30 - 4) + 0.2 * (30 - 10))
    assert hypervolume(stairs, (0.2, 20.0)) == pytest.approx(0.1 * (20 - 10))


@given(st.lists(points_of, min_size=1, max_size=3))
def test_the_simple_sum_is_the_front_of_all_combinations(sets):
    combined, members = simple_sum(sets)
    every = np.array([np.mean(combination, axis=0) for combination in product(*sets)])
    np.testing.assert_allclose(np.unique(every[front(every)], axis=0), np.unique(combined, axis=0), atol=1e-12)
    for point, chosen in zip(combined, members, strict=True):
        parts = [points[i] for points, i in zip(sets, chosen, strict=True)]
        np.testing.assert_allclose(point, np.mean(parts, axis=0), atol=1e-12)


@given(st.integers(1, 3), st.integers(1, 10), st.integers(0, 1000))
def test_switching_is_at_least_as_good_as_one_gait_for_all(n_fluids, n_gaits, seed):
    swims = np.random.default_rng(seed).random((n_fluids, n_gaits, 2))
    shared = swims.mean(axis=0)
    switched, _ = simple_sum([points[front(points)] for points in swims])
    for point in shared[front(shared)]:
        assert any(q[0] >= point[0] - 1e-12 and q[1] <= point[1] + 1e-12 for q in switched)


def test_twenty_seven_million_combinations_fit_into_little_memory():
    random = np.random.default_rng(0)
    sets = [np.column_stack([np.sort(random.random(300)) ** 0.5, np.sort(random.random(300))]) for _ in range(3)]
    tracemalloc.start()
    combined, _ = simple_sum(sets)
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert len(combined) > 900 and peak < 100e6


def test_the_knee_is_farthest_from_the_line_through_the_ends():
    assert knee(np.array([[0.0, 0.0], [0.1, 4.0], [0.3, 5.0], [0.4, 10.0]])) == 2
    assert knee(np.array([[0.2, 3.0]])) == 0


def test_attainment_surfaces_lie_between_the_best_and_the_worst_search():
    fronts = [np.array([[0.1, 1.0], [0.3, 9.0]]), np.array([[0.2, 1.0], [0.3, 8.0]]), np.array([[0.1, 2.0]])]
    by_surface = attainment(fronts).sort_values("power").groupby("surface")[["speed", "power"]]
    assert {name: surface.to_numpy().tolist() for name, surface in by_surface} == {
        "best": [[0.2, 1.0], [0.3, 8.0]],
        "median": [[0.1, 1.0], [0.3, 9.0]],
        "worst": [[0.1, 2.0]],
    }
    assert attainment(fronts[:1]).groupby("surface").size().to_dict() == {"best": 2, "median": 2, "worst": 2}
    assert attainment([]).empty
