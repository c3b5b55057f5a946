"""Tables of fronts have power and cost of transport in both currencies."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

import snakebench as sb
from snakebench.metrics import GRAVITY
from snakebench.studies.config import study_path, study_settings
from snakebench.studies.fronts import front_tables, fronts_of
from snakebench.studies.indicators import indicators
from snakebench.studies.running import study_config


@pytest.fixture
def config():
    return study_config(study_settings(study_path("pareto"), "smoke") | {"fluids": ["water", "oil1"]})


def swim(fluid, amplitude, speed, power, positive_power):
    """A swim of a gait that has one parameter, as searched and verified alike."""
    measured = {"speed": speed, "power": power, "positive_power": positive_power}
    searched = {f"{name}_searched": value for name, value in measured.items()}
    return {"fluid": fluid, "amplitude": amplitude, "status": "ok", "steady": True} | measured | searched


def test_fronts_have_both_powers_and_costs(config):
    mass = sb.Robot().total_mass
    swims = pd.DataFrame([swim("water", 1.0, 0.2, 2.0, 3.0), swim("oil1", 2.0, 0.4, 4.0, 9.0)])
    tables = front_tables(config, fronts_of(config, {"s": swims}, ["amplitude"], []))
    for _, fronts in tables["fronts"].groupby("currency"):
        assert list(fronts["positive_power"]) == [3.0, 9.0]
        assert list(fronts["cost_of_transport"]) == pytest.approx([10 / (mass * GRAVITY)] * 2)
        costs = [15 / (mass * GRAVITY), 22.5 / (mass * GRAVITY)]
        assert list(fronts["positive_cost_of_transport"]) == pytest.approx(costs)
    assert tables["switching"]["positive_power"].tolist() == [6.0, 6.0]


def test_each_currency_has_the_front_of_its_own_power(config):
    # The first gait regenerates much: it needs less P than the second for the same speed, and more P+.
    swims = pd.DataFrame([swim("water", 1.0, 0.2, 1.0, 9.0), swim("water", 2.0, 0.2, 2.0, 3.0)])
    table = front_tables(config, fronts_of(config, {"s": swims}, ["amplitude"], []))["fronts"]
    assert table.set_index("currency")["amplitude"].to_dict() == {"net": 1.0, "positive": 2.0}


POINTS = {"speed": [0.1, 0.2, 0.5], "power": [2.0, 4.0, 12.0], "positive_power": [3.0, 9.0, 13.0]}


def worth(currency):
    """The indicators of three points, as searched and verified alike."""
    searched = {f"{name}_searched": values for name, values in POINTS.items()}
    table = pd.DataFrame(POINTS | searched).assign(space="s", front="water", currency=currency)
    return indicators(table, (0.0, 30.0), [1.0, 3.0, 6.0, 13.0]).T[0]


def test_indicators_have_both_powers_of_the_points_that_they_name():
    row = worth("net")
    assert [row[f"{name}_positive_power"] for name in ("fastest", "thriftiest")] == [13.0, 3.0]


def test_speed_at_a_power_is_interpolated_and_not_known_beyond_the_fastest_point():
    row = worth("net")
    # Halfway between 2 and 4 W; a step from 4 to 12 W; 13 W are beyond 12.
    found = [[row[f"{name}_at_{power}_W"] for name in POINTS] for power in (1, 3, 6, 13)]
    expected = [[0.0, np.nan, np.nan], [0.15, 3.0, 6.0], [0.2, 4.0, 9.0], [np.nan] * 3]
    np.testing.assert_allclose(np.array(found, float), expected)


def test_indicators_of_positive_power_are_of_the_line_over_it():
    row = worth("positive")
    # From 3 to 9 W is a step, from 9 to 13 W a line.
    assert [row[f"speed_at_{power}_W"] for power in (1, 3, 6, 13)] == [0.0, 0.1, 0.1, 0.5]
    assert row["hypervolume"] == pytest.approx(6 * 0.1 + 4 * 0.35 + 17 * 0.5)
    assert row["hypervolume_searched"] == row["hypervolume"]
    assert row["thriftiest_power"] == 12.0  # 26 W s/m of P+, where the others need 30 and 45
