"""A study's results as a directory of files, put there in one switch.

The manifest lists every file by its SHA-256: publishing replaces or removes nothing that it does not list. Files that
are left out of the repository are listed apart, with the command that makes them: they may be missing. While results
are exchanged, the new manifest lies in `.new`, with the files still to come.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Collection, Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import pandas as pd
from filelock import FileLock, Timeout

from snakebench.errors import StoreError
from snakebench.files import inside, set_aside, synchronise, writable_directory
from snakebench.policy import Policy
from snakebench.store import (
    LEFT_OUT,
    MANIFEST,
    Damaged,
    command_of,
    file_digest,
    left_out_files,
    manifest_text,
    read_manifest,
)
from snakebench.tables import table_files
from snakebench.trajectory import Trajectory

NEW = ".new"  # where results are written before they take the place of older ones


@contextmanager
def alone(directory: Path) -> Iterator[None]:
    """Keep other processes from writing the results in `directory` meanwhile; a process that dies lets go.

    Raises:
        StoreError: when another one is writing them, or the lock cannot be made.
    """
    lock = FileLock(writable_directory(directory.parent / ".cache") / f"{directory.name}.lock", blocking=False)
    try:
        lock.acquire()
    except Timeout:
        raise StoreError(
            f"{directory} is being written by another snakebench: wait for it, or give another results directory"
        ) from None
    except OSError as error:
        raise StoreError(f"cannot lock {lock.lock_file}: {error.strerror}") from None
    try:
        yield
    finally:
        lock.release()


def check_results(directory: Path) -> Path:
    """Make sure that results can be written to `directory`: it is new, empty, or holds results of this format.

    Hidden files do not count; they stay.

    Raises:
        StoreError: otherwise.
    """
    if not directory.is_dir():
        return writable_directory(directory)
    manifests = [path for path in (directory / MANIFEST, directory / NEW / MANIFEST) if path.exists()]
    for path in manifests:
        with suppress(Damaged):
            read_manifest(path.parent)
    if not manifests and any(not path.name.startswith(".") for path in directory.iterdir()):
        raise StoreError(
            f"{directory} holds files, but no {MANIFEST} of snakebench: give another results directory, or move them"
        )
    return writable_directory(directory)


def publish(
    directory: Path,
    tables: Mapping[str, pd.DataFrame],
    trajectories: Mapping[str, Trajectory],
    manifest: Mapping[str, Any],
    policies: Mapping[str, Policy] | None = None,
    say: Callable[[str], object] = lambda _: None,
    left_out: Collection[str] = (),
) -> None:
    """Put new results in the place of old ones; all are written aside first, so that a full disk leaves the old ones.

    Files of earlier results are replaced or removed if they are as their manifest lists them. Another file in the way
    is renamed to NAME.replaced, a damaged manifest to manifest.json.damaged.

    Args:
        directory: where they go.
        tables: by the names of their files, NAME.csv, or NAME.csv.gz where they are large.
        trajectories: likewise, trajectories/NAME.npz, as `Trajectory.shown`.
        manifest: what is known about them.
        policies: likewise, policies/NAME.safetensors.
        say: told of every file that is renamed.
        left_out: policies that a copy of the results may lack.

    Raises:
        StoreError: when they cannot be written, or a name leads out of the directory.
    """
    files = table_files(tables)
    files |= {f"trajectories/{name}.npz": trajectory.shown() for name, trajectory in trajectories.items()}
    files |= {f"policies/{name}.safetensors": policy.content() for name, policy in (policies or {}).items()}
    digests = {name: file_digest(content) for name, content in files.items()}
    new = directory / NEW
    for name in files:
        inside(directory, name)
    try:
        former = _listed(directory)
        _remove_new(new)
        try:
            apart = {f"policies/{name}.safetensors" for name in left_out}
            listed = listing(digests, apart, command_of(directory.name, manifest))
            _write(new / MANIFEST, manifest_text({**manifest, **listed}).encode())
            for name, content in files.items():
                _write(inside(new, name), content)
        except BaseException:
            _remove_new(new)
            raise
        _switch(directory, former, digests, say)
    except OSError as error:
        raise StoreError(f"cannot write the results in {directory}: {error.strerror}") from None


def listing(digests: Mapping[str, str], apart: Collection[str], command: str) -> dict[str, Any]:
    """The files as a manifest lists them: those apart as left out, with the command that makes them."""
    files = {name: digest for name, digest in sorted(digests.items()) if name not in apart}
    rest = {name: digest for name, digest in sorted(digests.items()) if name in apart}
    return {"files": files} | ({LEFT_OUT: {"command": command, "files": rest}} if rest else {})


def _switch(
    directory: Path, former: Mapping[str, set[str]], digests: Mapping[str, str], say: Callable[[str], object]
) -> None:
    """Exchange the files, then the manifest; whoever reads meanwhile finds files that are not as the manifest lists."""
    new = directory / NEW
    for name in former.keys() - digests.keys():
        path = inside(directory, name)
        if _digest_of(path) in former[name]:
            path.unlink()
            _remove_empty(path.parent, directory)
    for name, digest in digests.items():
        path = inside(directory, name)
        if path.exists() and _digest_of(path) not in {digest, *former.get(name, ())}:
            say(f"{path} is not of earlier results: it is kept as {set_aside(path, 'replaced').name}")
        path.parent.mkdir(exist_ok=True)
        inside(new, name).replace(inside(directory, name))
        _remove_empty(inside(new, name).parent, new)
    for folder in {inside(directory, name).parent for name in digests}:
        synchronise(folder)
    path = directory / MANIFEST
    if path.exists():
        try:
            read_manifest(directory)
        except Damaged as error:
            say(f"{error}: it is kept as {set_aside(path, 'damaged').name}")
    (new / MANIFEST).replace(path)
    synchronise(directory)
    _remove_new(new)


def _listed(directory: Path) -> dict[str, set[str]]:
    """The digests of every file that the manifest lists, or that of an exchange which was interrupted."""
    listed: dict[str, set[str]] = {}
    for path in (directory / MANIFEST, directory / NEW / MANIFEST):
        if path.exists():
            with suppress(Damaged):
                manifest = read_manifest(path.parent)
                for name, digest in [*manifest.get("files", {}).items(), *left_out_files(manifest).items()]:
                    listed.setdefault(name, set()).add(digest)
    return listed


def _remove_new(new: Path) -> None:
    """Remove what an exchange that was interrupted has left.

    Raises:
        StoreError: when something else lies there.
    """
    if not new.exists():
        return
    if (new / MANIFEST).exists():
        with suppress(Damaged):
            manifest = read_manifest(new)
            for name in [*manifest.get("files", {}), *left_out_files(manifest)]:
                inside(new, name).unlink(missing_ok=True)
    for folder in new.iterdir():
        if folder.is_dir():
            _remove_empty(folder, new)
    (new / MANIFEST).unlink(missing_ok=True)
    try:
        new.rmdir()
    except OSError:
        raise StoreError(f"{new} holds files that are not snakebench's: move them") from None


def _remove_empty(folder: Path, above: Path) -> None:
    if folder != above:
        with suppress(OSError):
            folder.rmdir()


def _write(path: Path, content: bytes) -> None:
    path.parent.mkdir(exist_ok=True)
    with path.open("wb") as file:
        file.write(content)
        file.flush()
        os.fsync(file.fileno())


def _digest_of(path: Path) -> str | None:
    try:
        return file_digest(path.read_bytes())
    except OSError:
        return None
