"""Files are written whole or not at all; JSON files that describe one thing are read."""

import json
import os
import tempfile
from collections.abc import Iterable, Sequence
from contextlib import suppress
from itertools import combinations, count, product
from pathlib import Path
from secrets import token_hex
from typing import Any

from snakebench.errors import InvalidValue, StoreError

_SHOWN = 40  # characters of a name that a file on its way keeps: the longest names have 255 bytes
_LONGEST = 100_000_000  # characters of a JSON file; a device such as /dev/zero has no end


def writable_directory(path: Path) -> Path:
    """Make sure that `path` is a directory that files can be written to."""
    try:
        path.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=path):
            pass
    except OSError as error:
        raise StoreError(f"cannot write to the directory {path}: {error.strerror}") from None
    return path


def readable_file(path: Path) -> Path:
    """Make sure that `path` is no device, pipe or directory: /dev/zero never ends. Its reader tells what is missing."""
    if path.exists() and not path.is_file():
        raise StoreError(f"cannot read {path}: it is not a regular file")
    return path


def read_object(path: Path, what: str, fields: str) -> dict[str, Any]:
    """What is in a JSON file or a pipe: an object that describes a gait or a robot by its `fields`.

    Raises:
        InvalidValue: when it cannot be read, or is no such object.
    """
    try:
        with path.open(encoding="utf-8") as file:
            return parsed_object(file.read(_LONGEST), path, what, fields)
    except (OSError, UnicodeDecodeError) as error:
        raise InvalidValue(f"cannot read the {what} {path}: {error}") from None


def parsed_object(content: str | bytes, path: Path, what: str, fields: str) -> dict[str, Any]:
    """The same of what was read of a file."""
    try:
        found = json.loads(content)
    except (ValueError, RecursionError) as error:
        raise InvalidValue(f"cannot read the {what} {path}: {error}") from None
    if not isinstance(found, dict):
        raise InvalidValue(f"{path} is no {what}: a JSON object with {fields} is needed")
    return found


def writable_file(path: Path | str) -> Path:
    """Make sure that a file can be written to `path`: the real path, links followed, is returned."""
    path = Path(path)
    try:
        real = path.resolve()
        if real.exists() and not real.is_file():
            raise StoreError(f"cannot write {path}: it is not a regular file")
    except (OSError, RuntimeError) as error:  # a name too long, a loop of links
        raise StoreError(f"cannot write {path}: {getattr(error, 'strerror', None) or error}") from None
    if not real.parent.is_dir():
        raise StoreError(f"cannot write {path}: {real.parent} is not a directory")
    writable_directory(real.parent)
    return real


def check_outputs(outputs: Sequence[Path], inputs: Iterable[Path | str | None] = ()) -> None:
    """Make sure that files can be written, each to a place of its own that is no input; None is an input not given."""
    for path in outputs:
        writable_file(path)
    for path, other in combinations(outputs, 2):
        if _same(path, other):
            raise StoreError(f"cannot write {path} and {other}: they are the same file")
    for output, path in product(outputs, [Path(given) for given in inputs if given]):
        if _same(output, path):
            raise StoreError(f"cannot write {output}: it is read as an input; give another file")


def inside(directory: Path, name: str) -> Path:
    """The path of a file in a directory, which a name cannot lead out of, nor a link on the way."""
    path = directory / name
    if not path.parent.resolve().is_relative_to(directory.resolve()) or path.name in ("", "..", "."):
        raise StoreError(f"{name!r} is no file inside {directory}")
    return path


def set_aside(path: Path, ending: str, companions: Sequence[str] = ()) -> Path:
    """Rename a file and companions, such as NAME-wal, to NAME.ending, or NAME.ending-2 and so on; returns its path."""
    endings = (*companions, "")
    places = (f"{path}.{ending}{'' if n == 1 else f'-{n}'}" for n in count(1))
    place = next(place for place in places if not any(Path(place + last).exists() for last in endings))
    for last in endings:
        with suppress(FileNotFoundError):
            Path(f"{path}{last}").rename(place + last)
    return Path(place)


def synchronise(directory: Path) -> None:
    """Wait until the names of a directory's files are on the disk, where the system can tell."""
    with suppress(OSError, AttributeError):
        handle = os.open(directory, os.O_RDONLY | os.O_DIRECTORY)
        try:
            os.fsync(handle)
        finally:
            os.close(handle)


def write_through(path: Path, content: bytes) -> None:
    """Write a file and wait until it is on the disk; a loss of power could else leave its name with nothing in it."""
    with path.open("wb") as file:
        file.write(content)
        file.flush()
        os.fsync(file.fileno())


def write_file(path: Path | str, content: str | bytes) -> None:
    """Write a file, text as UTF-8: a reader sees the old file or the new one, never a part."""
    real = writable_file(path)
    beside = real.with_name(f".{real.name[:_SHOWN]}.{os.getpid()}-{token_hex(4)}")
    try:
        write_through(beside, content.encode(errors="backslashreplace") if isinstance(content, str) else content)
        beside.replace(real)
        synchronise(real.parent)
    except OSError as error:
        raise StoreError(f"cannot write {path}: {error.strerror}") from None
    finally:
        with suppress(OSError):
            beside.unlink(missing_ok=True)


def _same(path: Path, other: Path) -> bool:
    with suppress(OSError):  # one is missing, or its name too long
        return path.samefile(other)
    return os.path.realpath(path) == os.path.realpath(other)
