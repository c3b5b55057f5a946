"""Fronts as studies published them, and the conclusions drawn from them."""

from __future__ import annotations

import re
import shutil
from pathlib import Path

import pandas as pd
import pytest
from writing import write_manifest

from snakebench.errors import StoreError
from snakebench.manifest import manifest_text, read_manifest
from snakebench.studies.indicators import indicators
from snakebench.studies.published import published
from snakebench.studies.published_fronts import powers_compared, single_points, standings

COMMITTED = Path(__file__).parents[2] / "results"


@pytest.fixture
def results(tmp_path):
    """A copy of the fronts of policies, sinusoids and free waveforms."""
    for name in ("learned_front", "pareto", "fourier"):
        shutil.copytree(COMMITTED / name, tmp_path / name)
    return tmp_path


@pytest.mark.parametrize(("setting", "value"), [("reference", [0.0, 20.0]), ("robot", {"diameter": 0.2})])
def test_fronts_beside_are_of_the_same_robot_and_reference(results, setting, value):
    study = published(results / "learned_front")
    assert standings(study)[2] == ["sinusoid", "wider sinusoid", "free waveform"]
    manifest = read_manifest(results / "pareto")
    manifest["config"][setting] = value
    write_manifest(results / "pareto", manifest)
    assert standings(study)[2] == ["free waveform"]


def test_every_front_has_its_points_and_its_indicators(results):
    points, indicators, _ = standings(published(results / "learned_front"))
    front = ["method", "front", "seed", "currency"]
    counted = points.groupby(front).size()
    assert counted.to_dict() == indicators.set_index(front)["points"].to_dict()
    assert set(counted["student"].index.get_level_values("seed")) == {10, 11, 12, 13, 14}


def test_a_policy_stands_beside_the_fronts_over_all_fluids_by_its_means():
    singles = single_points(published(COMMITTED / "pareto"))
    assert set(singles["method"]) == {"sea snake", "symmetric", "teacher", "student"}
    student = singles[(singles["method"] == "student") & (singles["seed"] == 10)].set_index("front")["speed"]
    for front in ("integrated", "simple-sum"):
        assert student[front] == pytest.approx(student[["water", "oil1", "oil2"]].mean())


def test_without_other_studies_there_are_no_single_points(results):
    assert single_points(published(results / "pareto")).empty


def test_no_speed_is_known_beyond_the_fastest_point_whatever_the_version(results):
    _, indicators, _ = standings(published(results / "learned_front"))
    net = indicators["currency"] == "net"
    fastest = indicators["fastest_power"].where(net, indicators["fastest_positive_power"])
    for power in (1, 3, 5, 10, 15, 20, 30):
        assert indicators.loc[fastest < power, f"speed_at_{power}_W"].isna().all()
        assert indicators.loc[fastest >= power, f"speed_at_{power}_W"].notna().all()


def test_powers_are_those_of_the_columns():
    columns = ["speed", "speed_at_0.3_W", "positive_power_at_0.3_W", "speed_at_20_W", "speed_at_20_W_gain"]
    assert powers_compared(pd.DataFrame(columns=columns)) == {0.3: "speed_at_0.3_W", 20.0: "speed_at_20_W"}


@pytest.mark.parametrize("name", ["pareto", "sea_snake_front", "fourier", "learned_front"])
def test_the_conclusions_of_the_committed_results_fill_in(published_reports, name):
    page = (published_reports / f"{name}.html").read_text()
    text = re.search(r'<div class="answer">.*?</div>', page, flags=re.DOTALL)[0]
    assert 3 <= text.count("<li>") <= 7 and "nan" not in text and "–" not in text


def test_indicators_follow_from_the_committed_points():
    committed = published(COMMITTED / "pareto")
    fronts, worth = committed.tables["fronts"], committed.tables["indicators"]
    anew = indicators(fronts, committed.config["reference"], list(powers_compared(worth)))
    place = ["space", "front", "currency"]
    told = worth.set_index(place).loc[anew.set_index(place).index].reset_index()
    assert len(anew) == 32
    pd.testing.assert_frame_equal(anew[list(told)], told, rtol=1e-9)


def test_results_of_version_1_are_refused_in_a_line(results):
    path = results / "pareto" / "manifest.json"
    older = {name: part for name, part in read_manifest(path.parent).items() if name != "fluids"}
    path.write_text(manifest_text(older))
    with pytest.raises(StoreError, match=r"pareto are of a version before 2\.0: run its study again"):
        published(path.parent)
