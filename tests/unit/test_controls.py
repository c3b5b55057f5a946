"""Comparisons with single gaits at equal mean power, on made-up swims."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from snakebench.studies.adaptation.controls import compared, controls

SWIM = {"course": "step", "variant": "finer step", "status": "ok", "gait": np.nan, "ideal_net": 20.0}
GAITS = [("fourier", 0, 2.0, 8.0), ("fourier", 1, 6.0, 14.0), ("extended", 0, 4.0, 9.0), ("extended", 1, 12.0, 12.0)]
CHANGE = {"course": "step", "seed": 0, "gait": np.nan, "from": "water", "to": "oil2", "loss": 0.1}


def swims(power, distance=15.0):
    """A student's swim and those of single gaits; P+ is twice P."""
    rows = [SWIM | {"method": "student", "tuned_to": "adaptive", "seed": 0, "power": power, "distance": distance}]
    rows += [
        SWIM | {"method": method, "tuned_to": "integrated", "seed": 0, "gait": k, "power": watts, "distance": metres}
        for method, k, watts, metres in GAITS
    ]
    table = pd.DataFrame(rows)
    return table.assign(positive_power=2 * table["power"], ideal_positive=np.nan)


def tables(power, recoveries=()):
    changes = [CHANGE | {"method": "student", "tuned_to": "adaptive", "seconds": value} for value in recoveries]
    known = pd.DataFrame(changes, columns=[*CHANGE, "method", "tuned_to", "seconds"])
    return {"courses": swims(power), "recoveries": known, "steady": pd.DataFrame()}


def student(power, recoveries=()):
    table = compared(tables(power, recoveries))
    return table[table["method"] == "student"].iloc[0]


def test_the_best_single_gait_at_a_power_is_on_the_line_between_its_neighbours():
    assert student(4.0)["single_net"] == pytest.approx((8.0 + 14.0) / 2)
    assert student(4.0)["single_extended_net"] == 9.0
    assert student(4.0)["gain_net"] == pytest.approx(15.0 / 11.0 - 1)


def test_in_the_other_currency_powers_are_compared_in_it():
    assert student(4.0)["single_positive"] == student(4.0)["single_net"]


def test_beyond_the_power_of_the_fastest_single_gait_it_is_compared_at_its_own():
    assert student(30.0)[["single_net", "at_net"]].tolist() == [14.0, 6.0]
    assert student(4.0)["at_net"] == 4.0
    assert np.isnan(student(1.0)["gain_net"])


@pytest.mark.parametrize("power", [1.0, 4.0, 30.0])
def test_no_single_gait_gains_over_the_best_at_its_power(power):
    table = compared(tables(power))
    assert (table.loc[table["method"] != "student", "gain_net"] <= 0).all()


def test_who_has_no_steady_speed_after_a_change_never_recovers():
    """Its change is not in the table, but that of another swimmer on the course is."""
    known = tables(4.0, [1.0, 2.0])["recoveries"]
    table = compared(
        tables(4.0)
        | {"recoveries": pd.concat([known, known[:1].assign(method="fourier", tuned_to="integrated", gait=0)])}
    )
    longest = table.set_index(["method", "gait"])["recovery"]
    assert longest[("student", np.nan)] == 2.0 and longest[("fourier", 0.0)] == np.inf
    assert table["recovery"].isna().sum() == 0


def test_a_diverged_gait_is_no_control():
    content = tables(4.0)
    content["courses"].loc[2, "status"] = "diverged"
    table = compared(content).set_index("method")
    assert table.loc["student", "single_fourier_net"] == 8.0


def test_distance_is_a_share_of_the_limits_where_that_is_known():
    assert student(4.0)["of_limit_net"] == pytest.approx(15.0 / 20.0)
    assert np.isnan(student(4.0)["of_limit_positive"])


def test_the_longest_recovery_counts_and_one_that_never_came_is_infinite():
    assert student(4.0, recoveries=[1.0, 2.5])["recovery"] == 2.5
    assert student(4.0, recoveries=[1.0, np.nan])["recovery"] == np.inf
    assert student(4.0, recoveries=[1.0, 2.5])["loss"] == pytest.approx(0.2)


@pytest.mark.parametrize(("power", "gaits"), [(7.0, {1.0, 0.0}), (3.0, {0.0}), (13.0, {1.0})])
def test_the_controls_are_the_gaits_of_each_method_that_are_nearest_below_the_power(power, gaits):
    found = controls(compared(tables(power)), "student")
    assert sorted(found["method"]) == ["extended", "fourier"]
    assert set(found["gait"]) == gaits
