"""What pages say of the bounds on errors that tables have."""

from __future__ import annotations

import pandas as pd
import pytest

from snakebench.report.accuracy import accuracy_of, bounds_held
from snakebench.tables import write_table

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


def test_valid_swims_beyond_two_per_cent_are_counted_and_listed(tmp_path):
    write_table(tmp_path / "runs.csv", SWIMS)
    write_table(tmp_path / "other.csv", pd.DataFrame({"speed": [1.0]}))
    found = accuracy_of(tmp_path)
    assert (found.flagged, found.swims) == (1, 2)
    assert found.bounds.rows == [["runs", "2", "0.95 / 1.5", "17.6 / 35.0", "1"]]
    assert found.worst.rows == [["runs, wild, pybullet, 480", "0.01", "0.4", "0.3", "35.0"]]


def test_exact_swims_are_not_listed(tmp_path):
    write_table(tmp_path / "runs.csv", SWIMS[:1])
    found = accuracy_of(tmp_path)
    assert (found.flagged, found.worst) == (0, None)


def test_tables_of_version_1_say_nothing(tmp_path):
    write_table(tmp_path / "runs.csv", SWIMS.drop(columns=["speed_error", "power_error"]))
    assert accuracy_of(tmp_path) is None
    assert bounds_held(SWIMS.drop(columns="power_error"), SWIMS.set_index("gait"), ["gait"]) is None


@pytest.mark.parametrize(("true", "held"), [(0.2, 1), (0.19, 0)])
def test_bounds_stand_beside_errors(true, held):
    limits = SWIMS.assign(speed=[true, 0.01, None]).set_index("gait")
    table = bounds_held(SWIMS[:1], limits, ["gait"])
    assert table.rows[0][:2] == ["pybullet, 480 Hz", "1"]
    assert table.rows[0][4] == str(held)
