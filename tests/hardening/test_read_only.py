"""Results that may only be read are enough for a report."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

PUBLISHED = Path(__file__).parents[2] / "results"


@pytest.mark.parametrize(
    "studies", [("bench",), pytest.param(("validation", "cross", "fourier"), marks=pytest.mark.slow)]
)
def test_a_report_of_read_only_results_is_written_elsewhere(without_powers, open_directory, contents, studies):
    results = open_directory / "results"
    for study in studies:
        shutil.copytree(PUBLISHED / study, results / study)
    for path in (results, *results.rglob("*")):
        path.chmod(0o555 if path.is_dir() else 0o444)
    before = contents(open_directory)
    (open_directory / "home" / "reports").mkdir(mode=0o777)
    (open_directory / "home" / "reports").chmod(0o777)
    answer = without_powers("-m", "snakebench.cli", "report", "--results", str(results), "--out", "reports/new")
    assert answer.returncode == 0, answer.stderr
    pages = {path.name for path in (open_directory / "home" / "reports" / "new").iterdir()}
    assert {"index.html", *(f"{study}.html" for study in studies)} <= pages
    assert {name: content for name, content in contents(open_directory).items() if name in before} == before
    assert contents(results) == {name.removeprefix("results/"): content for name, content in before.items()}


REFUSED = {  # commands that may not write
    "report": "--results {closed} --out {closed}",
    "play": "--results {published} --out {closed}/play.html --no-open",
    "score": "{published}/teacher_student/policies/student-10.safetensors --out {closed}",
    "leaderboard": "--leaderboard {published}/../leaderboard --reports {closed}",
}


@pytest.mark.parametrize("name", REFUSED)
def test_what_may_not_be_written_is_refused_in_a_line(without_powers, open_directory, name):
    closed = open_directory / "closed"
    closed.mkdir(mode=0o555)
    words = REFUSED[name].format(closed=closed, published=PUBLISHED).split()
    answer = without_powers("-m", "snakebench.cli", name, *words)
    assert (answer.returncode, answer.stdout) == (2, "")
    lines = [line for line in answer.stderr.splitlines() if "font cache" not in line]  # which matplotlib builds once
    assert lines == [f"snakebench: cannot write to the directory {closed}: Permission denied"]
    assert not list(closed.iterdir())
