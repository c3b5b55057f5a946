"""Results are exchanged in one switch; what is not theirs stays; readers see one run or none."""

from __future__ import annotations

import gzip
import multiprocessing
from contextlib import suppress
from itertools import count, product, takewhile
from multiprocessing.synchronize import Event
from pathlib import Path

import pandas as pd
import pytest
from writing import write_manifest

from snakebench.errors import StoreError
from snakebench.manifest import Damaged, read_manifest
from snakebench.policy import Policy
from snakebench.publication import check_results, locked, publish, snapshot
from snakebench.tables import read_table, table_text

TABLE = pd.DataFrame({"x": [1, 2]})
FIRST = {"one": TABLE, "two": TABLE}
SECOND = {"two": TABLE * 2, "three": TABLE * 2}


def files_in(directory: Path) -> dict[str, bytes]:
    return {str(path.relative_to(directory)): path.read_bytes() for path in directory.rglob("*") if path.is_file()}


def numbers(directory: Path) -> dict[str, list[int]]:
    return {path.stem: read_table(path)["x"].tolist() for path in directory.glob("*.csv")}


def test_results_are_written_by_one_process_at_a_time(tmp_path):
    with locked(tmp_path / "study"):
        with pytest.raises(StoreError, match="being written by another snakebench"), locked(tmp_path / "study"):
            pytest.fail("both write")
        with locked(tmp_path / "another study"):
            pass
    with locked(tmp_path / "study"):
        pass


def test_published_results_replace_the_old_ones_and_nothing_else(tmp_path):
    publish(tmp_path, FIRST, {}, {"study": "first"})
    mine = ["notes.txt", "more.csv", "policies/own.safetensors", "trajectories/own.npz", "policies/deep/own.csv"]
    for name in mine:
        (tmp_path / name).parent.mkdir(exist_ok=True, parents=True)
        (tmp_path / name).write_text("mine")
    publish(tmp_path, SECOND, {}, {"study": "second"})
    assert files_in(tmp_path).keys() == {"two.csv", "three.csv", "manifest.json", *mine}
    assert all((tmp_path / name).read_text() == "mine" for name in mine)
    assert read_table(tmp_path / "two.csv")["x"].tolist() == [2, 4]
    assert read_manifest(tmp_path)["study"] == "second"


def test_results_behind_a_link_are_exchanged_and_files_beside_them_stay(tmp_path):
    (tmp_path / "real").mkdir()
    (tmp_path / "link").symlink_to(tmp_path / "real")
    publish(tmp_path / "link", FIRST, {}, {"study": "first"})
    (tmp_path / "real" / "more.csv").write_text("mine")
    publish(tmp_path / "link", SECOND, {}, {"study": "second"})
    assert files_in(tmp_path / "real").keys() == {"two.csv", "three.csv", "more.csv", "manifest.json"}


@pytest.mark.parametrize("tables", [FIRST, SECOND])
def test_a_file_that_is_not_of_earlier_results_is_kept(tables, tmp_path):
    publish(tmp_path, FIRST, {}, {"study": "first"})
    (tmp_path / "two.csv").write_text("edited")
    (tmp_path / "one.csv").write_text("edited")
    said = []
    publish(tmp_path, tables, {}, {"study": "second"}, say=said.append)
    kept = {name for name, content in files_in(tmp_path).items() if content == b"edited"}
    assert kept == ({"one.csv.replaced", "two.csv.replaced"} if tables is FIRST else {"one.csv", "two.csv.replaced"})
    assert len(said) == sum(name.endswith(".replaced") for name in kept) and "kept as two.csv.replaced" in said[-1]


@pytest.mark.parametrize("name", ["notes.csv", "manifest.json", "policies/x"])
def test_a_directory_of_somebody_else_is_refused(name, tmp_path):
    (tmp_path / name).parent.mkdir(exist_ok=True)
    (tmp_path / name).write_text('{"name": "an application"}')
    with pytest.raises(StoreError, match=r"another results directory|another program"):
        publish(check_results(tmp_path), FIRST, {}, {"study": "first"})
    assert files_in(tmp_path) == {name: b'{"name": "an application"}'}


def test_hidden_files_are_no_reason_to_refuse_a_directory(tmp_path):
    (tmp_path / ".gitkeep").touch()
    publish(check_results(tmp_path), FIRST, {}, {"study": "first"})
    assert files_in(tmp_path).keys() == {".gitkeep", "manifest.json", "one.csv", "two.csv"}


def test_a_directory_that_cannot_be_written_is_refused(tmp_path):
    (tmp_path / "file").write_text("in the way")
    with pytest.raises(StoreError, match="cannot write to the directory"):
        check_results(tmp_path / "file" / "results")


