"""The picture in CONTRIBUTING is the package: its arrows are imports, its modules are all there are."""

from __future__ import annotations

import re
import tomllib
from functools import cache
from itertools import product
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
CONTRIBUTING = (ROOT / "CONTRIBUTING.md").read_text()
SECTION = CONTRIBUTING[CONTRIBUTING.index("## Modules") : CONTRIBUTING.index("## Layers")]
PICTURE = re.search(r"```text\n(.*?)```", SECTION, flags=re.DOTALL)[1]
OPEN = dict(zip("─│┐┘┌└┼┴┬┤├", ("lr", "ud", "ld", "lu", "rd", "ru", "lrud", "lru", "lrd", "lud", "rud"), strict=True))
STEP = {"l": (0, -1), "r": (0, 1), "u": (-1, 0), "d": (1, 0)}
BACK = {"l": "r", "r": "l", "u": "d", "d": "u"}


def arrows() -> set[tuple[str, str]]:
    """Where every line of the picture comes from and goes to: all names at its plain ends, and all at its heads."""
    rows = PICTURE.splitlines()
    names = {(r, c): w for r, row in enumerate(rows) for w in re.finditer(r"[a-z]+", row) for c in range(*w.span())}
    signs = {(r, c): sign for r, row in enumerate(rows) for c, sign in enumerate(row) if sign in OPEN}
    found: set[tuple[str, str]] = set()
    while signs:
        net, sources, targets = [next(iter(signs))], set(), set()
        while net:
            r, c = net.pop()
            for way in OPEN[signs.pop((r, c), " ")] if (r, c) in signs else "":
                there = r + STEP[way][0], c + STEP[way][1]
                if there in signs and there not in net:
                    assert BACK[way] in OPEN[signs[there]], f"the line is broken at row {r}, column {c}"
                    net.append(there)
                elif way == "r" and rows[r][there[1]] == "►":
                    targets.add(names[r, there[1] + 2][0])
                elif way == "l" and (r, c - 2) in names:
                    sources.add(names[r, c - 2][0])
        assert sources and targets, f"a line from {sources} to {targets}"
        found |= set(product(sources, targets))
    return found


@cache
def graph():
    grimp = pytest.importorskip("grimp")
    return grimp.build_graph("snakebench")


def modules() -> set[str]:
    files = (ROOT / "snakebench").iterdir()
    return {path.stem for path in files if path.suffix == ".py" or (path / "__init__.py").is_file()} - {"__init__"}


def layers() -> dict[str, int]:
    contract = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["importlinter"]["contracts"][0]["layers"]
    return {name: -height for height, layer in enumerate(contract) for name in layer.split(" | ")}


def test_the_picture_has_arrows():
    drawn = arrows()
    assert len(drawn) >= 15
    assert {
        ("robot", "physics"),
        ("physics", "engines"),
        ("evaluation", "cache"),
        ("store", "report"),
        ("studies", "comparison"),
        ("site", "cli"),
    } <= drawn


@pytest.mark.parametrize(("below", "above"), sorted(arrows()))
def test_every_arrow_is_an_import_and_goes_up_a_layer(below, above):
    assert layers()[above] > layers()[below]
    assert graph().direct_import_exists(
        importer=f"snakebench.{above}", imported=f"snakebench.{below}", as_packages=True
    )


def test_the_picture_and_the_line_below_it_name_every_module_once():
    drawn = {name for arrow in arrows() for name in arrow}
    beside = re.findall(r"`([a-z]+)`", SECTION)
    assert sorted([*drawn, *beside]) == sorted(modules()) == sorted(layers())
