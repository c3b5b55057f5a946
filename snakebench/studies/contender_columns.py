"""Columns of the studies that compare what others found."""

from __future__ import annotations

from snakebench.tables import Columns

CONTENDER: Columns = {"method": str, "tuned_to": str, "seed": int}
ORIGIN: Columns = CONTENDER | {"study": str, "commit": str | None, "digest": str | None}
