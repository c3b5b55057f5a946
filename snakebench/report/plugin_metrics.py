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
            columns = [str(column) for column in table]
            by = [label for label in columns[: columns.index("status")] if declared[name].get(label) is str]
            further = table[columns[columns.index("return") + 1 :]].select_dtypes("number")
            metrics = [str(metric) for metric in further if metric not in declared[name]]
            if metrics and by:
                found[name] = summary(table, by, metrics)
    return found
