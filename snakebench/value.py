"""Values: immutable descriptions of robots, fluids, gaits and scenarios, checked once when made."""

import hashlib
import inspect
import json
import re
import textwrap
import unicodedata
from typing import Annotated, Any, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import AfterValidator, BaseModel, ConfigDict, Field, ValidationError
from pydantic_core import PydanticUndefined

from snakebench.errors import InvalidValue, UnknownName

FloatArray = NDArray[np.float64]
FIELDS = "Fields:"  # heads those in a docstring
_SHORT = 100  # default that is written out [characters]
_LARGEST = 1e12  # beyond any unit of this field; keeps arithmetic on values finite
_NAME = re.compile(r"\w[\w.,@+-]*")
_LONGEST_NAME = 100  # bytes; a file is called by at most two names and an ending, and file systems end at 255


def normal_form(text: str) -> str:
    """The text in Unicode's normal form C: what looks alike is alike."""
    return unicodedata.normalize("NFC", text)


def checked_name(text: str) -> str:
    """A name that may become a part of a file's name, a column or text, in Unicode's normal form C."""
    name = normal_form(text)
    if not _NAME.fullmatch(name) or len(name.encode()) > _LONGEST_NAME:
        raise ValueError(
            f"a name of letters, digits and _ . , @ + - that begins with a letter, a digit or _ is needed, of at most"
            f" {_LONGEST_NAME} bytes"
        )
    return name


Real = Annotated[float, Field(strict=True, ge=-_LARGEST, le=_LARGEST)]
Positive = Annotated[float, Field(strict=True, gt=0, le=_LARGEST)]
NonNegative = Annotated[float, Field(strict=True, ge=0, le=_LARGEST)]
Count = Annotated[int, Field(strict=True, gt=0)]
Name = Annotated[str, AfterValidator(checked_name)]


def within(least: float, most: float) -> Any:
    """A mark for the type of a field whose numbers are bounded, by both bounds."""

    def check(number: float) -> float:
        if not least <= number <= most:
            raise ValueError(f"allowed are {least:g} to {most:g}")
        return number

    return AfterValidator(check)


class Value(BaseModel):
    """A frozen, keyword-only value without unknown fields, NaN or infinity.

    Raises:
        InvalidValue: when a field is wrong, naming the field, what was given and what is allowed.
    """

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    def __init__(self, /, **fields: Any) -> None:
        try:
            super().__init__(**fields)
        except ValidationError as error:
            raise InvalidValue(one_line(type(self), error)) from None

    @classmethod
    def __pydantic_init_subclass__(cls, **_: Any) -> None:
        """What `help` shows of a value: its docstring, with a line for each field."""
        if cls.__doc__ and FIELDS not in cls.__doc__:
            lines = []
            for name, field in cls.model_fields.items():
                default = "" if field.default in (PydanticUndefined, None) else f"by default {field.default!r}"
                about = filter(None, [field.description, default if len(default) <= _SHORT else ""])
                lines.append(f"    {name}: {'; '.join(about)}")
            cls.__doc__ = "\n".join([inspect.cleandoc(cls.__doc__), "", FIELDS, *lines])

    def __eq__(self, other: object) -> bool:
        """By the fields only: what a value derives from them and keeps may not even be comparable."""
        return type(self) is type(other) and all(
            getattr(self, name) == getattr(other, name) for name in type(self).model_fields
        )

    def __hash__(self) -> int:
        return hash((type(self), *(getattr(self, name) for name in type(self).model_fields)))

    def but(self, **changes: Any) -> Self:
        """A copy with some fields changed, checked like a new value; what was left to its default stays so."""
        return type(self)(**{name: getattr(self, name) for name in self.model_fields_set} | changes)

    def digest(self) -> str:
        """SHA-256 of the canonical JSON of this value: equal values have equal digests."""
        return digest(self.model_dump(mode="json"))


def digest(content: Any) -> str:
    """SHA-256, in hex, of `content` written as canonical JSON (sorted keys, no spaces)."""
    text = json.dumps(content, sort_keys=True, separators=(",", ":"), allow_nan=False)
    return hashlib.sha256(text.encode()).hexdigest()


def one_line(owner: type[BaseModel], error: ValidationError) -> str:
    """A complaint of a pydantic error as `Owner: field = given: what is allowed`: of an unknown field, or the first."""
    errors = error.errors(include_url=False)
    first = next((one for one in errors if one["type"] == "extra_forbidden"), errors[0])
    field = ".".join(str(part) for part in first["loc"])
    message, name = first["msg"].removeprefix("Value error, "), owner.__name__
    if isinstance(first.get("ctx", {}).get("error"), InvalidValue):
        return message
    if first["type"] == "missing":
        return f"{name}: {field} is missing"
    if first["type"] == "extra_forbidden":
        return f"{name}: {UnknownName.among('field', field, owner.model_fields)}"
    if first["type"] == "model_type" and (what := owner.model_fields[str(first["loc"][0])].description):
        field, message = str(first["loc"][0]), f"{what} is needed"
    if first["type"] == "tuple_type":
        message = "a list is needed"
    given = textwrap.shorten(repr(first["input"]), 60, placeholder=" …")
    return f"{name}: {field} = {given}: {message}" if field else f"{name}: {message}"
