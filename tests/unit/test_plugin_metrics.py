"""A metric of a plug-in is shown on every page whose tables have it; no study names it."""

from __future__ import annotations

import pandas as pd
import pytest

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


@pytest.mark.parametrize("method", METHODS)
def test_the_columns_of_a_study_are_no_metrics_of_plug_ins(method):
    tables = tables_of(method)
    empty = {name: checked(pd.DataFrame(columns=list(columns)), columns, name) for name, columns in tables.items()}
    assert plugin_metrics(empty, tables) == {}
