"""The exceptions that reach a user, each in one line, and text as a terminal or a page may show it."""

import difflib
import unicodedata
from collections.abc import Iterable
from pathlib import Path
from typing import Self

_MOST = 2000  # characters of a message
_CUT = " … "  # stands for what is left out


def printable(text: object, most: int = _MOST) -> str:
    r"""Text in one line of at most `most` characters for a terminal; the middle of a longer one is left out.

    Whatever cannot be seen is written as an escape, such as \x1b.
    """
    content = str(text)
    if len(content) > 2 * most:  # of a megabyte only the ends are looked at
        content = content[:most] + content[-most:]
    line = visible(" ".join(filter(None, map(str.strip, content.splitlines()))))
    if len(line) <= most:
        return line
    end = (most - len(_CUT)) // 2
    return line[: most - len(_CUT) - end] + _CUT + line[-end:]


def visible(text: str) -> str:
    """Text with an escape for whatever in its lines cannot be seen, such as a mark that turns the way of writing."""
    seen = {letter for letter in set(text) if letter.isprintable() or unicodedata.category(letter) == "Zs"}
    return text.translate({ord(c): c.encode("unicode_escape").decode() for c in set(text) - seen - {"\n"}})


class SnakebenchError(Exception):
    """Anything snakebench refuses, with a one-line message meant for the user; see `printable`."""

    exit_code = 2

    def __init__(self, message: object = "") -> None:
        super().__init__(printable(message))


class InvalidValue(SnakebenchError, ValueError):
    """A value outside what is allowed; the message names field, value and allowed range."""


def missing(what: str, package: str | None, extra: str) -> InvalidValue:
    """The error for a missing package. It names the command that installs it in a clone."""
    return InvalidValue(f'{what} needs {package}: in the clone, pip install -c constraints.txt ".[{extra}]"')


class UnknownName(InvalidValue):
    """A name that is not registered; the message offers the nearest valid names."""

    @classmethod
    def among(cls, what: str, name: str, allowed: Iterable[str]) -> Self:
        """The error for a name that is not one of those `allowed`."""
        names = list(allowed)
        near = difflib.get_close_matches(name, names, n=3, cutoff=0.5)
        hint = f"did you mean {' or '.join(near)}? " if near else ""
        return cls(f"unknown {what} {name!r}: {hint}allowed are {', '.join(names)}")


class UnstableRate(InvalidValue):
    """A physics rate below the stability limit of an engine; the message gives the rate needed."""


class NoOptimum(SnakebenchError):
    """An optimisation without an optimum; the message gives its status and the best that it found."""

    exit_code = 3


class StoreError(SnakebenchError):
    """A file or directory that cannot be read or written."""


class OtherFormat(StoreError):
    """A file or directory of another version; the message says what to do."""

    def __init__(self, path: Path, found: object, needed: int) -> None:
        super().__init__(
            f"{path} was written in format {found}, this version of snakebench needs {needed}:"
            " give another results directory, or remove it and run the study again"
        )


class WorkersLost(SnakebenchError):
    """Workers that can evaluate no more; the message adds that nothing evaluated is lost."""

    def __init__(self, reason: str) -> None:
        super().__init__(f"{reason}; what was evaluated is kept, the same command continues")
