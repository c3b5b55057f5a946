"""The evaluation cache: every evaluation ever made under one results directory."""

import hashlib
import sqlite3
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any, Self

from snakebench.errors import OtherFormat, StoreError
from snakebench.files import set_aside, writable_directory
from snakebench.value import digest

FORMAT = 1  # of the cache's table, the result tables and the manifest
_PATIENCE = 60.0  # with another process that writes the file [s]
_BESIDE = ("-shm", "-wal")  # endings of SQLite's files beside it; those of a damaged file must not meet the new one
_TABLES = (
    "evaluations (key TEXT PRIMARY KEY, content TEXT NOT NULL)",
    "physics (engine TEXT, fingerprint TEXT PRIMARY KEY)",
)


def file_digest(content: bytes) -> str:
    """SHA-256 of a file's content, by which a manifest lists it."""
    return hashlib.sha256(content).hexdigest()


class EvaluationCache:
    """Every evaluation ever made under one results directory, by key: one SQLite file, which several studies may share.

    When SQLite finds it damaged, it is set aside, `say` is called with a line about it, and a new one is begun.
    """

    def __init__(self, results: Path, say: Callable[[str], object] = lambda _: None) -> None:
        self.results, self.directory, self._say = results, writable_directory(results / ".cache"), say
        self._path = self.directory / "evaluations.sqlite"
        self._connection: sqlite3.Connection | None = None
        self._file: tuple[int, int] | None = None  # that the connection is to
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
            except (sqlite3.DatabaseError, UnicodeDecodeError) as error:  # SQLite's message may quote damaged text
                if type(error) not in (sqlite3.DatabaseError, UnicodeDecodeError):  # locked, full or read-only
                    raise
                self._set_aside(error)
                return self._opened().execute(statement, values).fetchall()
        except sqlite3.Error as error:
            raise StoreError(f"cannot use {self._path}: {error}") from None

    def _opened(self) -> sqlite3.Connection:
        if self._connection is not None:
            return self._connection
        connection = sqlite3.connect(self._path, isolation_level=None, timeout=_PATIENCE)
        self._file = self._identity()
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

    def _identity(self) -> tuple[int, int] | None:
        with suppress(OSError):
            found = self._path.stat()
            return found.st_dev, found.st_ino
        return None

    def _set_aside(self, error: Exception) -> None:
        self.close()
        if self._file != self._identity():  # another process has set it aside already
            return
        try:
            place = set_aside(self._path, "damaged", _BESIDE)
        except OSError as trouble:
            raise StoreError(f"{self._path} is damaged, and cannot be renamed: {trouble}") from None
        self._say(f"{self._path} is damaged ({error}): it is kept as {place.name}, and a new one is begun")
