"""Which code made a number: a digest of modules, comments and docstrings apart, and the versions of packages."""

from __future__ import annotations

import ast
import hashlib
import inspect
import sys
from contextlib import suppress
from functools import cache
from importlib import metadata
from pathlib import Path
from typing import Any

from snakebench.errors import InvalidValue

_PACKAGE = Path(__file__).parent
_AS_BEFORE: dict[str, Any] = {"show_empty": True} if sys.version_info >= (3, 13) else {}  # as Python 3.11 dumps
_ALSO_AS = {"pybullet": "pybullet-arm64"}  # the distribution that has wheels for Python 3.12 and later


def code_digest(*modules: str) -> str:
    """The first 16 digits of the SHA-256 of what modules of this package do, such as "engines/bullet.py".

    Part of every evaluation's key and of the keys of compiled code, so that neither outlives a change of the code.
    """
    return _digest([(_PACKAGE / module).read_text(encoding="utf-8") for module in modules])


def package_version(name: str) -> str | None:
    """The version of an installed package, whichever distribution it comes in; None where there is none."""
    for distribution in filter(None, (name, _ALSO_AS.get(name))):
        with suppress(metadata.PackageNotFoundError):
            return metadata.version(distribution)
    return None


@cache
def plugin_digest(thing: object) -> str | None:
    """The same of the module in which a class or function outside this package is defined; None for one inside.

    Raises:
        InvalidValue: when it is in no file, as what is typed at a prompt.
    """
    module = inspect.getmodule(thing)
    if module is not None and module.__name__.partition(".")[0] == __name__.partition(".")[0]:
        return None
    try:
        return _digest([Path(inspect.getfile(thing)).read_text(encoding="utf-8")])  # type: ignore[arg-type]
    except (OSError, TypeError):
        raise InvalidValue(f"the code of {thing!r} is in no file, so that results cannot be told apart") from None


def _digest(texts: list[str]) -> str:
    code = hashlib.sha256()
    for text in texts:
        tree = ast.parse(text)
        for node in ast.walk(tree):
            if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef) and ast.get_docstring(node) is not None:
                node.body.pop(0)
        code.update(ast.dump(tree, **_AS_BEFORE).replace(", type_params=[]", "").encode())
    return code.hexdigest()[:16]
