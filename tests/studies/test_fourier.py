"""The Fourier study and its page, end to end on a small budget."""

from __future__ import annotations

import re
import shutil
from itertools import product
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import snakebench as sb
from snakebench.errors import InvalidValue
from snakebench.manifest import read_manifest
from snakebench.names import CURRENCIES
from snakebench.site import write_report
from snakebench.studies.config import study_path, study_settings
from snakebench.studies.fourier import run as fourier
from snakebench.studies.fourier.page import gait_of, page
from snakebench.studies.fourier.run import Goal, Tuning
from snakebench.studies.fronts import beside_searched, front, front_of
from snakebench.studies.learned_front.page import page as learned_front_page
from snakebench.studies.pareto.page import page as pareto_page
from snakebench.studies.published import published
from snakebench.studies.running import run_study, study_config
from snakebench.tables import read_table

SEARCH = ["tuned_to", "objective", "price", "seed"]
FLUIDS = {"water": ["water"], "oil2": ["oil2"], "integrated": ["water", "oil2"]}
PRICED = {"return": "power", "price": "power", "positive price": "positive_power"}
N_JOINTS = sb.Robot().n_joints
COMMITTED = Path(__file__).parents[2] / "results"


def settings(profile: str = "smoke", **changes):
    return study_settings(study_path("fourier"), profile) | changes


@pytest.fixture(scope="module")
def results(tmp_path_factory):
    config = study_config(settings())
    return run_study(config, tmp_path_factory.mktemp("study") / "results", workers=1)


@pytest.fixture(scope="module")
def written(results, tmp_path_factory):
    return write_report(results, tmp_path_factory.mktemp("reports"))


@pytest.fixture(scope="module")
def findings(results):
    """What the page finds in the tables."""
    return page(published(results))["findings"]


@pytest.fixture(scope="module")
def tables(results):
    return {name: read_table(results / f"{name}.csv") for name in ("growth", "optima", "gaits")}


def outcome(directory: Path) -> dict[str, bytes]:
    files = [*directory.glob("*.csv"), *directory.glob("trajectories/*.npz")]
    return {path.name: path.read_bytes() for path in files}


def test_every_goal_is_searched_in_every_fluid_and_in_all_at_once(tables):
    found = tables["optima"].groupby([*SEARCH, "harmonics"], dropna=False)["fluid"]
    assert len(found) == 3 * 2 * 5  # the return, and two prices of P and of P+
    for (tuned_to, *_), fluids in found:
        assert fluids.value_counts().to_dict() == dict.fromkeys(FLUIDS[tuned_to], 3)


def test_the_value_of_one_gait_for_all_is_the_mean_of_its_values_in_each_fluid(tables):
    optima = tables["optima"]
    shared = optima[(optima["variant"] == "searched") & (optima["tuned_to"] == "integrated")]
    assert len(shared) == 2 * 2 * 5
    for (_, objective, price, value), swims in shared.groupby(
        ["harmonics", "objective", "price", "value"], dropna=False
    ):
        priced = 10 * swims["speed"] - price * swims[PRICED[objective]]
        assert value == pytest.approx((swims["return"] if np.isnan(price) else priced).mean(), rel=1e-12)


@pytest.mark.slow
def test_a_fluid_is_searched_alike_whatever_others_are(tables, tmp_path):
    alone = run_study(study_config(settings(fluids=["water"])), tmp_path, workers=1)
    for name, table in tables.items():
        same = table[table["tuned_to"] == "water"].reset_index(drop=True)
        pd.testing.assert_frame_equal(read_table(alone / f"{name}.csv"), same, check_exact=True)
    assert set(read_table(alone / "fronts.csv")["front"]) == {"water"}
    assert not (alone / "switching.csv").exists()
    content = page(published(alone))
    assert set(content["findings"]["highest"]["tuned_to"]) == {"water"} and len(content["swimmers"]) == 1


@pytest.mark.slow
def test_two_workers_give_the_same_bytes(results, tmp_path):
    assert outcome(run_study(study_config(settings()), tmp_path, workers=2)) == outcome(results)


@pytest.mark.slow
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
        assert (row["speed"], row["power"], row["return"]) == (again.speed, again.power, again.episode_return)
        if row["tuned_to"] == row["fluid"]:
            power = getattr(again, PRICED[row["objective"]])
            value = again.episode_return if np.isnan(price) else 10 * again.speed - price * power
            assert row["value"] == value


@pytest.mark.parametrize(("price", "seconds"), [(None, 5.0), (0.5, 9.0)])
def test_a_gait_settles_before_its_speed_and_power_count_and_has_a_fixed_time_for_its_return(price, seconds):
    config = study_config(settings(periods=6))
    cases = Tuning(config, Goal(1, price), "integrated", 0).ask()  # the wave of 0.7 Hz that it starts from
    assert [case.scenario.fluid for case in cases] == [sb.named_fluid("water"), sb.named_fluid("oil2")]
    assert {case.scenario.duration for case in cases} == {seconds}


