"""A study's results as a directory of files, put there in one switch.

The manifest lists every file by its SHA-256: publishing replaces or removes nothing that it does not list. Files that
are left out of the repository are listed apart, with the command that makes them: they may be missing. While results
are exchanged, the new manifest lies in `.new-results`, with the files still to come.
"""

from __future__ import annotations

import shutil
from collections.abc import Callable, Collection, Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import pandas as pd
from filelock import FileLock, Timeout

from snakebench.errors import StoreError
from snakebench.files import inside, set_aside, synchronise, writable_directory, write_through
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

NEW = ".new-results"  # where results are written before they take the place of older ones


@contextmanager
def locked(directory: Path) -> Iterator[None]:
    """Keep other processes from writing the results in `directory` meanwhile; a process that dies lets go.

    Raises:
        StoreError: when another one is writing them, or the lock cannot be made.
    """
    lock = FileLock(writable_directory(directory.parent / ".cache") / f"{directory.name}.lock", blocking=False)
    try:
        held = lock.acquire()
    except Timeout:
        raise StoreError(
            f"{directory} is being written by another snakebench: wait for it, or give another results directory"
        ) from None
    except OSError as error:
        raise StoreError(f"cannot lock {lock.lock_file}: {error.strerror}") from None
    with held:
        yield


def check_results(directory: Path) -> Path:
    """Make sure that results can be written to `directory`: it is new, empty, or holds results of this format.

    Hidden files do not count; they stay.

    Raises:
        StoreError: otherwise.
    """
    if not directory.is_dir():
        return writable_directory(directory)
    if (directory / MANIFEST).exists():
        with suppress(Damaged):
            read_manifest(directory)
    elif not (directory / NEW / MANIFEST).exists() and any(path.name[0] != "." for path in directory.iterdir()):
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
        manifest: further entries of the manifest, such as the study's settings.
        policies: likewise, policies/NAME.safetensors.
        say: called with a line about every file that is renamed.
        left_out: policies that a copy of the results may lack.

    Raises:
        StoreError: when they cannot be written, or a name leads out of the directory.
    """
    files = table_files(tables)
    files |= {f"trajectories/{name}.npz": trajectory.shown() for name, trajectory in trajectories.items()}
    files |= {f"policies/{name}.safetensors": policy.content() for name, policy in (policies or {}).items()}
    for name in files:
        inside(directory, name)
    digests = {name: file_digest(content) for name, content in sorted(files.items())}
    apart = {name: digests[name] for name in sorted(f"policies/{policy}.safetensors" for policy in left_out)}
    listed: dict[str, Any] = {"files": {name: digest for name, digest in digests.items() if name not in apart}}
    if apart:
        listed |= {LEFT_OUT: {"command": command_of(directory.name, manifest), "files": apart}}
    try:
        _write(directory / NEW, files | {MANIFEST: manifest_text({**manifest, **listed}).encode()})
        _switch(directory, digests, say)
    except OSError as error:
        raise StoreError(f"cannot write the results in {directory}: {error.strerror}") from None


def _write(directory: Path, files: Mapping[str, bytes]) -> None:
    """Write files into a new directory, all or none."""
    shutil.rmtree(directory, ignore_errors=True)
    try:
        for name, content in files.items():
            (directory / name).parent.mkdir(parents=True, exist_ok=True)
            write_through(directory / name, content)
    except BaseException:
        shutil.rmtree(directory, ignore_errors=True)
        raise


def _switch(directory: Path, digests: Mapping[str, str], say: Callable[[str], object]) -> None:
    """Exchange the files, then the manifest; whoever reads meanwhile finds files that are not as the manifest lists."""
    former = _former_digests(directory, say)
    for name in former.keys() - digests.keys():
        path = inside(directory, name)
        if _digest_of(path) == former[name]:
            path.unlink()
            with suppress(OSError):  # other files are there
                path.parent.rmdir()
    for name, digest in digests.items():
        path = inside(directory, name)
        if path.exists() and _digest_of(path) not in (digest, former.get(name)):
            say(f"{path} is not of earlier results: it is kept as {set_aside(path, 'replaced').name}")
        path.parent.mkdir(exist_ok=True)
        (directory / NEW / name).replace(path)
    for folder in {inside(directory, name).parent for name in digests}:
        synchronise(folder)
    (directory / NEW / MANIFEST).replace(directory / MANIFEST)
    synchronise(directory)
    shutil.rmtree(directory / NEW, ignore_errors=True)


def _former_digests(directory: Path, say: Callable[[str], object]) -> dict[str, str]:
    """The digest of every file that the manifest of earlier results lists; a damaged manifest is renamed."""
    if not (directory / MANIFEST).exists():
        return {}
    try:
        manifest = read_manifest(directory)
    except Damaged as error:
        say(f"{error}: it is kept as {set_aside(directory / MANIFEST, 'damaged').name}")
        return {}
    return manifest.get("files", {}) | left_out_files(manifest)


def _digest_of(path: Path) -> str | None:
    try:
        return file_digest(path.read_bytes())
    except OSError:
        return None
