"""Files are written whole or not at all."""

from __future__ import annotations

import os
from pathlib import Path

from snakebench.errors import StoreError


def write_file(path: Path, content: str | bytes) -> None:
    """Write a file, text as UTF-8: a reader sees the old file or the new one, never a part.

    Raises:
        StoreError: when it cannot be written; the old file is then untouched.
    """
    beside = path.with_name(f".{path.name}.{os.getpid()}")
    try:
        beside.write_bytes(content.encode() if isinstance(content, str) else content)
        beside.replace(path)
    except OSError as error:
        beside.unlink(missing_ok=True)
        raise StoreError(f"cannot write {path}: {error.strerror}") from None
