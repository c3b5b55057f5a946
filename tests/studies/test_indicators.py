"""Tables of fronts have power and cost of transport in both currencies."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

import snakebench as sb
from snakebench.metrics import GRAVITY
from snakebench.studies.config import study_path, study_settings
from snakebench.studies.fronts import front_tables, fronts_of, indicators
from snakebench.studies.running import study_config


def test_fronts_have_both_powers_and_costs():
    # Two fluids with a gait each: P of 2 and 4 W, P+ of 3 and 9 W, at 0.2 and 0.4 m/s.
    mass = sb.Robot().total_mass
    config = study_config(study_settings(study_path("pareto"), "smoke") | {"fluids": ["water", "oil1"]})
    swim = {"fluid": "water", "status": "ok", "steady": True, "speed_searched": 0.2, "power_searched": 2.0}
    swim |= {"amplitude": 1.0, "speed": 0.2, "power": 2.0, "positive_power": 3.0}
    other = swim | {"fluid": "oil1", "amplitude": 2.0, "speed": 0.4, "power": 4.0, "positive_power": 9.0}
    tables = front_tables(config, fronts_of(config, {"s": pd.DataFrame([swim, other])}, ["amplitude"], []))
    fronts = tables["fronts"].set_index("front")
    assert list(fronts["positive_power"]) == [3.0, 9.0]
    assert list(fronts["cost_of_transport"]) == pytest.approx([10 / (mass * GRAVITY)] * 2)
    assert list(fronts["positive_cost_of_transport"]) == pytest.approx([15 / (mass * GRAVITY), 22.5 / (mass * GRAVITY)])
    assert tables["switching"]["positive_power"].item() == 6.0


def test_indicators_have_the_positive_power_of_the_points_that_they_name():
    points = pd.DataFrame({"speed": [0.1, 0.2, 0.5], "power": [2.0, 4.0, 12.0], "positive_power": [3.0, 9.0, 13.0]})
    table = points.assign(space="s", front="water", speed_searched=0.1, power_searched=2.0)
    powers = [1.0, 3.0, 5.0, 15.0]
    row = indicators(table, (0.0, 30.0), powers).T[0]
    assert [row[f"{name}_positive_power"] for name in ("fastest", "thriftiest")] == [13.0, 3.0]
    paid = [row[f"positive_power_at_{power:g}_W"] for power in powers]
    assert paid == pytest.approx([np.nan, 3.0, 9.0, 13.0], nan_ok=True)
