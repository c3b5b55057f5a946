"""The cache, tables and files keep what they are given, or say in one line why not."""

from __future__ import annotations

import os
import sqlite3
from contextlib import closing
from pathlib import Path

import pandas as pd
import pytest
from writing import write_table

from snakebench.errors import StoreError
from snakebench.evaluation import Evaluation
from snakebench.files import write_file
from snakebench.store import EvaluationCache
from snakebench.tables import read_table

EVALUATION = Evaluation(status="ok", steady=True, speed=0.1 + 0.2, power=1e-17, episode_return=-0.0).model_dump_json()


def test_the_cache_remembers_exactly_what_it_was_given(tmp_path):
    cache = EvaluationCache(tmp_path)
    cache.put("key", EVALUATION)
    cache.close()
    again = EvaluationCache(tmp_path)
    assert again.get("key") == EVALUATION
    assert again.get("other") is None


def test_the_cache_says_once_that_the_physics_of_an_engine_changed(tmp_path):
    with EvaluationCache(tmp_path) as cache:
        assert cache.recognises("pybullet", "a") and cache.recognises("planar", "b")
    with EvaluationCache(tmp_path) as cache:
        assert cache.recognises("pybullet", "a")
        assert not cache.recognises("pybullet", "changed")
        assert cache.recognises("pybullet", "changed") and cache.recognises("planar", "b")


def test_a_table_keeps_every_digit(tmp_path):
    table = pd.DataFrame({"x": [0.1 + 0.2, 1e-300, float("nan")], "name": ["a", "b,c", "d"]})
    write_table(tmp_path / "t.csv", table)
    pd.testing.assert_frame_equal(read_table(tmp_path / "t.csv"), table, check_exact=True)


def test_names_that_look_like_nothing_or_like_numbers_are_kept(tmp_path):
    names = ["NA", "null", "None", "nan", "5e-4"]
    write_table(tmp_path / "t.csv", pd.DataFrame({"name": names, "x": [1.0, None, 2.0, 3.0, 4.0]}))
    table = read_table(tmp_path / "t.csv", {"name": str, "x": float | None})
    assert list(table["name"]) == names and table["x"].isna().sum() == 1


def test_a_link_is_followed_and_its_target_replaced(tmp_path):
    (tmp_path / "real.html").write_text("old")
    (tmp_path / "link.html").symlink_to(tmp_path / "real.html")
    write_file(tmp_path / "link.html", "new")
    assert (tmp_path / "link.html").is_symlink() and (tmp_path / "real.html").read_text() == "new"


def test_what_is_no_file_is_not_replaced(tmp_path):
    os.mkfifo(tmp_path / "pipe")
    for path in (tmp_path / "pipe", tmp_path, Path()):
        with pytest.raises(StoreError, match="not a regular file"):
            write_file(path, "new")
    assert (tmp_path / "pipe").is_fifo()


def test_a_failed_write_leaves_the_old_file(tmp_path, monkeypatch):
    write_file(tmp_path / "page.html", "old")
    monkeypatch.setattr(
        "pathlib.Path.replace", lambda *_: (_ for _ in ()).throw(OSError(28, "No space left on device"))
    )
    with pytest.raises(StoreError, match="No space left"):
        write_file(tmp_path / "page.html", "new")
    assert [path.name for path in tmp_path.iterdir()] == ["page.html"]
    assert (tmp_path / "page.html").read_text() == "old"


@pytest.mark.parametrize(
    "damage",
    [
        "substr(content, 1, 20)",
        "substr(content, 66)",
        "replace(content, '1e-17', '1e-16')",
        "replace(content, 'ok', 'x')",
    ],
)
def test_a_damaged_entry_of_the_cache_is_said_and_counts_as_missing(tmp_path, damage):
    said = []
    cache = EvaluationCache(tmp_path, said.append)
    cache.put("key", EVALUATION)
    with closing(sqlite3.connect(tmp_path / ".cache" / "evaluations.sqlite", isolation_level=None)) as database:
        database.execute(f"UPDATE evaluations SET content = {damage}")
    assert cache.get("key") is None
    assert len(said) == 1 and "damaged" in said[0]
    cache.put("key", EVALUATION)
    assert cache.get("key") == EVALUATION
    cache.close()


def test_two_that_find_one_cache_damaged_share_the_new_one(tmp_path):
    first, second = EvaluationCache(tmp_path), EvaluationCache(tmp_path)
    for cache in (first, second):
        cache._set_aside(sqlite3.DatabaseError("damaged"))
        cache.put(str(id(cache)), EVALUATION)
    assert first.get(str(id(second))) == second.get(str(id(first))) == EVALUATION
    assert len(list((tmp_path / ".cache").glob("*.damaged*"))) <= 3  # the one file, and what SQLite keeps beside it
    first.close()
    second.close()


def test_an_entry_of_the_cache_under_another_key_counts_as_missing(tmp_path):
    cache = EvaluationCache(tmp_path)
    cache.put("key", EVALUATION)
    with closing(sqlite3.connect(tmp_path / ".cache" / "evaluations.sqlite", isolation_level=None)) as database:
        database.execute("UPDATE evaluations SET key = 'kex'")
    assert cache.get("kex") is None
    cache.close()


def test_a_missing_table_is_refused(tmp_path):
    with pytest.raises(StoreError, match="cannot read the table"):
        read_table(tmp_path / "none.csv")
