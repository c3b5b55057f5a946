"""Which code made a number: a digest of what modules compute, prose apart, and the versions of packages."""

import ast
import hashlib
import inspect
import sys
from collections.abc import Iterable, Iterator
from contextlib import suppress
from functools import cache
from importlib import metadata
from pathlib import Path
from typing import Any

from snakebench.errors import InvalidValue

_PACKAGE = Path(__file__).parent
_PHYSICS = f"{_PACKAGE.name}.physics"
_AS_BEFORE: dict[str, Any] = {"show_empty": True} if sys.version_info >= (3, 13) else {}  # as Python 3.11 dumps
_ALSO_AS = {"pybullet": "pybullet-arm64"}  # the distribution that has wheels for Python 3.12 and later


@cache
def code_digest(*modules: str) -> str:
    """The first 16 digits of the SHA-256 of what modules of this package compute, such as "engines.bullet".

    With them goes the physics that they import, directly or by each other. It is part of the keys of evaluations and of
    compiled code. Comments, docstrings, annotations, descriptions of fields and messages of errors do not count.
    """
    trees, todo = dict[str, ast.Module](), list(modules)
    while todo:
        if (name := todo.pop()) not in trees:
            path = _PACKAGE.joinpath(*name.split(".")).with_suffix(".py")
            trees[name] = ast.parse(path.read_text(encoding="utf-8"))
            todo += _physics_of(trees[name])
    return _digest(trees[name] for name in sorted(trees))


def package_version(name: str) -> str | None:
    """The version of an installed package, whichever distribution it comes in; None where there is none."""
    for distribution in filter(None, (name, _ALSO_AS.get(name))):
        with suppress(metadata.PackageNotFoundError):
            return metadata.version(distribution)
    return None


@cache
def plugin_digest(thing: object) -> str | None:
    """The same of the module in which something outside this package is defined; None for what is inside."""
    module = inspect.getmodule(thing)
    if module is not None and module.__name__.partition(".")[0] == __name__.partition(".")[0]:
        return None
    try:
        return _digest([ast.parse(Path(inspect.getfile(thing)).read_text(encoding="utf-8"))])  # type: ignore[arg-type]
    except (OSError, TypeError):
        raise InvalidValue(f"the code of {thing!r} is in no file, so that results cannot be told apart") from None


def _physics_of(tree: ast.Module) -> Iterator[str]:
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and node.module == _PHYSICS:
            yield from (f"physics.{alias.name}" for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module and node.module.startswith(f"{_PHYSICS}."):
            yield node.module.partition(".")[2]


class _Meaning(ast.NodeTransformer):
    """Takes from a syntax tree what changes no number."""

    def visit(self, node: ast.AST) -> Any:
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef) and ast.get_docstring(node) is not None:
            node.body.pop(0)
        if isinstance(node, ast.FunctionDef):
            node.returns = None
        return super().visit(node)

    def visit_arg(self, node: ast.arg) -> ast.AST:
        return ast.arg(node.arg)

    def visit_Raise(self, _: ast.Raise) -> ast.AST:
        return ast.Raise()

    def visit_keyword(self, node: ast.keyword) -> ast.AST | None:
        return None if node.arg == "description" else self.generic_visit(node)


def _digest(trees: Iterable[ast.Module]) -> str:
    code = hashlib.sha256()
    for tree in trees:
        text = ast.dump(_Meaning().visit(tree), **_AS_BEFORE)
        code.update(text.replace(", type_params=[]", "").encode())
    return code.hexdigest()[:16]
