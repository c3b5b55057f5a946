"""What is released is called the same everywhere, and is quick to import."""

from __future__ import annotations

import ast
import io
import re
import subprocess
import sys
import tokenize
from pathlib import Path

import yaml

from snakebench.version import __version__

ROOT = Path(__file__).parents[2]


def test_one_version_stands_in_the_package_the_citation_and_the_changelog(snakebench_command):
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text())
    changed = re.search(r"^## (\S+) – (\S+)$", (ROOT / "CHANGELOG.md").read_text(), re.M)
    assert changed is not None
    assert snakebench_command("--version") == (0, f"{__version__}\n", "")
    assert changed[1] == citation["version"] == __version__
    assert changed[2] == str(citation["date-released"])


def test_importing_the_package_loads_no_library():
    script = "import sys; before = set(sys.modules); import snakebench; print(*sorted(set(sys.modules) - before))"
    loaded = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True).stdout.split()
    others = {name.partition(".")[0] for name in loaded} - set(sys.stdlib_module_names) - {"snakebench"}
    assert not others


def test_the_package_stays_small():
    lines = sum(lines_of_code(path.read_text(encoding="utf-8")) for path in (ROOT / "snakebench").rglob("*.py"))
    assert 10_000 < lines <= 18_000


def lines_of_code(source):
    """How many lines a module has without blank lines, comments and docstrings."""
    blank = {tokenize.COMMENT, tokenize.NL, tokenize.NEWLINE, tokenize.INDENT, tokenize.DEDENT, tokenize.ENDMARKER}
    tokens = [token for token in tokenize.generate_tokens(io.StringIO(source).readline) if token.type not in blank]
    lines = {line for token in tokens for line in range(token.start[0], token.end[0] + 1)}
    for node in ast.walk(ast.parse(source)):
        documented = isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef)
        if documented and ast.get_docstring(node, clean=False) is not None:
            lines -= set(range(node.body[0].lineno, node.body[0].end_lineno + 1))
    return len(lines)
