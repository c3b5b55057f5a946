"""Metrics of plug-ins, which no page names: means over the seeds in every table of swims that has them."""

from __future__ import annotations

from collections.abc import Mapping

import pandas as pd

from snakebench.report.table import LONGEST, Table, summary
from snakebench.tables import Columns


def plugin_metrics(tables: Mapping[str, pd.DataFrame], declared: Mapping[str, Columns]) -> dict[str, Table]:
    """A table for each table of swims with metrics of plug-ins, by its name; those of searches are left out.

    Metrics of plug-ins follow an evaluation's own, whose last one is the return; no study declares them.
    """
    found = {}
    for name, table in tables.items():
        if {"status", "return"} <= set(table) and len(table) <= LONGEST:
            labels = [str(column) for column in table.columns[: table.columns.get_loc("status")]]
            by = [column for column in labels if declared[name].get(column) is str]
            last = table[table.columns[table.columns.get_loc("return") + 1 :]].select_dtypes("number")
            metrics = [str(column) for column in last if column not in declared[name]]
            if metrics and by:
                found[name] = summary(table, by, metrics)
    return found
