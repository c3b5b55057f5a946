"""The learned-front study and its page, end to end on a small budget."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from pages import cells

import snakebench as sb
from snakebench.errors import InvalidValue
from snakebench.studies.config import study_path, study_settings
from snakebench.studies.fronts import front
from snakebench.studies.learned_front.page import page
from snakebench.studies.published import published
from snakebench.studies.running import run_study, study_config
from snakebench.tables import read_table

PUBLISHED = Path(__file__).parents[2] / "results"
POSITIONS = [0.01, 0.03**0.5, 3.0]


def settings(profile: str = "smoke", **changes):
    return study_settings(study_path("learned_front"), profile) | changes


@pytest.fixture(scope="module")
def results(tmp_path_factory):
    return run_study(study_config(settings()), tmp_path_factory.mktemp("study") / "results", workers=1)


@pytest.fixture(scope="module")
def tables(results):
    return {path.stem: read_table(path) for path in results.glob("*.csv")}


def test_the_dial_of_every_policy_is_turned_in_every_fluid(tables):
    dial = tables["dial"]
    assert dial.groupby(["policy", "fluid", "variant"]).size().to_dict() == {
        (policy, fluid, variant): 1 if variant == "coarser step" else 3
        for policy in ("teacher", "student")
        for fluid in ("water", "oil1", "oil2")
        for variant in ("finer step", "coarser step", "planar")
    }
    assert sorted(set(dial["price"])) == pytest.approx(POSITIONS)


def test_a_row_of_the_dial_is_what_the_published_policy_does(results, tables):
    student = sb.Policy.load(results / "policies" / "student-0.safetensors")
    row = tables["dial"].query("policy == 'student' and fluid == 'oil1' and variant == 'finer step'").iloc[1]
    again = sb.evaluate(student.at(row["price"]), fluid="oil1", physics_rate=960, duration=2.0)
    assert (again.speed, again.power) == (row["speed"], row["power"])
    assert again.wave_speed == row["wave_speed"] or (again.wave_speed is None and np.isnan(row["wave_speed"]))


def test_fronts_are_those_of_the_swims():
    tables = published(PUBLISHED / "learned_front").tables
    swims = tables["dial"][tables["dial"]["variant"] == "finer step"]
    valid = swims[(swims["status"] == "ok") & (swims["speed"] > 0) & (swims["power"] > 0)]
    of_power = tables["fronts"][tables["fronts"]["currency"] == "net"].set_index(["method", "seed", "front"])
    for place, part in valid.groupby(["policy", "seed", "fluid"]):
        points = part[["speed", "power"]].to_numpy()
        np.testing.assert_allclose(of_power.loc[[place], ["speed", "power"]], points[front(points)], rtol=1e-8)
    means = valid.groupby(["policy", "seed", "price"])[["speed", "power"]].agg(["mean", "count"])
    whole = means[means["speed", "count"] == 3]
    for policy, seed in {place[:2] for place in of_power.index}:
        shown, known = of_power.loc[[(policy, seed, "integrated")], "speed"], whole.loc[(policy, seed)]["speed", "mean"]
        assert all(np.isclose(known, speed, rtol=1e-7).any() for speed in shown)


def test_the_same_swims_have_a_front_of_positive_power(tables):
    swims = tables["dial"][tables["dial"]["variant"] == "finer step"]
    valid = swims[(swims["status"] == "ok") & (swims["speed"] > 0) & (swims["power"] > 0)]
    fronts = tables["fronts"][tables["fronts"]["currency"] == "positive"]
    assert len(valid) >= 3  # of the teacher: the student has hardly learned
    for (policy, fluid), part in valid.groupby(["policy", "fluid"]):
        points = part[["speed", "positive_power"]].to_numpy()
        own = fronts[(fronts["method"] == policy) & (fronts["front"] == fluid)]
        np.testing.assert_array_equal(own[["speed", "positive_power"]], points[front(points)])
    assert set(tables["attainment"]["currency"]) == {"net", "positive"}


@pytest.mark.slow
def test_the_page_shows_the_fronts_beside_those_of_fixed_gaits(results):
    assert not page(published(results))["currencies"]["net"]["gains"].rows
    run_study(study_config(study_settings(study_path("pareto"), "smoke")), results.parent, workers=2)
    assert "water, sinusoid" in {row[0] for row in page(published(results))["currencies"]["net"]["gains"].rows}


def test_the_page_shows_speeds_as_shares_of_the_limit_at_equal_power(results):
    study = published(PUBLISHED / "learned_front")
    fronts = study.tables["fronts"]
    own = fronts[(fronts["space"].str.startswith("student")) & (fronts["front"] == "oil1")].sort_values("power")
    speeds = [np.interp(5.0, part["power"], part["speed"]) for _, part in own.groupby("space")]
    share = 100 * np.mean(speeds) / sb.limit("oil1", 5.0).speed
    tables = page(study)["of_limit"]["net"]
    shown = cells(tables["mean"], "5 W")
    assert float(shown["student, oil1"].split()[0]) == pytest.approx(share, abs=0.06)
    share = 100 * np.mean(speeds) / sb.limit("oil1", 5.0, bounds="held").speed
    shown = cells(tables["held"], "5 W")
    assert float(shown["student, oil1"].split()[0]) == pytest.approx(share, abs=0.06)
    assert page(published(results))["of_limit"] == {}  # there is no limit beside


@pytest.mark.parametrize(("teachers_name", "currency"), [("one", "net"), ("two", "positive")])
def test_imitators_are_compared_by_the_power_that_their_price_is_of(results, teachers_name, currency):
    study = published(results)
    policies = {"one": {"demonstrations": "limit"}, "two": {"demonstrations": "limit", "currency": "positive"}}
    names = {"teacher": teachers_name, "student": ({"one", "two"} - {teachers_name}).pop()}
    tables = {name: table.replace(names) for name, table in study.tables.items()}
    for name in ("fronts", "switching", "indicators"):  # as if the other did not swim
        tables[name] = tables[name].query("method == @teachers_name")
    manifest = study.manifest | {"config": study.config | {"policies": policies, "shown": ["one"]}}
    content = page(study._replace(tables=tables, manifest=manifest))
    assert {name: of["chosen"] for name, of in content["currencies"].items()} == {currency: teachers_name}
    assert content["imitators"] == {"one": "P", "two": "P+"} and content["learning"] is None


def test_a_policy_without_a_dial_is_refused_before_anything_runs(tmp_path):
    policies = {"teacher": {}}
    config = study_config(settings(policies=policies, published=[], shown=[]))
    with pytest.raises(InvalidValue, match=r"teacher 0: randomisation\.prices is needed"):
        run_study(config, tmp_path, workers=1)
    assert not (tmp_path / ".cache" / "training").exists()


def test_tables_of_fronts_name_policy_and_seed(tables):
    for name in ("fronts", "indicators"):
        table = tables[name]
        assert list(table["space"]) == [f"{row.method} {row.seed}" for row in table.itertuples()]


def test_the_page_counts_how_often_speed_and_power_fall_as_the_price_rises(results, tables):
    head, rows = page(published(results))["monotony"]
    fine = (
        tables["dial"].query("variant == 'finer step' and policy == 'student' and fluid == 'oil1'").sort_values("price")
    )
    row = next(row for row in rows if row[0] == "student, oil1")
    for name in ("speed", "power"):
        falls = (np.diff(fine[name]) <= 0).sum()
        assert row[head.index(f"{name} falls")] == f"{falls} of 2"
