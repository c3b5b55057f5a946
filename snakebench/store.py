"""The evaluation cache, and the manifest of results, which says where they come from."""

import hashlib
import json
import os
import platform
import sqlite3
import subprocess
from collections.abc import Callable, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any, Self

from snakebench.errors import InvalidValue, OtherFormat, StoreError
from snakebench.files import set_aside, writable_directory
from snakebench.registry import load_plugins
from snakebench.sources import package_version, plugin_digest
from snakebench.value import digest
from snakebench.version import __version__

MANIFEST = "manifest.json"
LEFT_OUT = "left_out"  # of a manifest: files that a copy of the results may lack, and the command that makes them
_DIGEST = "digest"  # of a manifest, by its own name in it
FORMAT = 1  # of the cache's table, the result tables and the manifest
_PACKAGES = (
    *("pybullet", "numpy", "scipy", "numba", "optuna", "pandas", "pymoo", "moocore", "cmaes", "torch"),
    *("gymnasium", "stable-baselines3", "sb3-contrib", "casadi", "onnxruntime"),
)
SMALLER = ("quick", "smoke")  # profiles whose results stand beside the published ones, as STUDY-PROFILE
# Every study but quickstart, which is a small sea_snake; a study that reads results of others comes after them.
STUDIES = (
    *("validation", "sea_snake", "sea_snake_front", "pareto", "tuning", "teacher_student", "ablations", "memory"),
    *("learned_front", "limit", "fourier", "imitation", "gain_schedule"),
    *("operating_point", "cross", "adaptation", "relearned", "sensitivity", "robust", "robustness"),
)
PAPER, EXTENDED = "paper", "extended"  # search spaces of the sinusoidal torque: the paper's and a wider one
FASTER, STRONGER = "faster", "stronger"  # those between: wider in frequency only, and in torque only
# What tables call that which a gait is tuned to, where it is not one fluid.
INTEGRATED = "integrated"  # all fluids, by the mean over them
SIMPLE_SUM = "simple-sum"  # each fluid by a gait of its own, switched at once: the name of a front
CURRENCIES = {"net": "power", "positive": "positive_power"}  # of fronts, and the column of the power that each counts
ADAPTIVE = "adaptive"  # whichever fluid it finds itself in, as a policy
_PATIENCE = 60.0  # with another process that writes the file [s]
_BESIDE = ("-shm", "-wal")  # endings of SQLite's files beside it; those of a damaged file must not meet the new one
_TABLES = (
    "evaluations (key TEXT PRIMARY KEY, content TEXT NOT NULL)",
    "physics (engine TEXT, fingerprint TEXT PRIMARY KEY)",
)


def provenance() -> dict[str, Any]:
    """What runs here and now: versions of packages, the commit of the source, digests of plug-ins, the machine."""
    plugins, packages = plugin_digests(), {name: package_version(name) for name in _PACKAGES}
    return {
        "versions": {"python": platform.python_version(), "snakebench": __version__} | packages,
        "commit": commit_of(__file__),
        **({"plugins": plugins} if plugins else {}),
        "machine": {"system": platform.platform(), "processor": platform.machine(), "cores": os.cpu_count()},
    }


def plugin_digests() -> dict[str, str | None]:
    """The digest of the code of each plug-in, by its name; None where it is in no file."""
    digests: dict[str, str | None] = dict.fromkeys(load_plugins())
    for name, plugin in load_plugins().items():
        with suppress(InvalidValue, TypeError):
            digests[name] = plugin_digest(plugin)
    return digests


def manifest_text(content: Mapping[str, Any]) -> str:
    """A manifest as JSON, with its format and a digest of all else, by which damage is found."""
    content = {"format": FORMAT} | {name: part for name, part in content.items() if name != _DIGEST}
    return json.dumps({**content, _DIGEST: digest(content)}, indent=2) + "\n"


def command_of(directory: str, manifest: Mapping[str, Any] | None = None) -> str:
    """The command that makes the results in a directory of that name; the one that made them, if a manifest tells."""
    if manifest and manifest.get("command"):
        return str(manifest["command"])
    study, _, profile = directory.rpartition("-")
    if study and profile in SMALLER:
        return f"snakebench run-study {study} --profile {profile}"
    return f"snakebench {'bench' if directory == 'bench' else f'run-study {directory}'}"


def read_manifest(directory: Path) -> dict[str, Any]:
    """Read the manifest of a results directory; it is `Damaged` when it is not as it was written."""
    path, nothing = directory / MANIFEST, f"{directory} holds no results of snakebench: {MANIFEST}"
    try:
        manifest = json.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise StoreError(f"{nothing}: {error.strerror}") from None
    except (ValueError, RecursionError) as error:
        raise Damaged(f"{nothing} is damaged: {error}") from None
    if not isinstance(manifest, dict) or not manifest:
        raise Damaged(f"{nothing} is damaged: it says nothing")
    if manifest.keys().isdisjoint({"format", "study", "config", _DIGEST}):
        raise StoreError(f"{nothing} is of another program")
    if isinstance(found := manifest.get("format"), int) and found != FORMAT:
        raise OtherFormat(directory, found, FORMAT)
    written, lists = manifest.pop(_DIGEST, None), (manifest.get("files", {}), left_out_files(manifest))
    listed = all(isinstance(part, dict) and all(isinstance(seal, str) for seal in part.values()) for part in lists)
    if found != FORMAT or not listed or written != digest(manifest):
        raise Damaged(f"{nothing} is damaged: it is not as it was written")
    return manifest


