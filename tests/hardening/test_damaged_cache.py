"""A damaged evaluation cache costs the evaluations in it, never the study; what is not damaged is not set aside."""

from __future__ import annotations

import random
import shutil
import sqlite3
from contextlib import closing
from pathlib import Path

import pytest
from fuzzing import twisted

from snakebench import store
from snakebench.errors import StoreError
from snakebench.evaluation import Evaluation
from snakebench.store import EvaluationCache

EVALUATION = Evaluation(status="ok", steady=True, speed=0.1, power=1.0).model_dump_json()
FEWEST = 7  # different evaluations that the tiny study makes


def garbage(length: int) -> bytes:
    return random.Random(7).randbytes(length)


def other_keys(count: int, seed: int) -> list[str]:
    rng = random.Random(seed)
    return [f"{rng.getrandbits(256):064x}" for _ in range(count)]


def filled(results: Path, entries: int = 400) -> Path:
    """The file of a cache with so many entries, of 400 bytes each."""
    with EvaluationCache(results) as cache:
        cache.put("key", EVALUATION)
    path = results / ".cache" / "evaluations.sqlite"
    with closing(sqlite3.connect(path)) as open_file, open_file:
        rows = ((key, EVALUATION) for key in other_keys(entries, 0))
        open_file.executemany("INSERT INTO evaluations VALUES (?, ?)", rows)
    return path


def overwritten(path: Path) -> None:
    path.write_bytes(garbage(path.stat().st_size))


def other_file(path: Path) -> None:
    path.write_bytes(b"precious, but no database" * 100)


def truncated(path: Path) -> None:
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])


def cut_in_the_header(path: Path) -> None:
    path.write_bytes(path.read_bytes()[:60])


def page_overwritten(path: Path) -> None:
    middle = path.stat().st_size // 2 // 4096 * 4096
    with path.open("r+b") as file:
        file.seek(middle)
        file.write(garbage(4096))


def root_zeroed(path: Path) -> None:
    with path.open("r+b") as file:
        file.seek(100)
        file.write(bytes(4096 - 100))


def log_overwritten(path: Path) -> None:
    path.with_name(path.name + "-wal").write_bytes(garbage(20_000))


def index_overwritten(path: Path) -> None:
    path.with_name(path.name + "-shm").write_bytes(garbage(32_768))


DAMAGED = (overwritten, other_file, truncated, cut_in_the_header, page_overwritten, root_zeroed)


SOME = (overwritten, page_overwritten, log_overwritten)
OTHERS = (other_file, truncated, cut_in_the_header, root_zeroed, index_overwritten)


@pytest.mark.parametrize("damage", [*SOME, *(pytest.param(one, marks=pytest.mark.slow) for one in OTHERS)])
def test_a_study_ends_with_the_same_bytes_whatever_happened_to_its_cache(tiny, tmp_path, contents, evaluated, damage):
    code, _, _ = tiny()
    found = contents(tmp_path / "results")
    path = filled(tmp_path / "results")
    damage(path)
    damaged = path.read_bytes()
    again, _, err = tiny()
    assert (code, again) == (0, 0) and "Traceback" not in err
    assert contents(tmp_path / "results") == found
    if damage in DAMAGED:
        (told,) = [line for line in err.splitlines() if "is damaged" in line]
        assert told.startswith("tiny: ") and "kept as evaluations.sqlite.damaged" in told
        assert path.with_name("evaluations.sqlite.damaged").read_bytes() == damaged
    assert evaluated(tmp_path) >= FEWEST


@pytest.mark.parametrize("damage", DAMAGED)
def test_damage_that_comes_while_the_cache_is_open_is_survived(tmp_path, damage):
    path, said = filled(tmp_path, 20_000), []
    with EvaluationCache(tmp_path, said.append) as cache:
        damage(path)
        keys = other_keys(2000, 1)
        for key in keys:
            assert cache.get(key) is None
            cache.put(key, EVALUATION)
        assert all(cache.get(key) == EVALUATION for key in keys[-100:])
    EvaluationCache(tmp_path, said.append).close()
    assert len(said) == len(list(path.parent.glob("*.damaged"))) <= 1  # SQLite may have mended it from its memory
    EvaluationCache(tmp_path, lambda text: pytest.fail(f"damage is left: {text}")).close()


