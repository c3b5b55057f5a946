"""Power and cost of transport in both currencies: in the tables of pages, of this version and of older ones."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from snakebench.comparison.quantities import Results

from snakebench.comparison.claims import claims
from snakebench.comparison.gain_ledger import COSTS, cost_table, ledger
from snakebench.report.measurements import readable
from snakebench.report.tables import TAKEN, averaged, in_both_currencies, number
from snakebench.site import write_report
from snakebench.store import read_manifest, write_manifest
from snakebench.tables import read_table, write_table

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


@pytest.fixture
def paid_twice(tmp_path):
    """The committed results with fronts whose P+ is twice their P."""
    for study in COMMITTED.iterdir():
        (tmp_path / study.name).symlink_to(study)
    for study in ("pareto", "learned_front"):
        (tmp_path / study).unlink()
        (tmp_path / study).mkdir()
        write_manifest(tmp_path / study, {"study": study, "config": read_manifest(COMMITTED / study)["config"]})
        for name in ("fronts", "switching"):
            table = read_table(COMMITTED / study / f"{name}.csv")
            write_table(tmp_path / study / f"{name}.csv", table.assign(positive_power=2 * table["power"]))
    return Results(tmp_path)


def test_the_ledger_tells_both_costs_of_the_gaits_whose_speeds_it_compares(paid_twice):
    accounts = ledger(paid_twice)
    view = [account for account in accounts if account.view == "at 10 W"]
    for step in (step for account in view for step in account.steps if "waveform" not in step.method):
        cost, positive_cost = (np.array(step.costs[key].values) for key in COSTS)
        assert positive_cost == pytest.approx(2 * cost)
    first, _, waveform, *_ = view[0].steps
    row = cost_table(accounts, "at 10 W").rows[2]
    for cell, key in zip(row[1:], COSTS, strict=False):
        assert cell.endswith(f"× {waveform.costs[key].mean / first.costs[key].mean:.2f}")


def test_the_ledger_of_older_versions_has_dashes_and_the_same_speeds(paid_twice):
    here, older = ledger(paid_twice), ledger(Results(COMMITTED))
    assert [[step.speed.values for step in one.steps] for one in here] == [
        [step.speed.values for step in one.steps] for one in older
    ]
    if "positive_power" not in read_table(COMMITTED / "pareto" / "fronts.csv"):
        assert cost_table(older, "at 10 W").rows[0][2] == "–"


def test_claims_tell_the_positive_power_where_tables_have_it(paid_twice):
    found, missing = claims(paid_twice)
    ours = next(claim.ours for claim in found if "than ideal switching" in claim.claim)
    power, positive_power = ours.split("; P+ of the same ")
    assert not missing and power.endswith(positive_power)  # twice as much on both sides


@pytest.mark.parametrize("study", ["sea_snake", "sea_snake_front"])
def test_pages_of_results_of_older_versions_show_both_currencies(study, tmp_path):
    text = write_report(shutil.copytree(COMMITTED / study, tmp_path / study), tmp_path).read_text()
    for head in TAKEN.values():
        assert f">{head}</th>" in text
