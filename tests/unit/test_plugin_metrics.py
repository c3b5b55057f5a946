"""A metric of a plug-in is shown on every page whose tables have it; no study names it."""

from __future__ import annotations

import pandas as pd
import pytest
from scipy import stats

from snakebench.report.table import plugin_metrics
from snakebench.studies import METHODS
from snakebench.studies.published import tables_of
from snakebench.tables import EVALUATION, checked

SWIMS = pd.DataFrame({"fluid": ["water", "water", "oil1"], "seed": [0, 1, 0], "status": "ok", "steady": True})
COLUMNS = {"fluid": str, "seed": int} | EVALUATION


def test_a_column_after_an_evaluations_own_is_a_metric():
    swims = checked(SWIMS, COLUMNS, "swims").assign(curvature=[1.0, 3.0, 5.0])
    found = plugin_metrics({"swims": swims}, {"swims": COLUMNS})
    assert found["swims"].head == ["fluid", "curvature"]
    assert [row[0] for row in found["swims"].rows] == ["water", "oil1"]
    assert found["swims"].rows[1][1] == "5.000" and found["swims"].rows[0][1].startswith("2.000 ± ")


def test_several_swims_of_a_seed_count_as_one():
    """As those of several viscosities, which are no seeds."""
    swims = pd.concat([SWIMS.assign(viscosity=nu, curvature=nu * (1 + SWIMS["seed"])) for nu in (1.0, 3.0)])
    swims = checked(swims.drop(columns="curvature"), COLUMNS | {"viscosity": float}, "swims").assign(
        curvature=swims["curvature"].to_numpy()
    )
    found = plugin_metrics({"swims": swims}, {"swims": COLUMNS | {"viscosity": float}})
    half = stats.t.ppf(0.975, 1) * 1.0  # of the means 2 and 4
    assert found["swims"].rows == [["water", f"3.000 ± {half:.3f}"], ["oil1", "2.000"]]


@pytest.mark.parametrize("method", METHODS)
def test_the_columns_of_a_study_are_no_metrics_of_plug_ins(method):
    tables = tables_of(method)
    empty = {name: checked(pd.DataFrame(columns=list(columns)), columns, name) for name, columns in tables.items()}
    assert plugin_metrics(empty, tables) == {}
