"""Tables are checked when they are read: a study gets the columns that it declared, or one line that names the file."""

from __future__ import annotations

import pandas as pd
import pytest
from writing import write_manifest, write_table

from snakebench.errors import StoreError
from snakebench.studies import METHODS
from snakebench.studies.published import published, tables_of
from snakebench.tables import checked, read_table, read_tables

COLUMNS = {"fluid": str, "seed": int, "speed": float, "power": float | None, "steady": bool}
GOOD = pd.DataFrame({"fluid": ["1e-3"], "seed": [0], "speed": [0.2], "power": [None], "steady": [True]})


def test_a_table_comes_back_with_the_declared_types(tmp_path):
    write_table(tmp_path / "swims.csv", GOOD.assign(gait_parameter=1.5))
    table = read_table(tmp_path / "swims.csv", COLUMNS)
    assert table["fluid"].tolist() == ["1e-3"]  # a viscosity as the name of a fluid stays text
    assert [table[name].dtype.kind for name in ("seed", "speed", "power", "steady")] == ["i", "f", "f", "b"]
    assert table["gait_parameter"].tolist() == [1.5]


@pytest.mark.parametrize(
    ("damaged", "named"),
    [
        (GOOD.drop(columns="speed"), "no column speed"),
        (GOOD.assign(speed=[None]), "speed: a cell is empty"),
        (GOOD.assign(speed=["fast"]), "speed: could not convert"),
        (GOOD.assign(seed=["a"]), "seed: invalid literal"),
    ],
)
def test_a_table_without_its_columns_is_refused_in_a_line_that_names_file_and_column(tmp_path, damaged, named):
    write_table(tmp_path / "swims.csv", damaged)
    with pytest.raises(StoreError) as refusal:
        read_table(tmp_path / "swims.csv", COLUMNS)
    assert str(tmp_path / "swims.csv") in str(refusal.value) and named in str(refusal.value)
    assert "\n" not in str(refusal.value)


def test_a_column_that_may_be_empty_may_be_missing():
    assert checked(GOOD.drop(columns="power"), COLUMNS, "swims")["power"].isna().all()


def test_a_declared_table_without_a_file_has_no_rows(tmp_path):
    table = read_tables(tmp_path, {"swims": COLUMNS})["swims"]
    assert len(table) == 0 and list(table) == list(COLUMNS)


@pytest.mark.parametrize("method", METHODS)
def test_every_method_declares_its_tables(method):
    assert tables_of(method)


def test_results_of_an_unknown_method_are_refused(tmp_path):
    write_manifest(tmp_path, {"study": "s", "config": {"method": "divination"}})
    with pytest.raises(StoreError, match="divination"):
        published(tmp_path)
