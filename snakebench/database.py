"""One SQLite file that survives its own damage: what is damaged is set aside, never deleted, and begun anew."""

from __future__ import annotations

import sqlite3
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, TypeVar

from filelock import FileLock, Timeout

from snakebench.errors import OtherFormat, StoreError
from snakebench.files import set_aside

_T = TypeVar("_T")
_PATIENCE = 60.0  # with another process that writes it [s]
_BESIDE = ("-shm", "-wal")  # what SQLite keeps beside the file; of a damaged one it must not meet the new one


class Database:
    """An SQLite file with its tables, which processes may share: each statement is written at once.

    A file that SQLite finds damaged, at first or later, is renamed to NAME.damaged, or NAME.damaged-2 and so on.

    Args:
        path: of the file.
        version: of the format that it has.
        tables: their names and columns, as in CREATE TABLE.
        say: told when a damaged file is set aside.

    Raises:
        StoreError: when the file cannot be made.
        OtherFormat: when it is of another format.
    """

    def __init__(self, path: Path, version: int, tables: Sequence[str], say: Callable[[str], object]) -> None:
        self.path, self._version, self._tables, self._say = path, version, tables, say
        self._file: int | None = None
        self._connection: sqlite3.Connection | None = None
        self._twice(self._opened)

    def rows(self, statement: str, *values: str) -> list[tuple[Any, ...]]:
        """What a statement answers; when the file turns out to be damaged, a fresh one is asked.

        Raises:
            StoreError: when it cannot be read or written.
        """
        return self._twice(lambda: self._opened().execute(statement, values).fetchall())

    def close(self) -> None:
        """Release the file."""
        if self._connection is not None:
            self._connection.close()
            self._connection = None

    def _twice(self, attempt: Callable[[], _T]) -> _T:
        """Try something; when the file turns out to be damaged, once more with a fresh one."""
        try:
            try:
                return attempt()
            except sqlite3.Error as error:
                self._give_up(error)
                return attempt()
        except sqlite3.Error as error:
            raise StoreError(f"cannot use {self.path}: {error}") from None

    def _opened(self) -> sqlite3.Connection:
        if self._connection is None:
            self._connection = self._checked()
        return self._connection

    def _checked(self) -> sqlite3.Connection:
        connection = sqlite3.connect(self.path, isolation_level=None, timeout=_PATIENCE)
        connection.text_factory = lambda text: text.decode(errors="replace")  # damaged text is for the reader to refuse
        try:
            self._file = self._present()
            (found,) = connection.execute("PRAGMA user_version").fetchone()
            if found not in (0, self._version):
                raise OtherFormat(self.path, found, self._version)
            (sound,) = connection.execute("PRAGMA quick_check(1)").fetchone()
            if sound != "ok":
                raise _Damaged("it fails SQLite's own check")
            connection.execute("PRAGMA journal_mode = WAL")
            connection.execute("PRAGMA synchronous = NORMAL")
            for table in self._tables:
                connection.execute(f"CREATE TABLE IF NOT EXISTS {table}")
            made = {text for (text,) in connection.execute("SELECT sql FROM sqlite_master WHERE type = 'table'")}
            if not made >= {f"CREATE TABLE {table}" for table in self._tables}:
                raise _Damaged("its tables are not as they were made")
            connection.execute(f"PRAGMA user_version = {self._version}")
        except BaseException:
            connection.close()
            raise
        return connection

    def _give_up(self, error: sqlite3.Error) -> None:
        """Set the file aside if it is damaged, unless another process has done so; else raise the error again."""
        if getattr(error, "sqlite_errorcode", sqlite3.SQLITE_OK) & 0xFF not in _DAMAGE:
            raise error
        self.close()
        try:
            with FileLock(self.path.with_name(f".{self.path.name}.lock"), timeout=_PATIENCE):
                if self._present() != self._file:
                    return
                place = set_aside(self.path, "damaged", _BESIDE)
        except (OSError, Timeout) as trouble:
            raise StoreError(f"{self.path} is damaged, and cannot be set aside: {trouble}") from None
        self._say(f"{self.path} is damaged ({error}): it is kept as {place.name}, and a new one is begun")

    def _present(self) -> int | None:
        """Which file is there now."""
        return self.path.stat().st_ino if self.path.exists() else None


class _Damaged(sqlite3.DatabaseError):
    """SQLite's own check has failed."""

    sqlite_errorcode = sqlite3.SQLITE_CORRUPT


_DAMAGE = (sqlite3.SQLITE_CORRUPT, sqlite3.SQLITE_NOTADB)  # and not merely closed, busy or without room
