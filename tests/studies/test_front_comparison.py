"""Fronts of a policy compared with those of fixed gaits, on fronts of a few points."""

from __future__ import annotations

import numpy as np
import pandas as pd

from snakebench.studies.front_comparison import compared

WEIGHT = 10.0  # [N]
FIXED = {"speed": [0.1, 0.2, 0.5], "power": [2.0, 8.0, 12.0], "positive_power": [3.0, 9.0, 30.0]}


def front(method, seed=0, name="water", **points):
    return pd.DataFrame(FIXED | points).assign(method=method, front=name, seed=seed)


def compared_fronts(*fronts, hypervolumes=None, teacher=None, currencies=("net",)):
    """Fronts compared by their points, and by their speeds at 1, 3 and 12 W and their fastest points."""
    points, rows = pd.concat([part.assign(currency=name) for part in fronts for name in currencies]), []
    for key, part in points.groupby(["method", "front", "seed", "currency"]):
        row = dict(zip(("method", "front", "seed", "currency"), key, strict=True))
        own = part["power" if row["currency"] == "net" else "positive_power"]
        for power in (1, 3, 12):
            row[f"speed_at_{power}_W"] = part.loc[own <= power, "speed"].max() if (own <= power).any() else 0.0
        row |= {f"fastest_{name}": part[name].iloc[-1] for name in FIXED}
        hypervolume = (hypervolumes or {}).get(key[0], 1.0)
        rows.append(row | {"hypervolume": hypervolume, "hypervolume_searched": hypervolume})
    chosen = dict.fromkeys(("net", "positive"), "student")
    return compared(points, pd.DataFrame(rows), ["sinusoid"], chosen, {"student": teacher}, WEIGHT)


def cells(table, row):
    return next(cells for label, *cells in table.rows if label == row)


def net(found, table):
    return found["currencies"]["net"][table]


def gain(found, head):
    table = net(found, "gains")
    return cells(table, "water, sinusoid")[table.head.index(head) - 1]


def test_a_gain_is_the_relative_difference_at_equal_power_and_a_dash_where_one_has_no_point():
    faster = [front("student", seed, speed=[0.11 + 0.02 * seed, 0.3, 0.75]) for seed in (0, 1)]
    found = compared_fronts(*faster, front("sinusoid"), hypervolumes={"student": 3.0, "sinusoid": 2.0})
    # 0.11 and 0.13 m/s against 0.1: t(0.975, 1 degree of freedom) = 12.706 times the standard error 10 % of the mean.
    # The first power, where they have no point, has no column.
    expected = ["20 ± 127", "50 ± 0", "50 ± 0 at 12.0 W", "2 W", "50 ± 0"]
    assert cells(net(found, "gains"), "water, sinusoid") == expected
    assert found["n_seeds"] == 2


def test_the_highest_shared_power_is_that_of_the_front_that_ends_first_and_both_are_compared_there():
    student = front("student", speed=[0.2, 0.6, 0.9], power=[5.0, 10.0, 20.0])
    found = compared_fronts(student, front("sinusoid"))
    # At 12 W the student has 0.6 + 0.3 · 2 / 10 m/s, the sinusoids their fastest point of 0.5 m/s.
    assert gain(found, "highest shared power") == "32 at 12.0 W"


def test_the_integrated_front_is_compared_with_ideal_switching_as_well():
    fronts = [front(method, name=name) for method in ("student", "sinusoid") for name in ("integrated", "simple-sum")]
    gains = compared_fronts(*fronts)["findings"]["gains"]
    assert set(zip(gains["front"], gains["against"], strict=True)) == {
        ("integrated", "integrated"),
        ("integrated", "simple-sum"),
        ("simple-sum", "simple-sum"),
    }


def test_the_policy_leads_from_the_power_above_which_it_is_always_faster_as_far_as_both_reach():
    # Slower up to 8 W, where it overtakes.
    found = compared_fronts(front("student", speed=[0.05, 0.3, 0.6]), front("sinusoid"))
    assert gain(found, "leads from") == "8 W"
    behind = compared_fronts(front("student", speed=[0.2, 0.3, 0.4]), front("sinusoid"))
    assert gain(behind, "leads from") == "not up to 12 W"
    # Its fastest point at 20 W is compared with no gait.
    further = compared_fronts(front("student", speed=[0.05, 0.1, 0.9], power=[2.0, 8.0, 20.0]), front("sinusoid"))
    assert gain(further, "leads from") == "not up to 12 W"


def test_losses_are_where_fixed_gaits_are_faster_cheaper_or_of_more_hypervolume():
    slower = front("student", speed=[0.05, 0.3, 0.6])
    found = compared_fronts(slower, front("sinusoid"), hypervolumes={"student": 1.0, "sinusoid": 2.0})
    # For 0.1 m/s the student needs 8 W and the sinusoids 2; for 0.2 both need 8 W; for 0.3 8 W and 9.33.
    assert net(found, "losses").rows == [["water, sinusoid", "3", "0.1", "yes"]]
    better = front("student", speed=[0.2, 0.4, 0.8])
    assert net(compared_fronts(better, front("sinusoid")), "losses").rows == []


def test_each_currency_is_compared_by_its_own_power():
    found = compared_fronts(front("student"), front("sinusoid"), currencies=("net", "positive"))["currencies"]
    speeds = {currency: cells(tables["equal_power"], "water, sinusoid") for currency, tables in found.items()}
    assert speeds == {"net": ["–", "0.100", "0.500"], "positive": ["–", "0.100", "0.200"]}
    # 0.1 m/s: CoT = 2 / (10 N · 0.1 m/s) and CoT+ = 3 / 1; 0.5 m/s: 12 / 5 and 30 / 5; slower or faster gaits are none.
    costs = {currency: cells(tables["equal_speed"], "water, sinusoid") for currency, tables in found.items()}
    assert (costs["net"][1], costs["net"][5]) == ("2.000", "2.400")
    assert (costs["positive"][1], costs["positive"][5]) == ("3.000", "6.000")
    assert costs["net"][0] == costs["net"][6] == "–"


def test_fronts_are_compared_in_the_currencies_that_they_have():
    found = compared_fronts(*(front(name, positive_power=np.nan) for name in ("student", "sinusoid")))
    assert list(found["currencies"]) == ["net"] and net(found, "equal_power").rows


def test_the_share_of_the_teachers_hypervolume_is_taken_seed_by_seed():
    fronts = [front(name, seed) for name in ("student", "teacher") for seed in (0, 1)]
    kept = compared_fronts(*fronts, hypervolumes={"student": 3.0, "teacher": 4.0}, teacher="teacher")["findings"][
        "kept"
    ]
    assert kept[["front", "seed", "share"]].to_numpy().tolist() == [["water", 0, 0.75], ["water", 1, 0.75]]


def test_without_fixed_gaits_a_policy_stands_alone():
    found = compared_fronts(front("student"))
    assert not net(found, "gains").rows and not net(found, "losses").rows
    assert len(net(found, "equal_power").rows) == 1
