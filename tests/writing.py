"""Makes parts of results by hand: for tests of what reads them."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from snakebench.files import write_file
from snakebench.manifest import MANIFEST, manifest_text, read_manifest
from snakebench.policy import Card, Policy
from snakebench.store import file_digest
from snakebench.tables import table_text


def write_manifest(directory: Path, content: Mapping[str, Any]) -> None:
    """Write what is known about the results in a directory; if it does not list the files, those that are there."""
    found = [path for path in directory.rglob("*") if path.is_file() and path.name != MANIFEST]
    files = {str(path.relative_to(directory)): file_digest(path.read_bytes()) for path in found}
    write_file(directory / MANIFEST, manifest_text({"files": files} | content))


def list_files(directory: Path) -> None:
    """Let the manifest in a directory list its files as they are, after they were changed."""
    manifest = read_manifest(directory)
    del manifest["files"]
    write_manifest(directory, manifest)


def random_policy(card: Card, seed: int = 0) -> Policy:
    """A policy of random 32-bit floats."""
    rng = np.random.default_rng(seed)
    arrays = {name: rng.normal(size=shape) / np.sqrt(shape[-1]) for name, shape in card.shapes().items()}
    return Policy(card, {name: array.astype(np.float32) for name, array in arrays.items()})


def write_table(path: Path, table: pd.DataFrame) -> None:
    """Write a table as CSV, for `read_table`."""
    write_file(path, table_text(table))
