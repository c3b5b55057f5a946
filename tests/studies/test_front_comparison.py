"""Fronts of a policy compared with those of fixed gaits, on fronts of a few points."""

from __future__ import annotations

import numpy as np
import pandas as pd

from snakebench.studies.learned_front.page import compared

WEIGHT = 10.0  # [N]
FIXED = {"speed": [0.1, 0.2, 0.5], "power": [2.0, 8.0, 12.0], "positive_power": [3.0, 9.0, 30.0]}


def front(method, seed=0, name="water", **points):
    return pd.DataFrame(FIXED | points).assign(method=method, front=name, seed=seed)


def compared_fronts(*fronts, hypervolumes=None, teacher=None):
    """Fronts compared by their points, and by their speeds within 1, 3 and 12 W."""
    points, rows = pd.concat(fronts, ignore_index=True), []
    for key, part in points.groupby(["method", "front", "seed"]):
        row = dict(zip(("method", "front", "seed"), key, strict=True))
        for power in (1, 3, 12):
            within = part[part["power"] <= power]
            row[f"speed_at_{power}_W"] = within["speed"].max() if len(within) else 0.0
            row[f"positive_power_at_{power}_W"] = within["positive_power"].max() if len(within) else np.nan
        hypervolume = (hypervolumes or {}).get(key[0], 1.0)
        rows.append(row | {"hypervolume": hypervolume, "hypervolume_searched": hypervolume})
    return compared(points, pd.DataFrame(rows), ["sinusoid"], "student", teacher, WEIGHT)


def cells(table, row):
    return next(cells for label, *cells in table.rows if label == row)


def test_a_gain_is_the_relative_difference_at_equal_power_and_a_dash_where_one_has_no_point():
    faster = [front("student", seed, speed=[0.11 + 0.02 * seed, 0.3, 0.75]) for seed in (0, 1)]
    found = compared_fronts(*faster, front("sinusoid"), hypervolumes={"student": 3.0, "sinusoid": 2.0})
    # 0.11 and 0.13 m/s against 0.1: t(0.975, 1 degree of freedom) = 12.706 times the standard error 10 % of the mean.
    assert cells(found["gains"], "water, sinusoid") == ["–", "20 ± 127", "50 ± 0", "2 W", "50 ± 0"]
    assert found["n_seeds"] == 2


def test_the_integrated_front_is_compared_with_ideal_switching_as_well():
    fronts = [front(method, name=name) for method in ("student", "sinusoid") for name in ("integrated", "simple-sum")]
    gains = compared_fronts(*fronts)["findings"]["gains"]
    assert set(zip(gains["front"], gains["against"], strict=True)) == {
        ("integrated", "integrated"),
        ("integrated", "simple-sum"),
        ("simple-sum", "simple-sum"),
    }


def test_the_policy_leads_from_the_power_above_which_it_is_always_faster():
    # Slower up to 8 W, where it overtakes.
    found = compared_fronts(front("student", speed=[0.05, 0.3, 0.6]), front("sinusoid"))
    assert cells(found["gains"], "water, sinusoid")[3] == "8 W"
    behind = compared_fronts(front("student", speed=[0.2, 0.3, 0.4]), front("sinusoid"))
    assert cells(behind["gains"], "water, sinusoid")[3] == "not at 12 W"


def test_losses_are_where_fixed_gaits_are_faster_cheaper_or_of_more_hypervolume():
    slower = front("student", speed=[0.05, 0.3, 0.6])
    found = compared_fronts(slower, front("sinusoid"), hypervolumes={"student": 1.0, "sinusoid": 2.0})
    # Costs of transport: 4, 2.667 and 2 against 2, 4 and 2.4.
    assert found["losses"].rows == [["water, sinusoid", "3", "", "yes"]]
    better = front("student", speed=[0.2, 0.4, 0.8])
    assert compared_fronts(better, front("sinusoid"))["losses"].rows == []


def test_what_compared_points_of_fronts_take_stands_beside_in_the_other_currency():
    found = compared_fronts(front("student"), front("sinusoid"))
    assert cells(found["positive_power"], "water, sinusoid") == ["–", "3.000", "30.000"]
    # At least 0.5 m/s: CoT = 12 / (10 N · 0.5 m/s) = 2.4, CoT+ = 30 / 5; at least 0.05 m/s the slowest: 3 / 1.
    costs, positive_costs = (cells(found[name], "water, sinusoid") for name in ("equal_speed", "positive_cost"))
    assert (costs[0], costs[5]) == ("2.000", "2.400")
    assert (positive_costs[0], positive_costs[5]) == ("3.000", "6.000")


def test_fronts_of_older_versions_are_compared_without_positive_power():
    found = compared_fronts(*(front(name, positive_power=np.nan) for name in ("student", "sinusoid")))
    assert not found["positive_power"].rows and not found["positive_cost"].rows and found["equal_power"].rows


def test_the_share_of_the_teachers_hypervolume_is_taken_seed_by_seed():
    fronts = [front(name, seed) for name in ("student", "teacher") for seed in (0, 1)]
    kept = compared_fronts(*fronts, hypervolumes={"student": 3.0, "teacher": 4.0}, teacher="teacher")["findings"][
        "kept"
    ]
    assert kept.to_dict("list") == {"front": ["water", "water"], "seed": [0, 1], "share": [0.75, 0.75]}


def test_without_fixed_gaits_a_policy_stands_alone():
    found = compared_fronts(front("student"))
    assert not found["gains"].rows and not found["losses"].rows and len(found["equal_power"].rows) == 1
