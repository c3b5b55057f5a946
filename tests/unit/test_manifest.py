"""The manifest of results says what made them, and damage to it is found."""

from __future__ import annotations

import json
import subprocess

import pytest
from writing import write_manifest

from snakebench.errors import StoreError
from snakebench.manifest import Damaged, command_of, commit_of, provenance, read_manifest


def test_the_manifest_says_where_results_come_from(tmp_path):
    write_manifest(tmp_path, {"study": "s"} | provenance())
    manifest = read_manifest(tmp_path)
    assert manifest["study"] == "s"
    assert manifest["versions"]["pybullet"].startswith("3.")


@pytest.mark.parametrize("change", [{"study": "t"}, {"config": {}}, {"files": []}, {"digest": "0"}, {"digest": None}])
def test_a_changed_manifest_is_damaged(change, tmp_path):
    write_manifest(tmp_path, {"study": "s", "config": {"robot": 1}})
    manifest = json.loads((tmp_path / "manifest.json").read_text())
    (tmp_path / "manifest.json").write_text(json.dumps(manifest | change))
    with pytest.raises(Damaged, match="not as it was written"):
        read_manifest(tmp_path)


def test_results_of_another_format_are_refused(tmp_path):
    write_manifest(tmp_path, {"study": "s"})
    manifest = json.loads((tmp_path / "manifest.json").read_text())
    (tmp_path / "manifest.json").write_text(json.dumps(manifest | {"format": 99}))
    with pytest.raises(StoreError, match="format 99"):
        read_manifest(tmp_path)


@pytest.mark.parametrize("content", ["", "[]", "{}", "nonsense"])
def test_a_damaged_manifest_is_refused(content, tmp_path):
    (tmp_path / "manifest.json").write_text(content)
    with pytest.raises(StoreError, match="holds no results"):
        read_manifest(tmp_path)


@pytest.mark.parametrize(
    ("directory", "command"),
    [
        ("pareto", "snakebench run-study pareto"),
        ("pareto-smoke", "snakebench run-study pareto --profile smoke"),
        ("my-students", "snakebench run-study my-students"),
        ("my-students-quick", "snakebench run-study my-students --profile quick"),
        ("bench", "snakebench bench"),
    ],
)
def test_the_name_of_a_directory_tells_the_command_that_makes_it(directory, command):
    assert command_of(directory) == command


@pytest.fixture
def checkout(tmp_path):
    """A checkout of a package, its studies and results, all committed."""
    for name in ("package/manifest.py", "studies/one.toml", "results/one/manifest.json", "examples/one.py"):
        (tmp_path / name).parent.mkdir(parents=True)
        (tmp_path / name).write_text("")
    subprocess.run(["git", "init", "-q"], cwd=tmp_path, check=True)
    subprocess.run(["git", "add", "."], cwd=tmp_path, check=True)
    author = ["-c", "user.name=one", "-c", "user.email=one@example.org"]
    subprocess.run(["git", *author, "commit", "-qm", "all"], cwd=tmp_path, check=True)
    return tmp_path


@pytest.mark.parametrize(
    ("changed", "mark"),
    [
        ("package/manifest.py", "+"),
        ("package/new.py", "+"),
        ("studies/one.toml", "+"),
        ("studies/one.md", ""),
        ("examples/one.py", "+"),
        ("results/one/manifest.json", ""),
        ("README.md", ""),
    ],
)
def test_the_commit_is_marked_when_code_or_studies_have_changed_but_not_for_new_results(checkout, changed, mark):
    file = str(checkout / "package" / "manifest.py")
    clean = commit_of(file)
    assert len(clean) == 12 and not clean.endswith("+")
    (checkout / changed).write_text("another")
    assert commit_of(file) == clean + mark


@pytest.mark.parametrize("number", ["NaN", "Infinity", "1e905"])
def test_a_manifest_with_what_is_no_number_is_damaged(tmp_path, number):
    write_manifest(tmp_path, {"study": "s", "seconds": 12345.5})
    path = tmp_path / "manifest.json"
    path.write_text(path.read_text().replace("12345.5", number))
    with pytest.raises(Damaged, match="is damaged"):
        read_manifest(tmp_path)


def test_outside_a_checkout_there_is_no_commit(tmp_path):
    assert commit_of(str(tmp_path / "manifest.py")) is None
