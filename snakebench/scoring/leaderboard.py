"""The leaderboard: a folder for each entry, with its card, its file and its score."""

import json
import os
import tomllib
from collections.abc import Iterable
from itertools import combinations
from pathlib import Path
from typing import Annotated, Any, NamedTuple

from pydantic import Field

from snakebench.errors import InvalidValue, StoreError
from snakebench.files import inside, readable_file, writable_directory, write_file
from snakebench.scoring.result import Information, Score, read_score
from snakebench.value import NonNegative, Value

CARD, SCORE = "card.toml", "score.json"
TOTAL = "total"
_MODEL = "policy.onnx"  # file of an entry that is written here
_LONGEST = 80  # characters of a name


class Card(Value):
    """What is known of an entry."""

    name: str = Field(pattern=r"\S", max_length=_LONGEST)
    authors: tuple[str, ...] = Field(min_length=1)
    information: Information = Field(description="that it uses")
    file: str = Field(description="path from the entry's folder")
    link: Annotated[str, Field(pattern=r"^https?://\S+$|^$")] = Field("", description="to a paper or to code")
    training_steps: Annotated[int, Field(ge=0, le=10**15)] = Field(0, description="of control, in all trainings, or 0")
    hours: NonNegative = Field(0.0, description="wall time of search or training [h]")
    made_by: str = Field("", description="Python script and its arguments that make it again, such as examples/rma.py")


class Listed(NamedTuple):
    """An entry of the leaderboard."""

    folder: Path
    card: Card
    score: Score

    @property
    def ranked(self) -> bool:
        """Whether it has a place: privileged entries and those that cannot swim all tasks have none."""
        return self.score.total is not None and self.score.information != "privileged"


def read_leaderboard(directory: Path, scored: bool = False) -> list[Listed]:
    """All entries, or those that have a score, if there are any; the best first, and those without a total last.

    Raises:
        StoreError: when there is no such directory, a card or a score is missing or damaged, or two have the same name.
    """
    if scored and not directory.exists():
        return []
    folders = [folder for folder in entries_in(directory) if not scored or (folder / SCORE).exists()]
    entries = [Listed(folder, read_card(folder), read_score(folder / SCORE)) for folder in folders]
    for one, other in combinations(entries, 2):
        if one.card.name == other.card.name:
            raise StoreError(f"{one.folder} and {other.folder} have the same name, {one.card.name}: give one another")
    return sorted(entries, key=lambda one: (one.score.total is None, -(one.score.total or 0.0)))


def entries_in(directory: Path) -> list[Path]:
    """The folders of the entries, in the order of their names; StoreError when there is no such directory."""
    if not directory.is_dir():
        raise StoreError(f"{directory} is no leaderboard: a directory with a folder for each entry is needed")
    return sorted(path for path in directory.iterdir() if path.is_dir() and not path.name.startswith("."))


def entry_file(folder: Path, card: Card) -> Path:
    """The file of an entry, in the directory that has the leaderboard; StoreError where its card leads out of it."""
    folder = folder.resolve()
    root = folder.parent.parent
    return inside(root, os.path.normpath(folder.relative_to(root) / card.file))


def place(score: Score, task: str, entries: Iterable[Listed]) -> int | None:
    """The place of a score among others in a task or in total; None where it has none."""
    own = value_in(score, task)
    if own is None or score.total is None or score.information == "privileged":
        return None
    others = [value_in(one.score, task) or 0.0 for one in entries if one.ranked and one.score.entry != score.entry]
    return 1 + sum(other > own for other in others)


def value_in(score: Score, task: str) -> float | None:
    """The score in a task or in total."""
    return score.total if task == TOTAL else score.scores[task].score if task in score.scores else None


def write_entry(folder: Path | str, content: bytes | None, file: str = _MODEL, **about: Any) -> Path:
    """Write a new entry, an ONNX model or another file and its card, into a folder; returns the file's path.

    Args:
        folder: is made if it is not there.
        content: of its file; None if it is there already.
        file: its path from the folder.
        **about: further fields of the card.

    Raises:
        InvalidValue: when a field of the card is wrong.
        StoreError: when they cannot be written.
    """
    given = Card(file=file, **about).model_dump(mode="json", exclude_defaults=True)
    path = writable_directory(Path(folder)) / file
    if content is not None:
        write_file(path, content)
    lines = (
        f"{name} = {json.dumps(value, ensure_ascii=False)}\n" for name, value in given.items()
    )  # as in TOML: no tables are among them
    write_file(Path(folder) / CARD, "".join(lines))
    return path


def read_card(folder: Path) -> Card:
    """The card in the folder of an entry."""
    path = folder / CARD
    try:
        return Card(**tomllib.loads(readable_file(path).read_text(encoding="utf-8")))
    except OSError as error:
        raise StoreError(f"{folder} has no card: {CARD}: {error.strerror}") from None
    except InvalidValue as error:
        raise StoreError(f"{path}: {error}") from None
    except (ValueError, RecursionError) as error:
        raise StoreError(f"{path} is no card: {error}") from None