def left_out_files(manifest: Mapping[str, Any]) -> dict[str, str]:
    """The files that a copy of the results may lack, and their digests."""
    left_out = manifest.get(LEFT_OUT, {})
    return left_out.get("files", {}) if isinstance(left_out, dict) else left_out


def file_digest(content: bytes) -> str:
    """SHA-256 of a file's content, by which a manifest lists it."""
    return hashlib.sha256(content).hexdigest()


class Damaged(StoreError):
    """Results or a manifest that are not as they were written."""


def commit_of(file: str) -> str | None:
    """The commit of a package that a file lies in, with `+` when it or the studies beside it have uncommitted changes.

    Results do not count: a study may have published new ones just before. None outside a checkout.
    """
    folder, name = os.path.split(file)

    def git(*words: str) -> str:
        run = subprocess.run(["git", "-C", folder, *words], capture_output=True, text=True, timeout=10, check=True)
        return run.stdout.strip()

    try:
        git("ls-files", "--error-unmatch", name)
        changed = git("status", "--porcelain", "--", ".", "../studies")
        return git("rev-parse", "--short=12", "HEAD") + ("+" if changed else "")
    except (OSError, subprocess.SubprocessError):
        return None


class EvaluationCache:
    """Every evaluation ever made under one results directory, by key: one SQLite file, which several studies may share.

    When SQLite finds it damaged, it is set aside, `say` is called with a line about it, and a new one is begun.
    """

    def __init__(self, results: Path, say: Callable[[str], object] = lambda _: None) -> None:
        self.results, self.directory, self._say = results, writable_directory(results / ".cache"), say
        self._path = self.directory / "evaluations.sqlite"
        self._connection: sqlite3.Connection | None = None
        self._rows("SELECT 1")

    def get(self, key: str) -> str | None:
        """What is stored under `key`; None when there is nothing, or it is not as it was stored."""
        for (row,) in self._rows("SELECT content FROM evaluations WHERE key = ?", key):
            seal, _, content = str(row).partition(" ")
            if seal == digest([key, content]):
                return content
            self._say(f"{self._path}: an evaluation is damaged; it is made again")
        return None

    def put(self, key: str, content: str) -> None:
        """Store a text under `key`, at once."""
        row = f"{digest([key, content])} {content}"
        self._rows("INSERT OR REPLACE INTO evaluations VALUES (?, ?)", key, row)

    def recognises(self, engine: str, fingerprint: str) -> bool:
        """Whether this engine's evaluations may be of the physics with this fingerprint; remembers it for later."""
        known = self._rows("SELECT fingerprint FROM physics WHERE engine = ?", engine)
        self._rows("INSERT OR IGNORE INTO physics VALUES (?, ?)", engine, fingerprint)
        return not known or (fingerprint,) in known

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Release the file."""
        if self._connection is not None:
            self._connection.close()
            self._connection = None

    def _rows(self, statement: str, *values: str) -> list[tuple[Any, ...]]:
        """What a statement answers; when the file turns out to be damaged, a new one is asked."""
        try:
            try:
                return self._opened().execute(statement, values).fetchall()
            except sqlite3.DatabaseError as error:
                if type(error) is not sqlite3.DatabaseError:  # not damaged, but locked, full or read-only
                    raise
                self._set_aside(error)
                return self._opened().execute(statement, values).fetchall()
        except sqlite3.Error as error:
            raise StoreError(f"cannot use {self._path}: {error}") from None

    def _opened(self) -> sqlite3.Connection:
        if self._connection is not None:
            return self._connection
        connection = sqlite3.connect(self._path, isolation_level=None, timeout=_PATIENCE)
        connection.text_factory = lambda text: text.decode(errors="replace")  # the seal of damaged text does not fit
        try:
            (found,) = connection.execute("PRAGMA user_version").fetchone()
            if found not in (0, FORMAT):
                raise OtherFormat(self._path, found, FORMAT)
            (sound,) = connection.execute("PRAGMA quick_check(1)").fetchone()
            if sound != "ok":
                raise sqlite3.DatabaseError("it fails SQLite's own check")
            connection.execute("PRAGMA journal_mode = WAL")
            connection.execute("PRAGMA synchronous = NORMAL")
            for table in _TABLES:
                connection.execute(f"CREATE TABLE IF NOT EXISTS {table}")
            connection.execute(f"PRAGMA user_version = {FORMAT}")
        except BaseException:
            connection.close()
            raise
        self._connection = connection
        return connection

    def _set_aside(self, error: sqlite3.DatabaseError) -> None:
        self.close()
        try:
            place = set_aside(self._path, "damaged", _BESIDE)
        except OSError as trouble:
            raise StoreError(f"{self._path} is damaged, and cannot be renamed: {trouble}") from None
        self._say(f"{self._path} is damaged ({error}): it is kept as {place.name}, and a new one is begun")
