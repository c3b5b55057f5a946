"""The report is a function of the results: it says what is missing, and its numbers can be made again from scratch."""

from __future__ import annotations

import json
import multiprocessing
import re
import shutil
from itertools import count, takewhile
from multiprocessing.synchronize import Event
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from writing import list_files

import snakebench as sb
from snakebench.names import STUDIES
from snakebench.publication import publish
from snakebench.scoring.leaderboard import read_leaderboard
from snakebench.scoring.page import leaderboard_page
from snakebench.site import write_report, write_reports
from snakebench.studies.published import published

ROOT = Path(__file__).parents[2]
RESULTS = ROOT / "results"


@pytest.fixture(scope="module")
def content(published_index):
    return published_index


@pytest.fixture(scope="module")
def numbers(content):
    return content["findings"]["numbers"].set_index("number")


def first_seed(row: pd.Series) -> float:
    return float(row["seeds"].split()[0])


def test_nothing_is_missing_from_the_committed_results(content):
    assert content["missing"] == []
    sections = ("claims", "fronts", "gains", "cross", "changing", "race_lanes", "assumptions")
    assert all(content[section] for section in sections)


def test_every_number_of_the_index_names_a_table_that_is_there_and_its_command(numbers):
    assert len(numbers) > 100
    for row in numbers.to_dict("records"):
        for table in row["table"].split(" and "):
            assert (RESULTS / table).is_file(), table
        assert row["command"].startswith("snakebench run-study ")


def test_the_students_speed_made_again_from_its_file(numbers):
    row = numbers.loc[["student/water/speed"]].iloc[0]
    policy = sb.Policy.load(RESULTS / "teacher_student" / "policies" / "student-10.safetensors")
    again = sb.evaluate(policy, fluid="water", physics_rate=960)
    assert first_seed(row) == pytest.approx(again.speed, rel=1e-5)


def test_the_sinusoids_front_in_the_ledger_made_again_from_the_gaits_around_it(numbers):
    row = numbers.loc[["ledger/equal/oil1/sinusoid"]].iloc[0]
    assert row["table"] == "pareto/fronts.csv.gz"
    choice = "space = paper, front = oil1, currency = net"
    assert row["rows"] == f"{choice}: speed at 10.0 W, or of the fastest point if it needs less"
    fronts = pd.read_csv(RESULTS / row["table"])
    front = fronts.query("space == 'paper' and front == 'oil1' and currency == 'net'")
    neighbours = [
        front[front["power"] <= 10].nlargest(1, "power").iloc[0],
        front[front["power"] > 10].nsmallest(1, "power").iloc[0],
    ]
    below, above = (
        sb.evaluate(sb.SinusoidalTorque(**gait[["amplitude", "frequency", "phase"]]), fluid="oil1", physics_rate=960)
        for gait in neighbours
    )
    between = below.speed + (above.speed - below.speed) * (10 - below.power) / (above.power - below.power)
    assert row["mean"] == pytest.approx(between, rel=1e-5)


def test_the_tail_amplitude_of_the_papers_fixed_sinusoid_made_again(numbers):
    gait = sb.SinusoidalTorque(amplitude=3.5, frequency=0.70, phase=0.84)
    again = sb.evaluate(gait, fluid="oil2", physics_rate=960)
    row = numbers.loc[["fixed sinusoid/oil2/tip_half at 0.1 m"]].iloc[0]
    assert row["mean"] == pytest.approx(again.tail_amplitude, rel=1e-5)


def test_no_claim_rests_on_one_seed_of_a_policy(numbers):
    policies = numbers[numbers.index.str.contains("^(?:student|teacher|symmetric)/")]
    assert (policies["n"] >= 2).all()
    assert policies["low"].notna().all()


def committed_and_made(made: Path, expression: str) -> list[list[str]]:
    """What is found in a committed page and in the same one made again."""
    return [re.findall(expression, page.read_text(), re.DOTALL) for page in (ROOT / "reports" / made.name, made)]


@pytest.mark.parametrize("study", sorted({"bench", *STUDIES}))
def test_answer_and_tables_of_a_committed_page_are_those_of_the_committed_results(published_reports, study):
    committed, made = committed_and_made(
        published_reports / f"{study}.html", '<div class="answer">.*?</div>|<table.*?</table>'
    )
    answered = (ROOT / "studies" / f"{study}.md").exists()
    assert len(made) > answered and made[0].startswith("<div") == answered and committed == made


def test_the_committed_claims_are_those_of_the_committed_results(published_reports):
    committed, made = committed_and_made(published_reports / "claims.md", ".+")
    assert committed == made


def test_the_committed_page_of_the_leaderboard_is_that_of_its_entries(tmp_path):
    (tmp_path / "leaderboard.html").write_text(leaderboard_page(read_leaderboard(ROOT / "leaderboard")))
    committed, made = committed_and_made(tmp_path / "leaderboard.html", "<table.*?</table>|<p[ >].*?</p>")
    assert len(made) > 2 and committed == made


def test_an_empty_directory_gives_a_report_that_says_what_to_run(tmp_path):
    (tmp_path / "results").mkdir()
    index = write_reports(tmp_path / "results", tmp_path / "reports", say=lambda _: None)
    for study in STUDIES:
        assert f"snakebench run-study {study}" in index.read_text()


def test_files_of_others_in_the_directory_of_pages_stay(tmp_path):
    for name in ("fronts.svg", "sea_snake.html"):
        (tmp_path / name).write_text("mine")
    (tmp_path / "results").mkdir()
    write_reports(tmp_path / "results", tmp_path)
    assert {(tmp_path / name).read_text() for name in ("fronts.svg", "sea_snake.html")} == {"mine"}


