"""What the run of a study gives: the tables, swims and policies that are published."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import pandas as pd

from snakebench.policy import Policy
from snakebench.tables import Columns, checked
from snakebench.trajectory import Trajectory


class Outcome(NamedTuple):
    """The results of a study."""

    tables: Mapping[str, pd.DataFrame]  # by name, as the study declares them
    swims: Mapping[str, Trajectory] = {}  # that its page shows, by name
    policies: Mapping[str, Policy] = {}  # that it trained, by name

    def checked_tables(self, declared: Mapping[str, Columns]) -> dict[str, pd.DataFrame]:
        """The tables that have rows.

        Raises:
            KeyError: when a table is not declared.
            StoreError: when one does not have its columns.
        """
        return {name: checked(table, declared[name], name) for name, table in self.tables.items() if len(table)}