def test_the_best_value_never_falls_within_a_search_or_as_harmonics_are_added(tables):
    for _, rows in tables["growth"].groupby(SEARCH, dropna=False):
        assert rows["best"].is_monotonic_increasing
        assert rows["gaits"].is_monotonic_increasing
        assert rows["harmonics"].is_monotonic_increasing


def test_every_search_finds_better_than_it_starts_with(tables):
    first = tables["growth"][tables["growth"]["harmonics"] == 1].groupby(SEARCH, dropna=False)["best"]
    assert (first.last() > first.first()).all()


def test_a_search_at_a_price_starts_at_the_better_of_the_optima_before_it(tables):
    searched = tables["optima"][tables["optima"]["variant"] == "searched"]
    search = ["tuned_to", "harmonics", "objective", "price"]
    known = searched.fillna({"price": 0.0}).set_index(search).sort_index()
    started = tables["growth"].fillna({"price": 0.0}).groupby(search)["best"].first()
    for tuned_to, harmonics, objective in product(FLUIDS, (1, 2), ("price", "positive price")):
        for before, price in ((("return", 0.0), 0.05), ((objective, 0.05), 0.5)):
            starts = [known.loc[[(tuned_to, harmonics, *before)]]]
            starts += [known.loc[[(tuned_to, 1, objective, price)]]] if harmonics == 2 else []
            values = [(10 * start["speed"] - price * start[PRICED[objective]]).mean() for start in starts]
            assert started[tuned_to, harmonics, objective, price] == pytest.approx(max(values), rel=1e-12)


def test_budgets_are_counted_exactly(tables, results):
    # 20 gaits a harmonic hold the starts (one; two at a price with two harmonics) and generations of six.
    spent = tables["growth"].groupby(["tuned_to", "objective", "price"], dropna=False)["gaits"].max()
    assert set(spent.xs("return", level="objective")) == {(1 + 3 * 6) + (1 + 6 * 6)}
    assert set(spent.drop("return", level="objective")) == {(1 + 3 * 6) + (2 + 6 * 6)}
    planned = sum(load.times for load in fourier.plan(study_config(settings())))
    swims = sum(len(FLUIDS[tuned_to]) * gaits for (tuned_to, *_), gaits in spent.items())
    assert read_manifest(results)["evaluations"] == planned == swims + len(tables["optima"])


def test_fronts_are_the_verified_optima_that_no_other_beats(results, tables):
    fronts, optima = read_table(results / "fronts.csv"), tables["optima"]
    assert set(fronts["front"]) == {"water", "oil2", "integrated"}
    for fluid in ("water", "oil2"):
        fine = optima[(optima["variant"] == "finer step") & (optima["fluid"] == fluid) & (optima["status"] == "ok")]
        points = fine.loc[(fine["speed"] > 0) & (fine["power"] > 0), ["speed", "power"]].to_numpy()
        found = fronts.loc[(fronts["front"] == fluid) & (fronts["currency"] == "net"), ["speed", "power"]].to_numpy()
        assert found.tolist() == points[front(points)].tolist()
    for _, worth in read_table(results / "indicators.csv").set_index("front").groupby("currency")["hypervolume"]:
        assert worth["oil2"] < worth["simple-sum"] < worth["water"]


def test_one_gait_for_all_is_worth_the_means_of_its_swims_if_all_are_valid(tables):
    optima = tables["optima"].copy()
    fine = optima[(optima["variant"] == "finer step") & (optima["tuned_to"] == "integrated")]
    fastest = fine.loc[fine["speed"].idxmax()]
    optima.loc[(optima["value"] == fastest["value"]) & (optima["fluid"] == "oil2"), "status"] = "diverged"
    for table, invalid in ((tables["optima"], False), (optima, True)):
        swims = beside_searched(table, "searched")
        found = front_of(swims, [*SEARCH, "harmonics"], FLUIDS["integrated"])
        pairs = fine.groupby("value")[["speed", "power"]].mean().drop(fastest["value"] if invalid else [])
        np.testing.assert_allclose(found[["speed", "power"]], pairs.to_numpy()[front(pairs.to_numpy())], rtol=1e-12)


def test_switching_dominates_one_gait_for_all(results):
    shared = read_table(results / "fronts.csv").query("front == 'integrated'")
    switched = read_table(results / "switching.csv")
    for row in shared.to_dict("records"):
        power, own = CURRENCIES[row["currency"]], switched[switched["currency"] == row["currency"]]
        assert ((own["speed"] >= row["speed"] - 1e-12) & (own[power] <= row[power] + 1e-12)).any()


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


@pytest.mark.parametrize(("name", "tuned_to"), [("oil2", "oil2"), ("integrated-oil2", "integrated")])
def test_the_run_kept_is_that_of_the_highest_return(tables, results, name, tuned_to):
    optima = tables["optima"]
    own = optima[(optima["objective"] == "return") & (optima["tuned_to"] == tuned_to)]
    best = own.loc[own["value"].idxmax()]
    kept = sb.Trajectory.load(results / "trajectories" / f"{name}.npz")
    gait = gait_of(tables["gaits"], best)
    again = sb.simulate(gait, fluid="oil2", physics_rate=960, duration=float(kept.time[-1])).thinned(32)
    assert kept.rate == 30
    assert kept.joint_angle == pytest.approx(again.joint_angle, abs=1e-4)


