"""What is remembered: the evaluation cache, result tables, and the manifest that says where they come from.

The cache is the only state of a study. Everything else in a results directory is written whole, by replacing files,
and can be made again from the cache by running the same command.
"""

from __future__ import annotations

import json
import os
import platform
import shutil
import subprocess
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from importlib import metadata
from pathlib import Path
from typing import Any, Self

import pandas as pd
from filelock import FileLock, Timeout
from pydantic import ValidationError

from snakebench.controllers import Fourier
from snakebench.database import Database
from snakebench.errors import InvalidValue, OtherFormat, SnakebenchError, StoreError
from snakebench.evaluation import Evaluation
from snakebench.files import writable_directory, write_file
from snakebench.policy import Policy
from snakebench.registry import load_plugins
from snakebench.sources import plugin_digest
from snakebench.trajectory import Trajectory

FORMAT = 1  # of the cache's table, the result tables and the manifest
_PACKAGES = (
    *("snakebench", "pybullet", "numpy", "scipy", "numba", "optuna", "pandas", "pymoo", "moocore", "cmaes", "torch"),
    *("gymnasium", "stable-baselines3", "sb3-contrib"),
)
SMALLER = ("quick", "smoke")  # profiles whose results stand beside the published ones, as STUDY-PROFILE
# Every study but quickstart, which is a small sea_snake; a study that reads results of others comes after them.
STUDIES = (
    *("validation", "sea_snake", "sea_snake_front", "pareto", "fourier", "teacher_student", "learned_front"),
    *("cross", "adaptation", "relearned", "sensitivity"),
)
PAPER, EXTENDED = "paper", "extended"  # search spaces of the sinusoidal torque: the paper's and a wider one
# What tables call that which a gait is tuned to, where it is not one fluid.
INTEGRATED = "integrated"  # all fluids, by the mean over them
SIMPLE_SUM = "simple-sum"  # each fluid by a gait of its own, switched at once: the name of a front
ADAPTIVE = "adaptive"  # whichever fluid it finds itself in, as a policy
_PUBLISHED = ("trajectories/*.npz", "policies/*.safetensors", "*.csv")  # beside the manifest
_TABLES = (
    "evaluations (key TEXT PRIMARY KEY, content TEXT NOT NULL)",
    "physics (engine TEXT, fingerprint TEXT PRIMARY KEY)",
)


class EvaluationCache:
    """Every evaluation ever made under one results directory, by key: one SQLite file; a context manager.

    Studies side by side may share it: each evaluation is written at once. A damaged file is set aside.

    Args:
        results: the directory.
        say: told when a damaged file is set aside.

    Raises:
        StoreError: when the file cannot be made or is of another format.
    """

    def __init__(self, results: Path, say: Callable[[str], object] = lambda _: None) -> None:
        self.results, self.directory = results, writable_directory(results / ".cache")
        self._database = Database(self.directory / "evaluations.sqlite", FORMAT, _TABLES, say)

    def get(self, key: str) -> Evaluation | None:
        """The evaluation stored under `key`; None when there is none or it is damaged.

        Raises:
            StoreError: when the file cannot be read.
        """
        row = next(iter(self._database.rows("SELECT content FROM evaluations WHERE key = ?", key)), None)
        try:
            return None if row is None else Evaluation.model_validate_json(row[0])
        except (ValidationError, SnakebenchError):
            return None

    def put(self, key: str, evaluation: Evaluation) -> None:
        """Store an evaluation under `key`, at once.

        Raises:
            StoreError: when it cannot be written.
        """
        self._database.rows("INSERT OR REPLACE INTO evaluations VALUES (?, ?)", key, evaluation.model_dump_json())

    def recognises(self, engine: str, fingerprint: str) -> bool:
        """Whether this engine's evaluations may be of the physics with this fingerprint; remembers it for later.

        Raises:
            StoreError: when it cannot be remembered.
        """
        known = self._database.rows("SELECT fingerprint FROM physics WHERE engine = ?", engine)
        self._database.rows("INSERT OR IGNORE INTO physics VALUES (?, ?)", engine, fingerprint)
        return not known or (fingerprint,) in known

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def __len__(self) -> int:
        return int(self._database.rows("SELECT count(*) FROM evaluations")[0][0])

    def close(self) -> None:
        """Release the file."""
        self._database.close()


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


def write_table(path: Path, table: pd.DataFrame) -> None:
    """Write a tidy table as CSV; floats keep every digit, so that equal results are equal bytes."""
    write_file(path, table.to_csv(index=False, lineterminator="\n"))


def read_table(path: Path) -> pd.DataFrame:
    """Read a table of a study.

    Raises:
        StoreError: when it is missing or unreadable.
    """
    try:
        return pd.read_csv(path)
    except (OSError, ValueError) as error:
        raise StoreError(f"cannot read the table {path}: {error}") from None


def fourier_gait(rows: pd.DataFrame) -> Fourier:
    """The gait of a table of coefficients: columns frequency, harmonic, joint, cosine, sine."""
    cosine, sine = (
        tuple(map(tuple, rows.pivot(index="harmonic", columns="joint", values=name).to_numpy().tolist()))
        for name in ("cosine", "sine")
    )
    return Fourier(frequency=float(rows["frequency"].to_numpy()[0]), cosine=cosine, sine=sine)