def test_a_large_table_is_compressed_and_reads_equal(tmp_path):
    table = pd.DataFrame({"x": range(60_000), "y": 0.1, "name": "öl"})
    publish(tmp_path, {"large": table, "small": table[:10]}, {}, {"study": "first"})
    first = files_in(tmp_path)
    assert first.keys() == {"large.csv.gz", "small.csv", "manifest.json"}
    assert gzip.decompress(first["large.csv.gz"]) == table_text(table).encode()
    pd.testing.assert_frame_equal(read_table(tmp_path / "large.csv"), table, check_exact=True)
    publish(tmp_path, {"large": table, "small": table[:10]}, {}, {"study": "first"})
    assert files_in(tmp_path) == first
    publish(tmp_path, {"large": table[:10]}, {}, {"study": "second"})
    assert files_in(tmp_path).keys() == {"large.csv", "manifest.json"}


@pytest.mark.parametrize("damage", [lambda content: content[:-20], lambda content: b"x" + content, lambda _: b""])
def test_a_compressed_table_that_is_damaged_is_refused(tmp_path, damage):
    content = gzip.compress(b"x,y\n" + b"1,2\n" * 1000, mtime=0)
    (tmp_path / "one.csv.gz").write_bytes(damage(content))
    with pytest.raises(StoreError, match="cannot read the table"):
        read_table(tmp_path / "one.csv")


@pytest.fixture
def learned(tmp_path):
    """Results with two policies, one of them left out of the repository."""
    published = Path(__file__).parents[2] / "results" / "teacher_student" / "policies"
    policies = {name: Policy.load(published / "student-10.safetensors") for name in ("student-0", "teacher-0")}
    publish(check_results(tmp_path / "study"), FIRST, {}, {"study": "first"}, policies, left_out=["teacher-0"])
    return tmp_path / "study"


def test_what_is_left_out_may_be_missing_or_old(learned):
    manifest, file = read_manifest(learned), learned / "policies" / "teacher-0.safetensors"
    assert manifest["left_out"]["command"] == "snakebench run-study study"
    assert [*manifest["left_out"]["files"]] == ["policies/teacher-0.safetensors"]
    assert "policies/student-0.safetensors" in manifest["files"]
    for change, copied in ((lambda: None, True), (lambda: file.write_bytes(b"old"), False), (file.unlink, False)):
        change()
        with snapshot(learned.parent) as taken:
            assert not taken.problems
            assert (taken.copy / "study" / "policies" / "teacher-0.safetensors").exists() == copied


def test_what_is_left_out_is_removed_with_the_results_that_it_is_of(learned):
    publish(learned, FIRST, {}, {"study": "second"})
    assert files_in(learned).keys() == {"one.csv", "two.csv", "manifest.json"}


@pytest.mark.parametrize("left_out", [1, [], {"files": [1]}, {"files": {"x": 1}}])
def test_a_manifest_that_leaves_out_what_is_no_file_is_damaged(left_out, tmp_path):
    write_manifest(tmp_path, {"study": "first", "left_out": left_out})
    with pytest.raises(Damaged, match="not as it was written"):
        read_manifest(tmp_path)


@pytest.mark.parametrize("name", ["../out", "/out", "a/../../out", "link/out"])
def test_no_name_leads_out_of_the_directory(name, tmp_path):
    directory = tmp_path / "results"
    directory.mkdir()
    (tmp_path / "elsewhere").mkdir()
    (directory / "link").symlink_to(tmp_path / "elsewhere")
    with pytest.raises(StoreError, match="no file inside"):
        publish(directory, {name: TABLE}, {}, {"study": "first"})
    assert files_in(tmp_path) == {}


def test_a_manifest_that_lists_files_elsewhere_removes_none(tmp_path):
    (tmp_path / "mine.csv").write_text("x\n1\n2\n")
    directory = tmp_path / "results"
    publish(check_results(directory), {"one": TABLE}, {}, {"study": "first"})
    manifest = read_manifest(directory)
    digest = manifest["files"]["one.csv"]
    write_manifest(directory, manifest | {"files": {"../mine.csv": digest}})
    with pytest.raises(StoreError, match="no file inside"):
        publish(directory, {"one": TABLE}, {}, {"study": "second"})
    assert (tmp_path / "mine.csv").exists()


def test_a_full_disk_leaves_the_old_results(tmp_path, monkeypatch):
    publish(tmp_path, FIRST, {}, {"study": "first"})
    before, opened = files_in(tmp_path), Path.open

    def full_disk(path, *arguments, **named):
        if path.name == "three.csv":
            raise OSError(28, "No space left on device")
        return opened(path, *arguments, **named)

    monkeypatch.setattr("pathlib.Path.open", full_disk)
    with pytest.raises(StoreError, match="No space left"):
        publish(tmp_path, SECOND, {}, {"study": "second"})
    assert files_in(tmp_path) == before


