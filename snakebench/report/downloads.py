"""Tables as links of a page, to be saved from it."""

from __future__ import annotations

import base64
import gzip
from collections.abc import Iterable
from pathlib import Path

import pandas as pd

from snakebench.tables import table_file, table_text

_LARGEST = 100_000  # link to a table that a page holds [bytes]


def downloads(directory: Path, names: Iterable[str]) -> list[dict[str, str]]:
    """The names of those tables of a study that have rows, and links to save them; large tables have no link."""
    files = filter(Path.exists, (table_file(directory / f"{name}.csv") for name in names))
    links = {file.name: "" if file.suffix == ".gz" else packed(file.read_bytes()) for file in files}
    return [{"name": name, "link": link if len(link) <= _LARGEST else ""} for name, link in links.items()]


def data_link(name: str, table: pd.DataFrame) -> dict[str, str]:
    """A table to save from a page that made it."""
    return {"name": name, "link": packed(table_text(table).encode())}


def packed(content: bytes) -> str:
    """A file as a link that holds it, gzipped; pages unpack it as they save it, and equal files are equal links."""
    return f"data:application/gzip;base64,{base64.b64encode(gzip.compress(content, mtime=0)).decode()}"