def test_the_highest_return_is_found_by_what_was_searched_and_shown_as_verified(tables, findings):
    optima, highest = tables["optima"], findings["highest"].set_index("tuned_to")
    fine = optima[(optima["variant"] == "finer step") & (optima["objective"] == "return")]
    assert set(highest.index) == set(FLUIDS)
    for tuned_to, row in highest.iterrows():
        own = fine[fine["tuned_to"] == tuned_to]
        means = own[own["value"] == own["value"].max()][["speed", "power", "return"]].mean()
        assert row[["speed", "power", "return"]].tolist() == pytest.approx(means.tolist())


def test_a_mean_over_fluids_costs_its_mean_power_at_its_mean_speed(findings):
    row = findings["highest"].set_index("tuned_to").loc["integrated"]
    weight = sb.Robot().total_mass * 9.80665  # standard gravity [m/s^2]
    assert row["cost_of_transport"] == pytest.approx(row["power"] / (weight * row["speed"]))
    assert row["positive_cost_of_transport"] == pytest.approx(row["positive_power"] / (weight * row["speed"]))


def test_the_gain_of_a_harmonic_is_that_of_the_mean_return_as_verified(tables, findings):
    gains = findings["harmonics"].set_index(["tuned_to", "harmonics"])["gain"]
    optima = tables["optima"]
    verified = optima[(optima["variant"] == "finer step") & (optima["objective"] == "return")]
    one, two = (verified.query(f"tuned_to == 'oil2' and harmonics == {n}")["return"].mean() for n in (1, 2))
    assert gains["oil2", 2] == pytest.approx(two / one - 1) and np.isnan(gains["oil2", 1])


def test_the_page_needs_no_network(written):
    text = written.read_text()
    assert text.count("<svg") == 3
    links = re.findall(r'(?:src|href|url)\s*[=(]\s*["\']?([^"\')\s>]+)', text)
    assert all(link.startswith(("#", "data:")) for link in links)


def test_ids_on_the_page_are_unique(written):
    ids = re.findall(r'\bid="([^"]+)"', written.read_text())
    assert len(ids) == len(set(ids))


def test_the_page_is_a_function_of_the_results(results, written, tmp_path):
    assert write_report(results, tmp_path).read_bytes() == written.read_bytes()


@pytest.mark.slow
def test_the_best_sea_snake_of_each_fluid_stands_beside_the_waveforms_if_it_is_there(results, tmp_path):
    copy = shutil.copytree(results, tmp_path / "results" / "fourier-smoke")
    assert page(published(copy))["stars"] == 0
    shutil.copytree(COMMITTED / "sea_snake", tmp_path / "results" / "sea_snake-smoke")
    assert page(published(copy))["stars"] == 2  # the one for all is of other fluids


def test_no_waveform_beside_a_sea_snake_gait_needs_more_power():
    rivals = page(published(COMMITTED / "fourier"))["findings"]["rivals"]
    assert list(rivals["tuned_to"]) == ["water", "oil1", "oil2", "integrated"]
    assert (rivals["power"] <= rivals["power_sea_snake"]).all()


@pytest.mark.slow
def test_other_pages_show_one_waveform_for_all(results, tmp_path):
    shutil.copytree(results, tmp_path / "fourier")
    fixed, learned = (
        published(shutil.copytree(COMMITTED / name, tmp_path / name)) for name in ("sea_snake_front", "learned_front")
    )
    shown = {row[0] for row in pareto_page(fixed)["front_table"].rows}
    assert {"free waveform, integrated", "free waveform, simple-sum"} <= shown
    content = learned_front_page(learned)
    assert list(content["currencies"]) == ["net", "positive"]
    gains = content["findings"]["gains"]
    against = gains[(gains["front"] == "integrated") & (gains["method"] == "free waveform")]["against"]
    assert set(against) == {"integrated", "simple-sum"}


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
@pytest.mark.parametrize(("price", "currency"), [(None, "net"), (2.0, "net"), (2.0, "positive")])
def test_a_gait_that_did_not_swim_validly_is_worth_less_than_any_that_did(price, currency, change):
    swam = {"status": "ok", "steady": False, "speed": -3.0, "power": 1e6, "positive_power": 2e6, "episode_return": -1e6}
    goal, valid, other = Goal(1, price, currency=currency), sb.Evaluation(**swam), sb.Evaluation(**swam | change)
    assert -np.inf < goal.value([other]) < goal.value([valid])
    assert goal.value([valid, other]) == goal.value([other])


def test_a_study_in_which_nothing_swims_says_so(tmp_path):
    # A robot of 3 m diameter carries more added mass than mass; a force that lags a step then explodes.
    changes = {"fluids": ["oil2"], "robot": sb.Robot(diameter=3.0), "engine": "pybullet", "harmonics": [1], "trials": 7}
    with pytest.raises(InvalidValue, match="no gait swam validly in oil2"):
        run_study(study_config(settings(**changes)), tmp_path, workers=1)
