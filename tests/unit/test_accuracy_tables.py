"""What pages show of the bounds on errors that tables have."""

from __future__ import annotations

import pandas as pd
import pytest

from snakebench.report.accuracy import accuracy_of, bounds_held, step_changes

SWIMS = pd.DataFrame(
    {
        "gait": ["calm", "wild", "gone"],
        "engine": "pybullet",
        "physics_rate": 480,
        "status": ["ok", "ok", "diverged"],
        "steady": [True, True, False],
        "speed": [0.202, 0.01, None],
        "power": [4.0, 0.3, None],
        "speed_error": [0.015, 0.004, None],
        "power_error": [0.002, 0.35, None],
    }
)


def test_valid_swims_beyond_two_per_cent_are_counted_and_listed():
    found = accuracy_of({"runs": SWIMS, "other": pd.DataFrame({"speed": [1.0]})})
    assert (found["flagged"], found["swims"]) == (1, 2)
    assert found["bounds"].rows == [["runs", "2", "0.95 / 1.5", "17.6 / 35.0", "1"]]
    assert found["worst"].rows == [["runs, wild, pybullet, 480", "0.01", "0.4", "0.3", "35.0"]]


def test_exact_swims_are_not_listed():
    found = accuracy_of({"runs": SWIMS[:1]})
    assert (found["flagged"], found["worst"].rows) == (0, [])


def test_tables_of_version_1_have_no_bounds():
    old = SWIMS.assign(speed_error=None, power_error=None)
    assert accuracy_of({"runs": old}) is None
    assert bounds_held(old, SWIMS.set_index("gait"), ["gait"]) is None


@pytest.mark.parametrize(("true", "held"), [(0.2, "1"), (0.19, "0")])
def test_bounds_stand_beside_errors(true, held):
    limits = SWIMS.assign(speed=[true, 0.01, None]).set_index("gait")
    table = bounds_held(SWIMS[:1], limits, ["gait"])
    assert table.rows[0][:2] == ["pybullet, 480", "1"]
    assert table.rows[0][4] == held


def test_steps_are_compared_with_the_finer_one_and_with_the_limit_of_second_order():
    limit, error = 0.5, 0.1
    speeds = {"finer step": limit + error, "coarser step": limit + 4 * error, "planar": limit}
    swims = pd.DataFrame({"seed": 0, "variant": speeds.keys(), "speed": speeds.values()})
    row = step_changes(swims, ["seed"], {"speed": "v"}).iloc[0]
    assert row["coarser step: v"] == pytest.approx(speeds["coarser step"] / speeds["finer step"] - 1)
    assert row["planar: v"] == pytest.approx(limit / speeds["finer step"] - 1)
    assert row["planar, extrapolated: v"] == pytest.approx(0, abs=1e-12)
