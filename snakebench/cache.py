"""The evaluation cache: the only state of a study; everything else can be made again from it."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Self

from pydantic import ValidationError

from snakebench.database import Database
from snakebench.errors import SnakebenchError
from snakebench.evaluation import Evaluation
from snakebench.files import writable_directory
from snakebench.store import FORMAT
from snakebench.value import digest

_TABLES = (
    "evaluations (key TEXT PRIMARY KEY, content TEXT NOT NULL)",
    "physics (engine TEXT, fingerprint TEXT PRIMARY KEY)",
)


class EvaluationCache:
    """Every evaluation ever made under one results directory, by key: one SQLite file; a context manager.

    Studies side by side may share it: each evaluation is written at once. A damaged file is set aside.

    Args:
        results: the directory.
        say: told of damage.

    Raises:
        StoreError: when the file cannot be made or is of another format.
    """

    def __init__(self, results: Path, say: Callable[[str], object] = lambda _: None) -> None:
        self.results, self.directory, self._say = results, writable_directory(results / ".cache"), say
        self._database = Database(self.directory / "evaluations.sqlite", FORMAT, _TABLES, say)

    def get(self, key: str) -> Evaluation | None:
        """The evaluation stored under `key`; None when there is none, or it is not as it was stored.

        Raises:
            StoreError: when the file cannot be read.
        """
        content = self.text(key)
        try:
            return None if content is None else Evaluation.model_validate_json(content)
        except (ValidationError, SnakebenchError):
            self._say_damaged()
            return None

    def put(self, key: str, evaluation: Evaluation) -> None:
        """Store an evaluation under `key`, at once.

        Raises:
            StoreError: when it cannot be written.
        """
        self.put_text(key, evaluation.model_dump_json())

    def text(self, key: str) -> str | None:
        """What `put_text` stored under `key`; None when there is nothing, or it is not as it was stored.

        Raises:
            StoreError: when the file cannot be read.
        """
        row = next(iter(self._database.rows("SELECT content FROM evaluations WHERE key = ?", key)), None)
        if row is None:
            return None
        seal, _, content = str(row[0]).partition(" ")
        if seal == digest([key, content]):
            return content
        self._say_damaged()
        return None

    def put_text(self, key: str, content: str) -> None:
        """Store a text under `key`, at once, such as what else was measured of a swim.

        Raises:
            StoreError: when it cannot be written.
        """
        row = f"{digest([key, content])} {content}"
        self._database.rows("INSERT OR REPLACE INTO evaluations VALUES (?, ?)", key, row)

    def _say_damaged(self) -> None:
        self._say(f"{self._database.path}: an evaluation is damaged; it is made again")

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
