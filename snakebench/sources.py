"""Which code made a number: a digest of modules, comments and docstrings apart."""

from __future__ import annotations

import ast
import hashlib
from pathlib import Path

_PACKAGE = Path(__file__).parent


def code_digest(*modules: str) -> str:
    """The first 16 digits of the SHA-256 of what modules of this package do, such as "engines/bullet.py".

    Part of every evaluation's key and of the keys of compiled code, so that neither outlives a change of the code.
    """
    code = hashlib.sha256()
    for module in modules:
        tree = ast.parse((_PACKAGE / module).read_text(encoding="utf-8"))
        for node in ast.walk(tree):
            if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef) and ast.get_docstring(node) is not None:
                node.body.pop(0)
        code.update(ast.dump(tree).encode())
    return code.hexdigest()[:16]
