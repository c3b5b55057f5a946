"""Tables as links of a page, to be saved from it."""

from __future__ import annotations

import base64
import gzip
from collections.abc import Iterable
from pathlib import Path
from typing import NamedTuple

import pandas as pd

from snakebench.tables import table_file, table_text

_LARGEST = 100_000  # link to a table that a page holds [bytes]


class Download(NamedTuple):
    """A table to save from the page, or only its name, if it is large."""

    name: str
    link: str | None


def downloads(directory: Path, names: Iterable[str]) -> list[Download]:
    """Those tables of a study that have rows, to save from its page; large ones only by name."""
    found = []
    for file in (table_file(directory / f"{name}.csv") for name in names):
        if file.exists():
            link = None if file.suffix == ".gz" else packed(file.read_bytes())
            found.append(Download(file.name, link if link and len(link) <= _LARGEST else None))
    return found


def data_link(name: str, table: pd.DataFrame) -> Download:
    """A table to save from a page that made it."""
    return Download(name, packed(table_text(table).encode()))


def packed(content: bytes) -> str:
    """A file as a link that holds it, gzipped; pages unpack it as they save it, and equal files are equal links."""
    return f"data:application/gzip;base64,{base64.b64encode(gzip.compress(content, mtime=0)).decode()}"
