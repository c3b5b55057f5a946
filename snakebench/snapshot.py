"""Published results as they were published: read from a copy that agrees with the manifests."""

from __future__ import annotations

import shutil
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import NamedTuple

from snakebench.errors import SnakebenchError, StoreError
from snakebench.files import inside
from snakebench.publication import NEW
from snakebench.store import MANIFEST, Damaged, file_digest, left_out_files, manifest_text, read_manifest

_OF_1_0 = ("*.csv", "trajectories/*.npz", "policies/*.safetensors")  # results, where a manifest lists none
_PATIENCE = 5.0  # with results that are being exchanged [s]
_PAUSE = 0.02  # between two looks at them [s]


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

    What is missing, cut, edited or of another run than its manifest is not copied; what it lists as left out may be
    missing or old. Where a manifest of version 1.0 lists no files, all are copied.

    Raises:
        SnakebenchError: of what is done with the copy, as if it were done with the original.
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
    """Copy results of one run, waiting while they are being exchanged."""
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
    return (directory / NEW / MANIFEST).exists(), manifest.stat().st_mtime_ns if manifest.exists() else 0


def _copy_once(directory: Path, copy: Path) -> None:
    manifest = read_manifest(directory)
    of_1_0 = (path for kind in _OF_1_0 for path in directory.glob(kind) if path.is_file())
    files = manifest["files"] if "files" in manifest else {str(path.relative_to(directory)): None for path in of_1_0}
    left_out = left_out_files(manifest)
    shutil.rmtree(copy, ignore_errors=True)
    copy.mkdir()
    for name, digest in (files | left_out).items():
        try:
            content = inside(directory, name).read_bytes()
            wrong = "" if digest in (None, file_digest(content)) else " is not as the manifest lists it"
        except OSError as error:
            wrong = f": {error.strerror}"
        if not wrong:
            inside(copy, name).parent.mkdir(exist_ok=True)
            inside(copy, name).write_bytes(content)
        elif name not in left_out:
            raise Damaged(f"{directory / name}{wrong}: run the study again")
    (copy / MANIFEST).write_text(manifest_text(manifest), encoding="utf-8")