@pytest.mark.parametrize("moments", [*((k,) for k in range(12)), *product(range(5, 12), (0, 1, 2, 6))])
@pytest.mark.parametrize("before", [{}, FIRST])
def test_an_exchange_that_is_killed_at_any_moment_is_ended_by_the_next(moments, before, tmp_path, monkeypatch):
    """Or killed in it again."""
    directory = tmp_path / "study"
    if before:
        publish(check_results(directory), before, {}, {"study": "first"})

    class Killed(BaseException):
        pass

    def then_killed(call, calls, moment):
        def counted(path, *arguments, **named):
            if path.is_relative_to(directory) and next(calls) >= moment:
                raise Killed
            return call(path, *arguments, **named)

        return counted

    for moment in moments:
        calls = iter(range(100))
        with monkeypatch.context() as patch:
            for name in ("replace", "unlink", "rmdir", "open"):
                patch.setattr(f"pathlib.Path.{name}", then_killed(getattr(Path, name), calls, moment))
            with suppress(Killed):  # or it ends before that moment
                publish(check_results(directory), SECOND, {}, {"study": "second"})
    monkeypatch.setattr("snakebench.publication._PATIENCE", 0.05)  # nobody is about to end the exchange
    with snapshot(tmp_path) as taken:
        assert numbers(taken.copy / "study") in (
            {},
            {name: [1, 2] for name in before},
            {"two": [2, 4], "three": [2, 4]},
        )
    publish(check_results(directory), SECOND, {}, {"study": "second"})
    assert files_in(directory).keys() == {"two.csv", "three.csv", "manifest.json"}
    assert numbers(directory) == {"two": [2, 4], "three": [2, 4]}


@pytest.mark.parametrize("content", [b"", b"[]", b"{}", b"nonsense", b"\xff", b'{"study": "s", "digest": "0"}'])
def test_a_damaged_manifest_is_kept_and_made_again(content, tmp_path):
    publish(tmp_path, FIRST, {}, {"study": "first"})
    (tmp_path / "manifest.json").write_bytes(content)
    said = []
    publish(check_results(tmp_path), FIRST, {}, {"study": "first"}, say=said.append)
    assert files_in(tmp_path).keys() == {"manifest.json", "manifest.json.damaged", "one.csv", "two.csv"}
    assert len(said) == 1 and "kept as manifest.json.damaged" in said[0]
    assert (tmp_path / "manifest.json.damaged").read_bytes() == content
    assert read_manifest(tmp_path)["study"] == "first"


@pytest.mark.parametrize(
    "damage",
    [
        lambda path: path.write_bytes(path.read_bytes()[:-1]),
        lambda path: path.write_bytes(path.read_bytes() * 2),
        lambda path: path.write_bytes(path.read_bytes().replace(b"3", b"4")),
        lambda path: path.unlink(),
        lambda path: path.rename(path.with_name("one.csv")),
    ],
    ids=["cut", "doubled", "edited", "missing", "mixed up"],
)
def test_a_damaged_table_is_named_and_its_study_not_read(damage, tmp_path):
    for name in ("good", "bad"):
        (tmp_path / name).mkdir()
        publish(tmp_path / name, FIRST | {"two": TABLE * 3}, {}, {"study": name})
    damage(tmp_path / "bad" / "two.csv")
    with snapshot(tmp_path) as taken:
        assert [path.name for path in taken.copy.iterdir()] == ["good"]
        assert list(taken.problems) == ["bad"]
        assert any(f"{tmp_path / 'bad'}/{name}.csv" in taken.problems["bad"] for name in ("one", "two"))


def _exchange(directory: Path, run: int = 0) -> None:
    publish(directory, {f"table{i}": TABLE * run for i in range(20)}, {}, {"study": "s", "run": run})


def _exchange_until(enough: Event, directory: Path) -> None:
    for run in takewhile(lambda _: not enough.is_set(), count()):
        _exchange(directory, run)


def test_readers_see_one_run_while_results_are_exchanged(tmp_path):
    directory = tmp_path / "study"
    directory.mkdir()
    _exchange(directory)
    context = multiprocessing.get_context("spawn")
    enough, seen = context.Event(), set()
    writer = context.Process(target=_exchange_until, args=(enough, directory))
    writer.start()
    try:
        while len(seen) < 5 and writer.is_alive():
            with snapshot(tmp_path) as taken:
                assert not taken.problems
                run = read_manifest(taken.copy / "study")["run"]
                assert numbers(taken.copy / "study") == {f"table{i}": [run, 2 * run] for i in range(20)}
                seen.add(run)
    finally:
        enough.set()
        writer.join()
    assert writer.exitcode == 0
