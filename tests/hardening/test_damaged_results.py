"""A report of damaged results says what is missing, shows the rest, and leaves the results as they are."""

from __future__ import annotations

import json
import random
import shutil
from pathlib import Path

import pytest
from fuzzing import changed, twisted

from snakebench.comparison.page import index_sections
from snakebench.publication import snapshot

PUBLISHED = Path(__file__).parents[2] / "results"


def damage(path: Path, rng: random.Random) -> None:
    """Do something to a file of results."""
    kind = rng.random()
    if kind < 0.15:
        path.unlink()
        if kind < 0.05:
            path.mkdir()
    elif kind < 0.6 or path.suffix != ".json":
        path.write_bytes(twisted(path.read_bytes(), rng))
    else:
        path.write_text(json.dumps(changed(json.loads(path.read_text()), rng)))


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("count", [3, pytest.param(100, marks=pytest.mark.slow)])
def test_a_report_of_damaged_results_shows_what_it_can(tiny, snakebench_command, tmp_path, contents, count):
    assert tiny()[0] == 0
    whole, results, rng = tmp_path / "whole", tmp_path / "results", random.Random(count)
    shutil.copytree(results / "tiny", whole / "sea_snake", ignore=shutil.ignore_patterns(".*"))
    shutil.copytree(PUBLISHED / "bench", whole / "bench")
    left_out = 0
    for _ in range(count):
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
    print(f"{left_out} of {count} damaged results were left out, the others shown")
    assert left_out > count / 10


@pytest.mark.parametrize("count", [5, pytest.param(100, marks=pytest.mark.slow)])
def test_the_page_of_play_has_what_is_not_damaged(snakebench_command, write_contenders, tmp_path, contents, count):
    whole, results, rng = tmp_path / "whole", tmp_path / "results", random.Random(count)
    write_contenders(whole, "pareto", "teacher_student")
    left_out = 0
    for _ in range(count):
        shutil.copytree(whole, results)
        path = rng.choice([path for path in results.rglob("*.*") if path.is_file()])
        damage(path, rng)
        before = contents(results)
        code, out, err = snakebench_command("play", "--no-open", "--out", "play.html")
        assert (code, err, contents(results)) == (0, "", before)
        *problems, last = out.splitlines()
        page, study = (tmp_path / "play.html").read_text(encoding="utf-8"), path.relative_to(results).parts[0]
        shown = {"pareto": '<option value="sinusoid"' in page, "teacher_student": '<option value="student"' in page}
        assert last == "page: play.html" and shown.pop("teacher_student" if study == "pareto" else "pareto")
        if problems:
            (line,) = problems
            assert line.startswith("left out: ") and f"results/{study}" in line and not shown[study]
        left_out += len(problems)
        shutil.rmtree(results)
    assert left_out > count / 2


def test_play_is_refused_where_all_is_damaged(snakebench_command, write_contenders, tmp_path):
    results = write_contenders(tmp_path / "results", "pareto", "teacher_student")
    (results / "pareto" / "fronts.csv").unlink()
    (results / "teacher_student" / "manifest.json").write_text("{")
    code, out, err = snakebench_command("play", "--no-open", "--out", "play.html")
    assert code == 2 and [line.partition("results/")[0] for line in out.splitlines()] == ["left out: "] * 2
    assert err.startswith("snakebench: results holds no gaits and no policies") and err.count("\n") == 1
    assert not (tmp_path / "play.html").exists()


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")
def test_an_index_of_damaged_results_names_what_is_missing(tmp_path):
    """All published results, several of their files damaged."""
    rng, missing = random.Random(1), set()
    for _ in range(12):
        results = tmp_path / "results"
        shutil.copytree(PUBLISHED, results, ignore=shutil.ignore_patterns(".cache"))
        files = [path for path in results.rglob("*.*") if path.suffix in {".csv", ".json"}]
        chosen = rng.sample(files, 8)
        whole = {path: path.read_bytes() for path in chosen if path.suffix == ".csv"}
        for path in chosen:
            damage(path, rng)
        damaged = {path for path, content in whole.items() if not path.is_file() or path.read_bytes() != content}
        with snapshot(results) as taken:
            assert {path.parent.name for path in damaged} <= set(taken.problems)
            missing |= set(map(str, index_sections(taken.copy, taken.problems)["missing"]))
        shutil.rmtree(results)
    print("\n".join(sorted(missing)))
    assert len(missing) > 3
