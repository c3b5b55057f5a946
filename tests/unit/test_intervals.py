"""Intervals contain the spread of both sides of a comparison, and the largest error that the engines may have made."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from scipy import stats

from snakebench.comparison.bounds import bounded, by_sign, search_gap, shifted
from snakebench.comparison.results import Measurement, Rows
from snakebench.report.intervals import comparison_interval, confidence_interval
from snakebench.studies.published import Published

OURS, THEIRS = np.array([0.5, 0.7, 0.4, 0.8, 0.6]), np.array([0.30, 0.20, 0.45])
MANIFEST = {"versions": {"snakebench": "2.0.0"}, "config": {}}


def welch():
    return tuple(stats.ttest_ind(OURS, THEIRS, equal_var=False).confidence_interval())


def test_the_interval_of_a_difference_of_two_means_is_welchs():
    assert confidence_interval(OURS, -THEIRS) == pytest.approx(welch())


def test_comparing_every_seed_with_every_seed_gives_welchs_interval_of_the_difference():
    differences = np.subtract.outer(OURS, THEIRS)
    assert comparison_interval(differences.mean(axis=1), differences.mean(axis=0)) == pytest.approx(welch())


def test_an_opponent_of_one_seed_or_none_adds_no_width():
    alone = confidence_interval(OURS)
    assert comparison_interval(OURS) == comparison_interval(OURS, [OURS.mean()]) == alone
    assert comparison_interval([0.5]) is None


@pytest.mark.parametrize(("n", "m"), [(5, 3), (5, 5), (5, 1)])
def test_an_interval_covers_the_true_gain_in_about_95_of_100_cases(n, m):
    stream, cases, covered = np.random.default_rng(1), 2000, 0
    for _ in range(cases):
        own = stream.normal(0.6, 0.02, n)
        other = stream.normal(0.4, 0.02, m) if m > 1 else np.array([0.4])
        gains = np.subtract.outer(own, other)
        low, high = comparison_interval(gains.mean(axis=1), gains.mean(axis=0))
        covered += low <= 0.2 <= high
    assert 0.935 <= covered / cases <= 0.975


def test_without_the_opponents_seeds_the_interval_would_be_too_narrow():
    gains = np.subtract.outer(OURS, THEIRS)
    (low, high), (narrow_low, narrow_high) = (
        comparison_interval(gains.mean(axis=1), gains.mean(axis=0)),
        comparison_interval(gains.mean(axis=1)),
    )
    assert low < narrow_low and high > narrow_high


def swims(**columns):
    return pd.DataFrame({"seed": [0, 1], "status": "ok", "speed": [0.5, 0.6], "power": [5.0, 8.0]} | columns)


def test_the_bounds_of_a_swim_are_those_of_its_evaluation():
    rows = swims(speed_error=[0.01, 0.02], power_error=[0.03, np.nan])
    found = bounded({"swims": rows}, "swims")
    assert found["speed_bound"].tolist() == [0.01, 0.02] and found["power_bound"].tolist() == [0.03, 0.0]


def test_without_them_they_are_the_difference_to_the_coarser_step_of_the_same_swim():
    fine, coarse = (swims(variant=f"{name} step") for name in ("finer", "coarser"))
    coarse = coarse.assign(speed=[0.495, 0.63], power=[5.5, 8.0]).iloc[::-1]
    order = ["seed", "variant", "status", "speed", "power"]
    table = pd.concat([coarse, fine], ignore_index=True)[order]
    found = bounded({"swims": table}, "swims").query("variant == 'finer step'")
    assert found["speed_bound"].tolist() == pytest.approx([0.01, 0.05])
    assert found["power_bound"].tolist() == pytest.approx([0.1, 0.0])


def test_those_of_a_point_of_a_front_are_the_difference_between_the_engines():
    fronts = swims(speed_searched=[0.4, 0.6], power_searched=[5.0, 10.0])
    found = bounded({"fronts": fronts}, "fronts")
    assert found["speed_bound"].tolist() == pytest.approx([0.25, 0.0])
    assert found["power_bound"].tolist() == pytest.approx([0.0, 0.2])


def test_those_of_ideal_switching_are_of_the_means_over_the_points_combined():
    fronts = pd.DataFrame(
        {"space": "paper", "front": ["water", "oil2"], "currency": "net", "point": 0, "speed": [0.4, 0.1]}
    )
    fronts = fronts.assign(power=[6.0, 2.0], speed_searched=[0.44, 0.1], power_searched=[6.0, 1.0])
    switching = pd.DataFrame({"space": "paper", "currency": "net", "point": 0, "speed": 0.25, "power": 4.0}, index=[7])
    switching = switching.assign(water_point=0, oil2_point=0)
    found = bounded({"fronts": fronts, "switching": switching}, "switching").iloc[0]
    water = 0.04 / 0.44  # relative to what was searched, of the faster point
    assert found["speed_bound"] == pytest.approx((0.4 * water + 0.1 * 0.0) / 0.5)
    assert found["power_bound"] == pytest.approx((6.0 * 0.0 + 2.0 * 1.0) / 8.0)


def test_what_is_better_by_its_bounds_is_faster_at_less_power():
    rows = swims(positive_power=[6.0, 9.0], cost_of_transport=[1.0, 2.0], speed_bound=0.02, power_bound=0.1)
    better, worse = shifted(rows, 1), shifted(rows, -1)
    assert better["speed"].tolist() == pytest.approx([0.51, 0.612])
    assert better["power"].tolist() == pytest.approx([4.5, 7.2])
    assert worse["positive_power"].tolist() == pytest.approx([6.5, 9.8])
    assert better["cost_of_transport"].tolist() == pytest.approx([1.0 * 0.9 / 1.02, 2.0 * 0.9 / 1.02])
    pd.testing.assert_frame_equal(shifted(rows, 0), rows)


def measured(values) -> Measurement:
    study = Published(Path("results/study"), MANIFEST, {})
    return Rows(pd.DataFrame(), study, "study/table.csv", "", [], pd.DataFrame).measure("a", "%", values)


def test_the_engines_error_widens_an_interval_by_what_the_mean_could_change():
    def gains(sign):
        return pd.DataFrame(np.divide.outer(OURS * (1 + 0.01 * sign), THEIRS * (1 - 0.02 * sign)))

    found, exact = measured(by_sign(gains)), measured(gains(0))
    largest = exact.mean * (1.01 / 0.98 - 1)
    assert found.error == pytest.approx(largest) and exact.error == 0
    assert found.interval == pytest.approx((exact.interval[0] - largest, exact.interval[1] + largest))


def test_a_single_value_has_an_interval_if_the_engines_error_is_known():
    value = pd.Series([2.0])
    assert measured(value).interval is None
    assert measured({0: value, 1: value + 0.1, -1: value - 0.3}).interval == pytest.approx((1.7, 2.3))


def test_the_best_of_several_searches_is_as_uncertain_as_what_its_worst_seed_and_the_grid_attain():
    point = {
        "space": "paper",
        "front": "water",
        "currency": "net",
        "speed": 0.5,
        "power": 4.0,
        "speed_searched": 0.5,
        "power_searched": 4.0,
    }
    fronts = pd.DataFrame([point, point | {"front": "oil2"}, point | {"space": "other"}])
    worst = {"space": "paper", "objective": ["water", "oil2"], "surface": "worst", "speed": [0.40, 0.45], "power": 3.0}
    worst = pd.DataFrame(worst | {"currency": "net"})
    attainment = pd.concat([worst, worst.assign(surface="best", speed=0.5)])
    grid = {"space": "paper", "fluid": ["water", "water", "oil2"], "speed": [0.46, 0.9, 0.1], "power": [4.0, 5.0, 1.0]}
    tables = {"fronts": fronts, "attainment": attainment, "grid": pd.DataFrame(grid).assign(status="ok")}
    # In water the grid's 0.46 m/s at 4 W, in oil2 the worst seed's 0.45 m/s; of the other space no seeds are known.
    assert search_gap(tables).to_numpy() == pytest.approx([1 - 0.46 / 0.5, 1 - 0.45 / 0.5, np.nan], nan_ok=True)
    assert bounded(tables, "fronts")["speed_bound"].tolist() == pytest.approx([0.08, 0.1, 0.0])


def test_the_grid_of_an_integrated_front_is_of_means_over_the_fluids():
    gaits = [(1.0, "water", 0.5, 4.0), (1.0, "oil2", 0.3, 2.0), (2.0, "water", 0.9, 1.0)]  # the last swims in one fluid
    grid = pd.DataFrame(gaits, columns=["amplitude", "fluid", "speed", "power"]).assign(status="ok", space="paper")
    point = {"space": "paper", "front": "integrated", "currency": "net", "speed_searched": 0.5, "power_searched": 3.0}
    worst = {"space": "paper", "objective": "integrated", "surface": "worst", "speed": 0.1, "power": 0.1}
    worst |= {"currency": "net"}
    tables = {"fronts": pd.DataFrame([point]), "attainment": pd.DataFrame([worst]), "grid": grid}
    assert search_gap(tables).to_numpy() == pytest.approx([1 - 0.4 / 0.5])


def test_the_gap_of_a_front_of_positive_power_is_of_the_searches_for_it():
    point = {"space": "paper", "front": "water", "speed_searched": 0.5, "power_searched": 4.0}
    fronts = pd.DataFrame(point | {"currency": ["net", "positive"], "positive_power_searched": 6.0})
    worst = {"space": "paper", "objective": "water", "surface": "worst", "currency": ["net", "positive"]}
    attainment = pd.DataFrame(worst | {"speed": [0.4, 0.3], "power": [4.0, 6.0]})
    grid = {"space": "paper", "fluid": "water", "speed": 0.2, "power": [1.0], "positive_power": 2.0, "status": "ok"}
    found = search_gap({"fronts": fronts, "attainment": attainment, "grid": pd.DataFrame(grid)})
    assert found.to_numpy() == pytest.approx([1 - 0.4 / 0.5, 1 - 0.3 / 0.5])
