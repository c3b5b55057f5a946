"""The Fourier study and its page, end to end on a small budget."""

from __future__ import annotations

import re
import shutil
from pathlib import Path

import numpy as np
import pytest

import snakebench as sb
from snakebench.errors import InvalidValue
from snakebench.reporting.fourier import gait_of
from snakebench.reporting.page import write_report
from snakebench.store import read_manifest, read_table
from snakebench.studies import fourier, run_study, study_config
from snakebench.studies.config import study_path, study_settings
from snakebench.studies.fronts import front

SEARCH = ["fluid", "objective", "price", "seed"]
N_JOINTS = sb.Robot().n_joints


def settings(profile: str = "smoke", **changes):
    return study_settings(study_path("fourier"), profile) | changes


@pytest.fixture(scope="module")
def results(tmp_path_factory):
    config = study_config(settings())
    return run_study(config, tmp_path_factory.mktemp("study") / "results", workers=2)


@pytest.fixture(scope="module")
def page(results, tmp_path_factory):
    return write_report(results, tmp_path_factory.mktemp("reports"))


@pytest.fixture(scope="module")
def tables(results):
    return {name: read_table(results / f"{name}.csv") for name in ("growth", "optima", "gaits")}


def outcome(directory: Path) -> dict[str, bytes]:
    files = [*directory.glob("*.csv"), *directory.glob("trajectories/*.npz")]
    return {path.name: path.read_bytes() for path in files}


def test_every_goal_is_searched_in_every_fluid(tables):
    found = tables["optima"].groupby(["fluid", "harmonics", "objective", "price", "seed"], dropna=False).size()
    assert len(found) == 2 * 2 * 3
    assert set(found) == {3}


def test_one_worker_gives_the_same_bytes(results, tmp_path):
    assert outcome(run_study(study_config(settings()), tmp_path, workers=1)) == outcome(results)


def test_a_finished_study_is_answered_from_the_cache(results):
    before = outcome(results)
    again = run_study(study_config(settings()), results.parent, workers=1)
    assert read_manifest(again)["computed"] == 0
    assert outcome(again) == before


def test_a_gait_made_again_from_its_table_evaluates_to_the_searched_value(tables):
    searched = tables["optima"][tables["optima"]["variant"] == "searched"]
    for row in searched.to_dict("records"):
        gait = gait_of(tables["gaits"], row)
        price = row["price"]
        seconds = 5.0 if np.isnan(price) else max(5.0, np.ceil(1 / gait.frequency))
        again = sb.evaluate(gait, fluid=row["fluid"], engine="planar", physics_rate=90, duration=seconds)
        assert row["value"] == (again.episode_return if np.isnan(price) else 10 * again.speed - price * again.power)


@pytest.mark.parametrize(("price", "seconds"), [(None, 5.0), (0.5, 9.0)])
def test_a_gait_settles_before_its_speed_and_power_count_and_has_a_fixed_time_for_its_return(price, seconds):
    config = study_config(settings(periods=6))
    start = np.hstack([np.log(0.7), np.full(14, 0.1)])
    (case,) = fourier.Search(config, fourier.Goal(1, price), "water", 0, [start], 0).ask()
    assert case.scenario.duration == seconds


def test_the_best_value_never_falls_within_a_search_or_as_harmonics_are_added(tables):
    for _, rows in tables["growth"].groupby(SEARCH, dropna=False):
        assert rows["best"].is_monotonic_increasing
        assert rows["evaluations"].is_monotonic_increasing
        assert rows["harmonics"].is_monotonic_increasing


def test_every_search_finds_better_than_it_starts_with(tables):
    first = tables["growth"][tables["growth"]["harmonics"] == 1].groupby(SEARCH, dropna=False)["best"]
    assert (first.last() > first.first()).all()


def test_a_search_at_a_price_starts_at_the_better_of_the_optima_before_it(tables):
    searched = tables["optima"][tables["optima"]["variant"] == "searched"]
    known = searched.fillna({"price": 0.0}).set_index(["fluid", "harmonics", "price"])
    started = tables["growth"].fillna({"price": 0.0}).groupby(["fluid", "harmonics", "price"])["best"].first()
    for fluid in ("water", "oil2"):
        for harmonics in (1, 2):
            for before, price in ((0.0, 0.05), (0.05, 0.5)):
                starts = [known.loc[(fluid, harmonics, before)]]
                starts += [known.loc[(fluid, 1, price)]] if harmonics == 2 else []
                values = [10 * start["speed"] - price * start["power"] for start in starts]
                assert started[fluid, harmonics, price] == max(values)


def test_budgets_are_counted_exactly(tables, results):
    # 20 evaluations a harmonic hold the starts (one; two at a price with two harmonics) and generations of six.
    spent = tables["growth"].groupby(["fluid", "objective", "price"], dropna=False)["evaluations"].max()
    assert set(spent.xs("return", level="objective")) == {(1 + 3 * 6) + (1 + 6 * 6)}
    assert set(spent.xs("price", level="objective")) == {(1 + 3 * 6) + (2 + 6 * 6)}
    planned = sum(load.times for load in fourier.plan(study_config(settings())))
    assert read_manifest(results)["evaluations"] == planned == spent.sum() + 3 * 2 * 2 * 3


