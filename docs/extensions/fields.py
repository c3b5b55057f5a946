"""The fields of values and study settings, from their pydantic descriptions, below the docstring of their class.

They take the place of the plain list that the docstring ends with.
"""

import re
from types import UnionType
from typing import Annotated, Any, Literal, Union, get_args, get_origin

from pydantic import BaseModel
from pydantic.fields import FieldInfo
from sphinx.application import Sphinx

from snakebench.value import FIELDS, Value

_WORDS = {float: "number", int: "whole number", str: "text", bool: "true or false", type(None): "none", Any: "any"}
_BOUNDS = {"gt": ">", "ge": "≥", "lt": "<", "le": "≤"}
_UNBOUNDED = 1e9  # bounds beyond only keep arithmetic finite
_LONGEST = 70  # default that is written out [characters]


def kind(annotation: Any, metadata: tuple[Any, ...] = ()) -> str:
    """What values a setting takes, in words."""
    inner, origin = get_args(annotation), get_origin(annotation)
    if origin is Annotated:
        return kind(inner[0], (*inner[1:], *metadata))
    if origin in (Union, UnionType):
        return " or ".join(dict.fromkeys(map(kind, inner)))
    if origin is Literal:
        return " or ".join(f"“{one}”" for one in inner)
    if origin is tuple:
        return f"list of {kind(inner[0])}" if inner[-1] is ... else f"[{', '.join(map(kind, inner))}]"
    if origin in (dict, list):
        return f"table of {kind(inner[1])}, by {kind(inner[0])}" if origin is dict else f"list of {kind(inner[0])}"
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return annotation.__name__
    return _WORDS.get(annotation, str(annotation)) + "".join(_bounds(metadata))


def _bounds(metadata: tuple[Any, ...]) -> list[str]:
    constraints = [one for part in metadata for one in (part.metadata if isinstance(part, FieldInfo) else [part])]
    found = [(sign, getattr(one, name, None)) for one in constraints for name, sign in _BOUNDS.items()]
    return [f" {sign} {value:g}" for sign, value in found if value is not None and abs(value) < _UNBOUNDED]


def _default(field: FieldInfo) -> str:
    if field.is_required():
        return ", required"
    if field.default_factory_takes_validated_data:
        return ", by default as the others suggest"
    value = field.get_default(call_default_factory=True)
    shown = repr(value) if len(repr(value)) <= _LONGEST else f"{type(value).__name__}(…)"
    return "" if value is None else f", default ``{shown}``"


def describe(_app: Sphinx, what: str, _name: str, documented: object, _options: object, lines: list[str]) -> None:
    """Put the fields of a value's class below its docstring; fields of named tuples have no docstring of their own."""
    if lines and lines[0].startswith("Alias for field number"):
        lines.clear()
    if what != "class" or not isinstance(documented, type) or not issubclass(documented, Value):
        return
    if FIELDS in lines:
        del lines[lines.index(FIELDS) :]
    own = {name: field for name, field in documented.model_fields.items() if name in documented.__annotations__}
    lines += ["", ".. rubric:: Fields", ""] if own else []
    for name, field in own.items():
        about = f"{field.description}; " if field.description else ""
        lines += [f"``{name}``", f"    {about}*{kind(field.annotation, tuple(field.metadata))}*{_default(field)}", ""]
    base = documented.__base__
    if base is not None and getattr(base, "model_fields", {}):
        lines += [f"Also the fields of :class:`~{base.__module__}.{base.__qualname__}`.", ""]


def plain(annotations: str | None) -> str | None:
    """Annotations as one reads them: of each Annotated[…] only the type, and arrays by their names."""
    if annotations is None:
        return None
    annotations = re.sub(r"~[\w.]*\.Annotated\[", "Annotated[", annotations)
    while (start := annotations.find("Annotated[")) >= 0:
        first, depth, parts = start + len("Annotated["), 0, []
        for place in range(first, len(annotations)):
            depth += (annotations[place] in "[(") - (annotations[place] in "])")
            if depth < 0 or (depth == 0 and annotations[place] == ","):
                parts.append(place)
            if depth < 0:
                break
        annotations = annotations[:start] + annotations[first : parts[0]] + annotations[parts[-1] + 1 :]
    return re.sub(r"ndarray\[.*?dtype\[([~\w.]+)\]\]", r"ndarray[\1]", annotations)


def signature(
    _app: Sphinx, what: str, _name: str, documented: object, _options: object, arguments: str, returned: str | None
) -> tuple[str | None, str | None]:
    """A readable signature; values have none: they take their fields by keyword, and the list of fields says it."""
    is_value = what == "class" and isinstance(documented, type) and issubclass(documented, Value)
    return ("", None) if is_value else (plain(arguments), plain(returned))


def setup(app: Sphinx) -> dict[str, bool]:
    """Listen to autodoc, after napoleon."""
    app.connect("autodoc-process-docstring", describe, priority=900)
    app.connect("autodoc-process-signature", signature)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
