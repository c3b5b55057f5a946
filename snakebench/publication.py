"""A study's results as a directory of files: put there in one switch, and read as they were published."""

import shutil
import tempfile
import time
from collections.abc import Callable, Collection, Iterator, Mapping
from contextlib import AbstractContextManager, contextmanager, suppress
from contextvars import ContextVar
from pathlib import Path
from typing import Any, NamedTuple

import pandas as pd
from filelock import FileLock, Timeout

from snakebench.errors import SnakebenchError, StoreError
from snakebench.files import inside, set_aside, synchronise, writable_directory, write_through
from snakebench.manifest import LEFT_OUT, MANIFEST, Damaged, command_of, left_out_files, manifest_text, read_manifest
from snakebench.policy import Policy
from snakebench.store import file_digest
from snakebench.tables import table_files
from snakebench.trajectory import Trajectory
from snakebench.value import digest

_NEW = ".new-results"  # where results are written before they take the place of older ones
_UNFINISHED = ".unfinished"  # a file where a first publication was interrupted, until one is finished
_PATIENCE = 5.0  # with results that are being exchanged [s]
_PAUSE = 0.02  # between two looks at them [s]
_READ: ContextVar[dict[str, str]] = ContextVar("what the studies that are read have published")


@contextmanager
def locked(directory: Path) -> Iterator[None]:
    """Keep other processes from writing the results in `directory` meanwhile; a process that dies lets go."""
    try:
        lock = file_lock(writable_directory(directory.parent / ".cache") / f"{directory.name}.lock", wait=False)
    except Timeout:
        raise StoreError(
            f"{directory} is being written by another snakebench: wait for it, or give another results directory"
        ) from None
    with lock:
        yield


def file_lock(path: Path, *, wait: bool) -> AbstractContextManager[object]:
    """The lock of a file, to be let go by `with`; `Timeout` if another process has it and it is not to `wait` for."""
    try:
        return FileLock(path, blocking=wait).acquire()
    except Timeout:
        raise
    except OSError as error:
        raise StoreError(f"cannot lock {path}: {error.strerror}") from None


def check_results(directory: Path) -> Path:
    """Make sure that results can be written to `directory`: it is new, empty, or holds results of this format."""
    if not directory.is_dir():
        return writable_directory(directory)
    if (directory / MANIFEST).exists():
        with suppress(Damaged):
            read_manifest(directory)
    elif not _begun(directory) and any(path.name[0] != "." for path in directory.iterdir()):
        raise StoreError(
            f"{directory} holds files, but no {MANIFEST} of snakebench: give another results directory, or move them"
        )
    return writable_directory(directory)


def _begun(directory: Path) -> bool:
    """Whether a first publication was interrupted."""
    return (directory / _UNFINISHED).exists() or (directory / _NEW / MANIFEST).exists()


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

    Only what the manifest of earlier results lists is replaced or removed. Anything else in the way is renamed, with a
    line for `say`. A copy of the results may lack the policies in `left_out`.
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
        if _begun(directory):  # some files of it may be in their places
            (directory / _UNFINISHED).touch()
        _write(directory / _NEW, files | {MANIFEST: manifest_text({**manifest, **listed}).encode()})
        _switch(directory, digests, say)
        (directory / _UNFINISHED).unlink(missing_ok=True)
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
    for name, seal in digests.items():
        path = inside(directory, name)
        if path.exists() and _digest_of(path) not in (seal, former.get(name, "")):
            say(f"{path} is not of earlier results: it is kept as {set_aside(path, 'replaced').name}")
        path.parent.mkdir(exist_ok=True)
        (directory / _NEW / name).replace(path)
    for folder in {inside(directory, name).parent for name in digests}:
        synchronise(folder)
    (directory / _NEW / MANIFEST).replace(directory / MANIFEST)
    synchronise(directory)
    shutil.rmtree(directory / _NEW, ignore_errors=True)


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
    with suppress(OSError):
        return file_digest(path.read_bytes())
    return None


@contextmanager
def reads_noted() -> Iterator[dict[str, str]]:
    """The studies that are read meanwhile, by name, with a digest of what they have published."""
    read: dict[str, str] = {}
    token = _READ.set(read)
    try:
        yield read
    finally:
        _READ.reset(token)


def note_read(study: str, manifest: Mapping[str, Any]) -> None:
    """Note that a study is read, whose manifest is given.

    Raises:
        StoreError: when it has published other results since it was read before.
    """
    now = published_digest(manifest)
    if _READ.get({}).setdefault(study, now) != now:
        raise StoreError(f"the results of {study} have changed while they were read: run the command again")


def published_digest(manifest: Mapping[str, Any]) -> str:
    """A digest of all files that a manifest lists: other results have another one."""
    return digest([manifest.get("files", {}), left_out_files(manifest)])


class Snapshot(NamedTuple):
    """A copy of published results, each study's of one run."""

    results: Path  # the original
    copy: Path  # a directory for each study
    problems: dict[str, str]  # studies that are not in the copy, and what is wrong with their results

    def original(self, text: str) -> str:
        """A text about the copy as one about the original."""
        return text.replace(str(self.copy), str(self.results))


@contextmanager
def snapshot(results: Path) -> Iterator[Snapshot]:
    """Copy all published results in a directory as their manifests list them; the copy is gone afterwards.

    What is missing, damaged or of another run is not copied, unless it is left out. Errors name the original.
    """
    with tempfile.TemporaryDirectory(prefix="snakebench-") as directory:
        taken = Snapshot(results, Path(directory), {})
        for path in sorted(results.glob(f"*/{MANIFEST}")):
            try:
                _copy(path.parent, taken.copy / path.parent.name)
            except StoreError as error:
                taken.problems[path.parent.name] = str(error)
                shutil.rmtree(taken.copy / path.parent.name, ignore_errors=True)
        try:
            yield taken
        except SnakebenchError as error:
            error.args = tuple(taken.original(str(part)) for part in error.args)
            raise


def _copy(directory: Path, copy: Path) -> None:
    deadline = time.monotonic() + _PATIENCE
    while True:
        before = _exchange(directory)
        try:
            return _copy_once(directory, copy)
        except Damaged:
            quiet = before == _exchange(directory) and not before[0]
            if quiet or time.monotonic() > deadline:
                raise
            time.sleep(_PAUSE)


def _exchange(directory: Path) -> tuple[bool, int]:
    """Whether results are being exchanged, and when it was last done [ns]."""
    manifest = directory / MANIFEST
    return (directory / _NEW / MANIFEST).exists(), manifest.stat().st_mtime_ns if manifest.exists() else 0


def _copy_once(directory: Path, copy: Path) -> None:
    manifest = read_manifest(directory)
    files, left_out = manifest.get("files", {}), left_out_files(manifest)
    shutil.rmtree(copy, ignore_errors=True)
    copy.mkdir()
    for name, seal in (files | left_out).items():
        try:
            content = inside(directory, name).read_bytes()
            wrong = "" if seal == file_digest(content) else " is not as the manifest lists it"
        except OSError as error:
            wrong = f": {error.strerror}"
        if not wrong:
            inside(copy, name).parent.mkdir(exist_ok=True)
            inside(copy, name).write_bytes(content)
        elif name not in left_out:
            raise Damaged(f"{directory / name}{wrong}: run the study again")
    (copy / MANIFEST).write_text(manifest_text(manifest), encoding="utf-8")