def test_damaged_files_are_numbered_and_never_deleted(tmp_path):
    for _ in range(3):
        overwritten(filled(tmp_path, 10))
    EvaluationCache(tmp_path).close()
    names = {path.name for path in (tmp_path / ".cache").glob("*.damaged*")}
    assert names == {f"evaluations.sqlite.damaged{number}" for number in ("", "-2", "-3")}


def test_text_that_is_damaged_counts_as_missing(tmp_path):
    path = filled(tmp_path)
    with closing(sqlite3.connect(path)) as open_file, open_file:
        open_file.execute("UPDATE evaluations SET content = CAST(x'7bfffe7d' AS TEXT)")
    with EvaluationCache(tmp_path) as cache:
        assert cache.get("key") is None
        cache.put("key", EVALUATION)
        assert cache.get("key") == EVALUATION


def refused_and_kept(results: Path, match: str) -> None:
    said: list[str] = []
    with pytest.raises(StoreError, match=match):
        EvaluationCache(results, said.append)
    assert said == [] and not list((results / ".cache").glob("*.damaged*"))


def test_a_locked_cache_is_not_taken_for_a_damaged_one(tmp_path, monkeypatch):
    path = filled(tmp_path)
    monkeypatch.setattr(store, "_PATIENCE", 0.1)
    with closing(sqlite3.connect(path, isolation_level=None)) as other:
        other.execute("BEGIN EXCLUSIVE")
        refused_and_kept(tmp_path, "database is locked")
    with EvaluationCache(tmp_path) as cache:
        assert cache.get("key") == EVALUATION


def test_a_cache_of_another_format_is_not_taken_for_a_damaged_one(tmp_path):
    path = filled(tmp_path)
    with closing(sqlite3.connect(path)) as other:
        other.execute("PRAGMA user_version = 99")
    refused_and_kept(tmp_path, "format 99")


def test_a_cache_that_may_only_be_read_is_not_taken_for_a_damaged_one(without_powers, open_directory):
    path = filled(open_directory)
    path.parent.chmod(0o777)
    path.chmod(0o444)
    script = f"""
from pathlib import Path
from snakebench.errors import StoreError
from snakebench.store import EvaluationCache
try:
    EvaluationCache(Path({str(open_directory)!r}))
except StoreError as error:
    print(error)
"""
    answer = without_powers("-c", script)
    assert "attempt to write a readonly database" in answer.stdout, answer.stderr
    assert not list(path.parent.glob("*.damaged*"))


@pytest.mark.parametrize("count", [40, pytest.param(500, marks=pytest.mark.slow)])
def test_a_cache_damaged_anywhere_remembers_answers_or_begins_anew(tmp_path, count):
    whole, rng, aside = filled(tmp_path / "whole").read_bytes(), random.Random(7), 0
    for k in range(count):
        results = tmp_path / str(k)
        path = results / ".cache" / "evaluations.sqlite"
        path.parent.mkdir(parents=True)
        damaged = twisted(whole, rng)
        path.write_bytes(damaged)
        try:
            with EvaluationCache(results) as cache:
                assert cache.get("key") in (EVALUATION, None)
                cache.put("new", EVALUATION)
                assert cache.get("new") == EVALUATION
        except StoreError:  # of another format, or not to be written: so its header says
            assert len(path.read_bytes()) == len(damaged)
        if (kept := path.with_name("evaluations.sqlite.damaged")).exists():
            aside += 1
            assert kept.read_bytes() == damaged or kept.with_name(kept.name + "-wal").exists()
        shutil.rmtree(results)
    print(f"{aside} of {count} damaged caches set aside")
    assert aside > count / 4
