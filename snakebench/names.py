"""Names: what users and plug-ins may call a study, a policy, a fluid, a course."""

from __future__ import annotations

import re
import unicodedata

_NAME = re.compile(r"\w[\w.,@+-]*")
_LONGEST_NAME = 100  # bytes; a file is called by at most two names and an ending, and file systems end at 255


def normal_form(text: str) -> str:
    """The text in Unicode's normal form C: what looks alike is alike."""
    return unicodedata.normalize("NFC", text)


def checked_name(text: str) -> str:
    """A name that may become a part of a file's name, a column or text, in Unicode's normal form C.

    Raises:
        ValueError: when it has other characters than letters, digits and _ . , @ + -, begins with one of the last five,
            or is too long.
    """
    name = normal_form(text)
    if not _NAME.fullmatch(name) or len(name.encode()) > _LONGEST_NAME:
        raise ValueError(
            f"a name of letters, digits and _ . , @ + - that begins with a letter, a digit or _ is needed, of at most"
            f" {_LONGEST_NAME} bytes"
        )
    return name