def test_fronts_are_the_verified_optima_that_no_other_beats(results, tables):
    fronts, optima = read_table(results / "fronts.csv"), tables["optima"]
    assert set(fronts["front"]) == {"water", "oil2"}
    for fluid in ("water", "oil2"):
        fine = optima[(optima["variant"] == "finer step") & (optima["fluid"] == fluid) & (optima["status"] == "ok")]
        points = fine.loc[(fine["speed"] > 0) & (fine["power"] > 0), ["speed", "power"]].to_numpy()
        found = fronts.loc[fronts["front"] == fluid, ["speed", "power"]].to_numpy()
        assert found.tolist() == points[front(points)].tolist()
    worth = read_table(results / "indicators.csv").set_index("front")["hypervolume"]
    assert worth["oil2"] < worth["simple-sum"] < worth["water"]


def test_gaits_lie_within_the_search_space(tables):
    gaits = tables["gaits"]
    assert gaits[["cosine", "sine"]].abs().max().max() <= 1
    assert gaits["frequency"].between(0.1, 2.0).all()


def test_optima_are_verified_in_pybullet_at_two_rates(tables):
    optima = tables["optima"]
    assert set(zip(optima["variant"], optima["engine"], optima["physics_rate"], strict=True)) == {
        ("searched", "planar", 90),
        ("coarser step", "pybullet", 480),
        ("finer step", "pybullet", 960),
    }


def test_the_run_kept_for_a_fluid_is_that_of_its_highest_return(tables, results):
    optima = tables["optima"]
    fine = optima[(optima["variant"] == "finer step") & (optima["objective"] == "return") & (optima["fluid"] == "oil2")]
    best = fine.loc[fine["value"].idxmax()]
    kept = sb.Trajectory.load(results / "trajectories" / "oil2.npz")
    wanted = gait_of(tables["gaits"], best).commands(kept.time, N_JOINTS)
    assert kept.rate == 60
    assert kept.command[:-1] == pytest.approx(wanted[:-1], abs=1e-9)


def test_the_page_prints_the_stored_numbers_and_needs_no_network(tables, page):
    optima, text = tables["optima"], page.read_text()
    fine = optima[(optima["variant"] == "finer step") & (optima["objective"] == "return")]
    best = fine[fine["fluid"] == "water"].sort_values("value").iloc[-1]
    assert f"In water: {best['speed']:.3g} m/s at {best['power']:.3g} W" in text
    assert text.count("<svg") == 3
    links = re.findall(r'(?:src|href|url)\s*[=(]\s*["\']?([^"\')\s>]+)', text)
    assert all(link.startswith(("#", "data:")) for link in links)


def test_ids_on_the_page_are_unique(page):
    ids = re.findall(r'\bid="([^"]+)"', page.read_text())
    assert len(ids) == len(set(ids))


def test_the_page_is_a_function_of_the_results(results, page, tmp_path):
    assert write_report(results, tmp_path).read_bytes() == page.read_bytes()


def test_the_sea_snake_stands_beside_when_its_results_do(results, page, tmp_path):
    copy = shutil.copytree(results, tmp_path / "results" / "fourier-smoke")
    shutil.copytree(Path(__file__).parents[2] / "results" / "sea_snake", tmp_path / "results" / "sea_snake")
    text = write_report(copy, tmp_path).read_text()
    assert "best sea snake" in text and "at no more power than the best sea-snake gait" in text
    assert "sea-snake gait" not in page.read_text()


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        ({"harmonics": [0]}, "harmonics"),
        ({"harmonics": [1, 1]}, "each must be above the one before"),
        ({"harmonics": []}, "harmonics"),
        ({"prices": []}, "prices"),
        ({"prices": [-0.1, 0.1]}, "prices"),
        ({"prices": [0.5, 0.1]}, "each must be above the one before"),
        ({"frequency": [2.0, 0.1]}, "each must be above the one before"),
        ({"frequency": [0.0, 1.0]}, "frequency"),
        ({"population": 1}, "population"),
        ({"trials": 6}, "trials = 6: at least 7 are needed for a generation of 6 gaits"),
        (
            {"price_trials": 5, "harmonics": [2], "population": 10},
            "price_trials = 5: at least 6 are needed for a generation of 10 gaits",
        ),
    ],
)
def test_a_wrong_setting_is_refused_in_one_line_before_anything_is_run(tmp_path, wrong, said):
    with pytest.raises(InvalidValue, match=said) as caught:
        run_study(study_config(settings(**wrong)), tmp_path / "results", workers=1)
    assert "\n" not in str(caught.value)
    assert not (tmp_path / "results").exists()


@pytest.mark.parametrize("change", [{"status": "diverged"}, {"speed": None}, {"power": None}, {"power": -0.1}])
@pytest.mark.parametrize("price", [None, 2.0])
def test_a_gait_that_did_not_swim_validly_is_worth_less_than_any_that_did(price, change):
    swam = {"status": "ok", "steady": False, "speed": -3.0, "power": 1e6, "episode_return": -1e6}
    goal = fourier.Goal(1, price)
    assert -np.inf < goal.value(sb.Evaluation(**swam | change)) < goal.value(sb.Evaluation(**swam))


def test_a_study_in_which_nothing_swims_says_so(tmp_path):
    # A robot of 3 m diameter carries more added mass than mass; a force that lags a step then explodes.
    changes = {"fluids": ["oil2"], "robot": sb.Robot(diameter=3.0), "engine": "pybullet", "harmonics": [1], "trials": 7}
    with pytest.raises(InvalidValue, match="no gait swam validly in oil2"):
        run_study(study_config(settings(**changes)), tmp_path, workers=1)
