"""Files are written whole or not at all."""

from __future__ import annotations

import os
import tempfile
from pathlib import Path

from snakebench.errors import StoreError


def writable_directory(path: Path) -> Path:
    """Make sure that `path` is a directory that files can be written to.

    Raises:
        StoreError: when it is not and cannot be made so.
    """
    try:
        path.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=path):
            pass
    except OSError as error:
        raise StoreError(f"cannot write to the directory {path}: {error.strerror}") from None
    return path


def readable_file(path: Path) -> Path:
    """Make sure that `path` is no device, pipe or directory; a file that is missing is for its reader to tell.

    Raises:
        StoreError: when it is: a device such as /dev/zero never ends.
    """
    if path.exists() and not path.is_file():
        raise StoreError(f"cannot read {path}: it is not a regular file")
    return path


def writable_file(path: Path) -> Path:
    """Make sure that a file can be written to `path`: the real path, links followed, is returned.

    Raises:
        StoreError: when its directory is missing or closed, or something that is no file stands there.
    """
    try:
        real = path.resolve()
        taken = real.exists() and not real.is_file()
    except (OSError, RuntimeError) as error:  # a name too long, a loop of links
        raise StoreError(f"cannot write {path}: {getattr(error, 'strerror', None) or error}") from None
    if taken:
        raise StoreError(f"cannot write {path}: it is not a regular file")
    if not real.parent.is_dir():
        raise StoreError(f"cannot write {path}: {real.parent} is not a directory")
    writable_directory(real.parent)
    return real


def write_file(path: Path, content: str | bytes) -> None:
    """Write a file, text as UTF-8: a reader sees the old file or the new one, never a part.

    Raises:
        StoreError: when it cannot be written; the old file is then untouched.
    """
    real = writable_file(path)
    beside = real.with_name(f".{real.name}.{os.getpid()}")
    try:
        beside.write_bytes(content.encode(errors="backslashreplace") if isinstance(content, str) else content)
        beside.replace(real)
    except OSError as error:
        raise StoreError(f"cannot write {path}: {error.strerror}") from None
    finally:
        beside.unlink(missing_ok=True)