def provenance() -> dict[str, Any]:
    """What runs here and now: versions of packages, the commit of the source, digests of plug-ins, the machine."""
    plugins = plugin_digests()
    return {
        "versions": {"python": platform.python_version()} | {name: _version(name) for name in _PACKAGES},
        "commit": _commit(),
        **({"plugins": plugins} if plugins else {}),
        "machine": {"system": platform.platform(), "processor": platform.machine(), "cores": os.cpu_count()},
    }


def plugin_digests() -> dict[str, str | None]:
    """The digest of the code of each plug-in, by its name; None where it is in no file.

    Raises:
        InvalidValue: naming the plug-in that cannot be imported.
    """
    return {name: _code_of(loaded) for name, loaded in load_plugins().items()}


def _code_of(plugin: object) -> str | None:
    """The digest of the module of a plug-in; None where it is in no file."""
    with suppress(InvalidValue, TypeError):
        return plugin_digest(plugin)
    return None


def write_manifest(directory: Path, content: Mapping[str, Any]) -> None:
    """Write what is known about the results in a directory; it marks them as complete."""
    write_file(directory / "manifest.json", json.dumps({"format": FORMAT, **content}, indent=2) + "\n")


def publish(
    directory: Path,
    tables: Mapping[str, pd.DataFrame],
    trajectories: Mapping[str, Trajectory],
    manifest: Mapping[str, Any],
    policies: Mapping[str, Policy] | None = None,
) -> None:
    """Put new results in the place of old ones; all are written aside first, so that a full disk leaves the old ones.

    Raises:
        StoreError: when they cannot be written.
    """
    aside = directory / ".new"
    shutil.rmtree(aside, ignore_errors=True)
    try:
        _write_aside(aside, tables, trajectories, manifest, policies or {})
        files = [file for kind in _PUBLISHED for file in aside.glob(kind)]
        for name in {file.parent.name for file in files} - {aside.name}:
            writable_directory(directory / name)
        (directory / "manifest.json").unlink(missing_ok=True)  # first out, last in: it declares the results complete
        for old in (file for kind in _PUBLISHED for file in directory.glob(kind)):
            old.unlink()
        for new in (*files, aside / "manifest.json"):
            new.replace(directory / new.relative_to(aside))
    except OSError as error:
        raise StoreError(f"cannot write the results in {directory}: {error.strerror}") from None
    finally:
        shutil.rmtree(aside, ignore_errors=True)


def _write_aside(
    aside: Path,
    tables: Mapping[str, pd.DataFrame],
    trajectories: Mapping[str, Trajectory],
    manifest: Mapping[str, Any],
    policies: Mapping[str, Policy],
) -> None:
    runs = writable_directory(aside / "trajectories")
    for name, table in tables.items():
        write_table(aside / f"{name}.csv", table)
    for name, trajectory in trajectories.items():
        trajectory.save(runs / f"{name}.npz")
    for name, policy in policies.items():
        policy.save(writable_directory(aside / "policies") / f"{name}.safetensors")
    write_manifest(aside, manifest)


def command_of(directory: str, manifest: Mapping[str, Any] | None = None) -> str:
    """The command that makes the results in a directory of that name; the one that made them, if a manifest tells."""
    if manifest and manifest.get("command"):
        return str(manifest["command"])
    study, _, profile = directory.partition("-")
    return f"snakebench run-study {study}" + (f" --profile {profile}" if profile in SMALLER else "")


def read_manifest(directory: Path) -> dict[str, Any]:
    """Read the manifest of a results directory.

    Raises:
        StoreError: when there is none, or it was written in another format.
    """
    path = directory / "manifest.json"
    try:
        manifest = json.loads(path.read_text(encoding="utf-8"))
        found = manifest["format"]
    except (OSError, ValueError, KeyError, TypeError, RecursionError) as error:
        raise StoreError(f"{directory} holds no results of snakebench: {path.name}: {error}") from None
    if found != FORMAT:
        raise OtherFormat(directory, found, FORMAT)
    return dict(manifest)


def check_results(directory: Path) -> Path:
    """Make sure that results can be written to `directory` and that none of another format are there.

    Raises:
        StoreError: otherwise.
    """
    if (directory / "manifest.json").exists():
        read_manifest(directory)
    return writable_directory(directory)


def _version(package: str) -> str | None:
    try:
        return metadata.version(package)
    except metadata.PackageNotFoundError:
        return None


def _commit() -> str | None:
    """The commit of the source that runs, with `+` when it has uncommitted changes; None outside a checkout."""
    source = Path(__file__).parent
    try:
        answer = subprocess.run(
            ["git", "describe", "--always", "--dirty=+", "--abbrev=12", "--exclude=*"],
            cwd=source,
            capture_output=True,
            text=True,
            timeout=10,
            check=True,
        )
        tracked = subprocess.run(["git", "ls-files", "--error-unmatch", __file__], cwd=source, capture_output=True)
    except (OSError, subprocess.SubprocessError):
        return None
    return answer.stdout.strip() if tracked.returncode == 0 else None
