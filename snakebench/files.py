"""Files are written whole or not at all."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Iterable, Sequence
from contextlib import suppress
from itertools import chain, combinations, product
from pathlib import Path

from snakebench.errors import StoreError

_MOST_SET_ASIDE = 10_000  # files of one name


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


def check_outputs(outputs: Sequence[Path], inputs: Iterable[Path] = ()) -> None:
    """Make sure that files can be written, each to a place of its own that is no input.

    Raises:
        StoreError: otherwise.
    """
    for path in outputs:
        writable_file(path)
    for one, other in combinations(outputs, 2):
        if _same(one, other):
            raise StoreError(f"cannot write {one} and {other}: they are the same file")
    for output, given in product(outputs, inputs):
        if _same(output, given):
            raise StoreError(f"cannot write {output}: it is read as an input; give another file")


def inside(directory: Path, name: str) -> Path:
    """The path of a file in a directory, which a name cannot lead out of, nor a link on the way.

    Raises:
        StoreError: when it does.
    """
    path = directory / name
    if not path.parent.resolve().is_relative_to(directory.resolve()) or path.name in ("", "..", "."):
        raise StoreError(f"{name!r} is no file inside {directory}")
    return path


def set_aside(path: Path, ending: str, companions: Sequence[str] = ()) -> Path:
    """Rename a file to NAME.ending, or NAME.ending-2 and so on, and return its new path; nothing is overwritten.

    Args:
        path: of the file.
        ending: of the new name.
        companions: endings of files beside it, such as "-wal", which go with it where they are there.

    Raises:
        OSError: when it cannot be renamed, or there are 10 000 such files.
    """
    places = (path.with_name(f"{path.name}.{ending}{'' if n == 1 else f'-{n}'}") for n in range(1, _MOST_SET_ASIDE))
    for place in places:
        if not any(Path(f"{place}{companion}").exists() for companion in chain(companions, [""])):
            for companion in chain(companions, [""]):
                with suppress(FileNotFoundError):
                    Path(f"{path}{companion}").rename(f"{place}{companion}")
            return place
    raise FileExistsError(f"there are {_MOST_SET_ASIDE} files set aside")


def synchronise(directory: Path) -> None:
    """Wait until the names of a directory's files are on the disk, where the system can say."""
    if hasattr(os, "O_DIRECTORY"):
        with suppress(OSError):
            handle = os.open(directory, os.O_RDONLY | os.O_DIRECTORY)
            try:
                os.fsync(handle)
            finally:
                os.close(handle)


def write_file(path: Path, content: str | bytes) -> None:
    """Write a file, text as UTF-8: a reader sees the old file or the new one, never a part.

    Raises:
        StoreError: when it cannot be written; the old file is then untouched.
    """
    real = writable_file(path)
    beside = real.with_name(f".{real.name}.{os.getpid()}")
    try:
        with beside.open("wb") as file:
            file.write(content.encode(errors="backslashreplace") if isinstance(content, str) else content)
            file.flush()
            os.fsync(file.fileno())  # or a loss of power could leave the new name with nothing in it
        beside.replace(real)
        synchronise(real.parent)
    except OSError as error:
        raise StoreError(f"cannot write {path}: {error.strerror}") from None
    finally:
        beside.unlink(missing_ok=True)


def _same(one: Path, other: Path) -> bool:
    with suppress(OSError):
        if one.samefile(other):
            return True
    return one.resolve() == other.resolve()