def test_half_a_directory_is_reported_as_far_as_it_goes(tmp_path):
    results, reports = tmp_path / "results", tmp_path / "reports"
    for study in ("sensitivity", "teacher_student", "validation"):
        shutil.copytree(RESULTS / study, results / study)
    (results / "teacher_student" / "range.csv").unlink()
    lines: list[str] = []
    text = write_reports(results, reports, say=lines.append).read_text()
    assert "snakebench run-study learned_front" in text
    assert (reports / "sensitivity.html").exists()
    assert [line for line in lines if line.startswith("left out: ") and "range.csv" in line] != []
    assert "There is nothing to show" in (reports / "teacher_student.html").read_text()


def test_a_table_without_a_column_leaves_its_page_out_in_one_line_that_names_it(tmp_path):
    results = tmp_path / "results"
    directory = shutil.copytree(RESULTS / "validation", results / "validation")
    pd.read_csv(directory / "order.csv").drop(columns="error").to_csv(directory / "order.csv", index=False)
    list_files(directory)
    lines: list[str] = []
    write_reports(results, tmp_path / "reports", say=lines.append)
    (line,) = [line for line in lines if line.startswith("left out: ")]
    assert "order.csv" in line and "error" in line


def test_a_bug_in_a_page_is_raised_and_not_taken_for_damaged_results(tmp_path, monkeypatch):
    monkeypatch.setattr("snakebench.studies.validation.page.observed_orders", lambda order: order.mispelt)
    with pytest.raises(AttributeError, match="mispelt"):
        write_report(RESULTS / "validation", tmp_path)


def test_elsewhere_the_index_lists_only_the_users_own_studies(tmp_path):
    directory = shutil.copytree(RESULTS / "sensitivity", tmp_path / "results" / "my_robots")
    assert directory.is_dir()
    text = write_reports(tmp_path / "results", tmp_path / "reports", say=lambda _: None).read_text()
    assert 'href="my_robots.html"' in text
    others = [study for study in STUDIES if study != "sensitivity"]  # whose command made these results
    assert not any(f"snakebench run-study {study}" in text for study in others)


def test_results_of_another_version_are_left_out_and_their_old_page_replaced(tmp_path):
    results, reports = tmp_path / "results", tmp_path / "reports"
    shutil.copytree(RESULTS / "sensitivity", results / "sensitivity")
    write_reports(results, reports, say=lambda _: None)
    assert "There is nothing to show" not in (reports / "sensitivity.html").read_text()
    manifest = json.loads((results / "sensitivity" / "manifest.json").read_text())
    (results / "sensitivity" / "manifest.json").write_text(json.dumps(manifest | {"format": 99}))
    index = write_reports(results, reports, say=lambda _: None)
    assert "format 99" in index.read_text()
    assert "There is nothing to show" in (reports / "sensitivity.html").read_text()


def test_a_page_whose_results_are_gone_is_not_left_as_if_new(tmp_path):
    results, reports = tmp_path / "results", tmp_path / "reports"
    shutil.copytree(RESULTS / "sensitivity", results / "sensitivity")
    write_reports(results, reports, say=lambda _: None)
    shutil.rmtree(results / "sensitivity")
    write_reports(results, reports, say=lambda _: None)
    assert "There is nothing to show" in (reports / "sensitivity.html").read_text()


def _publish_again_and_again(enough: Event, directory: Path) -> None:
    """The results of a study with another question each time."""
    study = published(RESULTS / "validation")
    for run in takewhile(lambda _: not enough.is_set(), count(1)):
        manifest = study.manifest | {"config": study.config | {"question": f"Is this run {run}?"}}
        publish(directory, study.tables, {}, manifest)


@pytest.mark.slow
def test_pages_are_of_one_run_while_results_are_exchanged(tmp_path):
    results, reports, seen = tmp_path / "results", tmp_path / "reports", set()
    directory = shutil.copytree(RESULTS / "validation", results / "validation")
    context = multiprocessing.get_context("spawn")
    enough = context.Event()
    writer = context.Process(target=_publish_again_and_again, args=(enough, directory))
    writer.start()
    try:
        while len(seen) < 3 and writer.is_alive():
            lines: list[str] = []
            write_reports(results, reports, say=lines.append)
            page = (reports / "validation.html").read_text()
            assert not [line for line in lines if line.startswith("left out: ")]
            assert page.rstrip().endswith("</html>") and "There is nothing to show" not in page
            runs = set(re.findall(r"Is this run (\d+)\?", page))
            assert len(runs) <= 1
            seen |= runs
    finally:
        enough.set()
        writer.join()
    assert writer.exitcode == 0


def test_the_committed_index_is_small():
    assert (ROOT / "reports" / "index.html").stat().st_size < 3e6


def test_the_readme_shows_the_claims_as_they_came_out():
    readme, claims = (ROOT / "README.md").read_text(), (ROOT / "reports" / "claims.md").read_text()
    assert claims in readme
    for picture in ("fronts.svg", "ledger.svg"):
        assert f"(reports/{picture})" in readme


@pytest.mark.parametrize("name", ["fronts.svg", "ledger.svg"])
def test_the_pictures_of_the_readme_are_those_of_the_committed_results(published_reports, name):
    lines = committed_and_made(published_reports / name, r' d="(.*?)"')
    committed, made = ([float(number) for number in re.findall(r"-?\d+\.?\d*", " ".join(one))] for one in lines)
    np.testing.assert_allclose(committed, made, atol=0.1)  # points of the picture


def test_the_committed_index_is_that_of_the_committed_results(published_reports):
    committed, made = committed_and_made(published_reports / "index.html", "<table.*?</table>|<p[ >].*?</p>")
    assert len(made) > 10 and committed == made
