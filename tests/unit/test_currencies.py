"""Power and cost of transport in both currencies: in the tables of pages, of this version and of older ones."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import snakebench as sb
from snakebench.metrics import GRAVITY
from snakebench.reporting.rendering import write_report
from snakebench.reporting.swims import readable
from snakebench.reporting.tables import TAKEN, averaged, in_both_currencies, number
from snakebench.studies.indicators import assembled, front_tables

COMMITTED = Path(__file__).parents[2] / "results"


def test_what_an_older_version_did_not_write_is_a_dash():
    old = pd.DataFrame({"status": "ok", "speed": [0.2, 0.3], "power": [2.0, 3.0], "tuned_to": None})
    both = readable(old)
    assert set(TAKEN) <= set(both)
    assert list(both["power"]) == [2.0, 3.0]
    for name in set(TAKEN) - {"power"}:
        assert averaged(both[name]) == number(both[name].iloc[0]) == "–"


def test_the_cost_that_version_1_did_not_write_is_made_of_its_powers():
    old = pd.DataFrame({"power": [2.0, 0.0], "positive_power": [3.0, 1.0], "cost_of_transport": [0.4, 0.0]})
    assert in_both_currencies(old)["positive_cost_of_transport"].tolist() == pytest.approx([0.6, np.nan], nan_ok=True)


def test_a_table_of_this_version_stays_as_it_is():
    table = pd.DataFrame({name: [1.0, np.nan] for name in ("speed", *TAKEN)})
    pd.testing.assert_frame_equal(in_both_currencies(table), table)


def test_fronts_tell_both_currencies():
    # Two fluids with a gait each: P of 2 and 4 W, P+ of 3 and 9 W, at 0.2 and 0.4 m/s.
    mass = sb.Robot().total_mass
    part = {"speed": 0.2, "power": 2.0, "positive_power": 3.0, "speed_searched": 0.2, "power_searched": 2.0}
    part |= {"steady": True}
    other = part | {"speed": 0.4, "power": 4.0, "positive_power": 9.0}
    found = {"water": pd.DataFrame([part]), "oil1": pd.DataFrame([other])}
    tables = front_tables(assembled("s", found, ["water", "oil1"], mass), ["water", "oil1"], (0.0, 30.0))
    fronts = tables["fronts"].set_index("front")
    assert list(fronts["positive_power"]) == [3.0, 9.0]
    assert list(fronts["cost_of_transport"]) == pytest.approx([10 / (mass * GRAVITY)] * 2)
    assert list(fronts["positive_cost_of_transport"]) == pytest.approx([15 / (mass * GRAVITY), 22.5 / (mass * GRAVITY)])
    assert tables["switching"]["positive_power"].item() == 6.0


@pytest.mark.parametrize("study", ["sea_snake", "sea_snake_front"])
def test_pages_of_results_of_older_versions_show_both_currencies(study, tmp_path):
    text = write_report(shutil.copytree(COMMITTED / study, tmp_path / study), tmp_path).read_text()
    for head in TAKEN.values():
        assert f">{head}</th>" in text
