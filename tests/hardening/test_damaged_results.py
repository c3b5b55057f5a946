"""A report of damaged results says what is missing, shows the rest, and leaves the results as they are."""

from __future__ import annotations

import json
import random
import shutil
from pathlib import Path

import pytest

from snakebench.comparison.page import index_page

PUBLISHED = Path(__file__).parents[2] / "results"
CELLS = ("", "nan", "inf", "-1", "1e400", "x", "water", "9" * 400, "☃", '"', "true", "0")


def damaged_table(text: str, rng: random.Random) -> str:
    """A table with cells, columns or rows changed or lost."""
    rows = [line.split(",") for line in text.splitlines()]
    for _ in range(rng.choice((1, 1, 3, 10))):
        row, column = rng.randrange(len(rows)), rng.randrange(len(rows[0]))
        kind = rng.randrange(6)
        if kind == 0 and len(rows[row]) > column:
            rows[row][column] = rng.choice(CELLS)
        elif kind == 1:
            rows[0][column] = rng.choice(("", "x", rows[0][0]))
        elif kind == 2:
            rows = [[*one[:column], *one[column + 1 :]] for one in rows]
        elif kind == 3:
            rows[row].insert(column, rng.choice(CELLS))
        elif kind == 4:
            rows = [rows[0], *([one[:column], rng.choice(CELLS), *one[column + 1 :]] for one in rows[1:])]
            rows = [[str(cell) for cell in one] for one in rows]
        else:
            rows = rows[: max(row, 1)]
        if not rows[0]:
            return ""
    return "\n".join(",".join(row) for row in rows) + "\n"


def damaged_manifest(text: str, rng: random.Random) -> str:
    """A manifest with a value changed or lost, at any depth."""
    content = json.loads(text)
    for _ in range(rng.choice((1, 1, 4))):
        owner = content
        while True:
            keys = list(owner) if isinstance(owner, dict) else list(range(len(owner)))
            if not keys:
                break
            key = rng.choice(keys)
            if isinstance(owner[key], dict | list) and owner[key] and rng.random() < 0.6:
                owner = owner[key]
                continue
            if rng.random() < 0.3:
                del owner[key]
            else:
                owner[key] = rng.choice((None, "x", "../../x", -1, 1e308, [], {}, [None], "\ud800", True, {"a": 1}))
            break
    return json.dumps(content)


def damage(path: Path, rng: random.Random) -> None:
    """Do something to a file of results."""
    kind = rng.random()
    if kind < 0.1:
        path.unlink()
    elif kind < 0.15:
        path.unlink()
        path.mkdir()
    elif kind < 0.35 or path.suffix not in {".csv", ".json"}:
        content = bytearray(path.read_bytes())
        for _ in range(rng.choice((1, 20))):
            content[rng.randrange(len(content))] = rng.randrange(256)
        path.write_bytes(content[: rng.randrange(len(content))] if rng.random() < 0.3 else content)
    elif path.suffix == ".csv":
        path.write_text(damaged_table(path.read_text(), rng))
    else:
        path.write_text(damaged_manifest(path.read_text(), rng))


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("count", [3, pytest.param(100, marks=pytest.mark.slow)])
def test_a_report_of_damaged_results_shows_what_it_can(tiny, snakebench_command, tmp_path, contents, as_often, count):
    assert tiny()[0] == 0
    whole, results, rng = tmp_path / "whole", tmp_path / "results", random.Random(count)
    shutil.copytree(results / "tiny", whole / "sea_snake", ignore=shutil.ignore_patterns(".*"))
    shutil.copytree(PUBLISHED / "bench", whole / "bench")
    left_out = 0
    for _ in range(as_often(count)):
        shutil.rmtree(results)
        shutil.rmtree(tmp_path / "reports")
        shutil.copytree(whole, results)
        damage(rng.choice([path for path in results.rglob("*.*") if path.is_file()]), rng)
        before = contents(results)
        code, out, err = snakebench_command("report")
        assert code == 0 and "Traceback" not in err
        assert contents(results) == before
        left_out += "left out: " in out
        shown = {path.name for path in (tmp_path / "reports").iterdir()}
        assert "index.html" in shown and all(name.endswith((".html", ".md", ".svg")) for name in shown)
        assert len([name for name in shown if name.endswith(".html")]) >= 2
        assert {path.name for path in tmp_path.iterdir()} == {"whole", "results", "reports", "tiny.toml"}
    print(f"{left_out} of {as_often(count)} damaged results were left out, the others shown")
    assert left_out > count / 10


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")
def test_an_index_of_damaged_results_names_what_is_missing(tmp_path, as_often):
    """All published results, several of their files damaged."""
    rng, missing = random.Random(1), 0
    for _ in range(min(as_often(12), 12)):
        results = tmp_path / "results"
        shutil.copytree(PUBLISHED, results, ignore=shutil.ignore_patterns(".cache"))
        files = [path for path in results.rglob("*.*") if path.suffix in {".csv", ".json"}]
        for path in rng.sample(files, 8):
            damage(path, rng)
        missing += len(index_page(results, {})["missing"])
        shutil.rmtree(results)
    print(f"{missing} things said to be missing")
    assert missing > 0
