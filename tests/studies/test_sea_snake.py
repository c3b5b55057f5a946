"""The sea-snake study and its page, end to end on a small budget."""

from __future__ import annotations

import re
import shutil
from itertools import product
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from pages import cells, page_of
from writing import list_files

import snakebench as sb
from snakebench.errors import InvalidValue, SnakebenchError
from snakebench.manifest import read_manifest
from snakebench.report.intervals import confidence_interval
from snakebench.site import write_report
from snakebench.studies.config import study_path, study_settings
from snakebench.studies.running import run_study, study_config
from snakebench.studies.sea_snake import figures
from snakebench.tables import read_table

BUDGET = {"trials": 10, "batch": 5, "seeds": [0, 1], "duration": 2.0}


@pytest.fixture(scope="module")
def results(tmp_path_factory):
    directory = tmp_path_factory.mktemp("study")
    config = study_config(study_settings(study_path("quickstart"), "smoke") | BUDGET)
    return run_study(config, directory / "results", workers=1)


@pytest.fixture(scope="module")
def page(results, tmp_path_factory):
    return write_report(results, tmp_path_factory.mktemp("reports"))


def test_every_objective_and_seed_is_searched_with_the_same_budget(results):
    trials = read_table(results / "trials.csv")
    counted = trials.groupby(["objective", "seed", "fluid"]).size()
    assert set(counted) == {10}
    assert set(trials["objective"]) == {"water", "oil1", "oil2", "mean"}


def test_the_mean_objective_is_the_mean_of_its_fluids(results):
    trials = read_table(results / "trials.csv")
    mean = trials[trials["objective"] == "mean"].groupby(["seed", "trial"])
    assert mean["return"].mean().to_numpy() == pytest.approx(mean["value"].first().to_numpy())


def test_each_optimum_is_the_best_of_its_search_and_reproduces(results):
    trials, optima = read_table(results / "trials.csv"), read_table(results / "optima.csv")
    searched = optima[(optima["variant"] == "searched") & (optima["objective"] == "oil1")]
    for row in searched.to_dict("records"):
        of_search = trials[(trials["objective"] == "oil1") & (trials["seed"] == row["seed"])]
        assert row["return"] == of_search["value"].max()
        gait = sb.SeaSnake(amplitude=row["amplitude"], frequency=row["frequency"], phase=row["phase"])
        assert sb.evaluate(gait, fluid="oil1", duration=2.0).episode_return == row["return"]


def test_optima_are_checked_at_the_finer_rate_and_on_the_neutral_robot(results):
    optima = read_table(results / "optima.csv")
    variants = set(zip(optima["variant"], optima["physics_rate"], optima["diameter"].round(4), strict=True))
    assert variants == {
        ("searched", 480, 0.1),
        ("coarser step", 480, 0.1),
        ("finer step", 960, 0.1),
        ("neutral diameter", 960, 0.0686),
    }


def test_every_gait_lies_within_the_papers_bounds(results):
    trials = read_table(results / "trials.csv")
    for name, (low, high) in sb.SeaSnake.SPACE.items():
        assert trials[name].between(low, high).all()


def test_the_manifest_holds_the_configuration(results):
    manifest = read_manifest(results)
    assert manifest["config"]["seeds"] == [0, 1]
    assert manifest["evaluations"] == 2 * 6 * (10 + 4)


def test_the_page_is_one_small_file_that_needs_no_network(page):
    text = page.read_text()
    assert len(text) < 5_000_000
    links = re.findall(r'(?:src|href|url)\s*[=(]\s*["\']?([^"\')\s>]+)', text)
    assert all(link.startswith(("#", "data:")) for link in links)
    assert "@import" not in text and "fetch(" not in text


def test_the_page_shows_the_best_gait_of_each_fluid(results):
    optima = read_table(results / "optima.csv")
    fine = optima[(optima["variant"] == "finer step") & (optima["objective"] == "water")]
    best = fine.loc[fine["return"].idxmax()]
    shown = cells(page_of(results)["best"], "v [m/s]")["water"]
    assert float(shown.split()[0]) == pytest.approx(best["speed"], rel=5e-3)


def test_the_page_has_its_figures(page):
    assert page.read_text().count("<svg") == 4


def test_ids_on_the_page_are_unique(page):
    ids = re.findall(r'\bid="([^"]+)"', page.read_text())
    assert len(ids) == len(set(ids))
    used = set(re.findall(r'(?:href="|url\()#([^")]+)', page.read_text()))
    assert used <= set(ids)


def test_small_numbers_keep_their_digits_in_figures():
    trials = pd.DataFrame({"objective": "oil2", "seed": 0, "trial": range(5), "value": np.linspace(0.012, 0.016, 5)})
    labels = re.findall(r"<text[^>]*>([^<]*)</text>", figures.convergence(trials))
    assert {"0.012", "0.014", "0.016"} <= set(labels)


@pytest.mark.parametrize(
    ("damage", "listed"),
    [("manifest", True), *product(["table", "column", "trajectory"], [True, False])],
)
def test_damaged_results_are_refused_in_one_line(results, tmp_path, damage, listed):
    copy = shutil.copytree(results, tmp_path / "results")
    if damage == "manifest":
        (copy / "manifest.json").write_text('{"format": 1}')
    elif damage == "table":
        (copy / "optima.csv").write_text("objective,fluid\n")
    elif damage == "column":
        read_table(copy / "optima.csv").drop(columns="variant").to_csv(copy / "optima.csv")
    else:
        whole = (copy / "trajectories" / "water-water.npz").read_bytes()
        (copy / "trajectories" / "water-water.npz").write_bytes(whole[: len(whole) // 2])
    if not listed and damage != "manifest":
        list_files(copy)
    reasons = r"cannot (use|read)|is damaged|is not a saved trajectory|not as the manifest lists"
    with pytest.raises(SnakebenchError, match=reasons) as caught:
        write_report(copy, tmp_path)
    assert "\n" not in str(caught.value)
    assert not list(tmp_path.glob("*.html"))


def test_the_page_is_a_function_of_the_results(results, page, tmp_path):
    assert write_report(results, tmp_path).read_bytes() == page.read_bytes()


def test_a_study_in_which_nothing_swims_says_so(tmp_path):
    # A robot of 3 m diameter carries more added mass than mass; a force that lags a step then explodes.
    robot = sb.Robot(diameter=3.0)
    settings = study_settings(study_path("quickstart"), "smoke") | {"fluids": ["oil2"], "robot": robot, "trials": 2}
    with pytest.raises(InvalidValue, match="no gait swam validly and forwards: 2 diverged of 2 swims"):
        run_study(study_config(settings), tmp_path, workers=1)


def test_tpe_beats_its_own_random_start(tmp_path):
    # TPE's first ten gaits are random.
    settings = study_settings(study_path("quickstart"), "smoke")
    settings |= {"fluids": ["water"], "engine": "planar", "physics_rate": 90, "trials": 40, "batch": 5, "duration": 8.0}
    trials = read_table(run_study(study_config(settings), tmp_path, workers=1) / "trials.csv")
    assert trials["value"][10:].max() > trials["value"][:10].max()
    assert trials["value"][25:].mean() > trials["value"][:10].mean()


@pytest.mark.parametrize(
    ("rates", "why"),
    [
        ({"verify_rate": 120}, "physics rate 60 Hz is unstable"),
        ({"physics_rate": 100}, "physics_rate 100 must be a multiple of control_rate 30"),
        ({"physics_rate": 60}, "physics rate 60 Hz is unstable"),
    ],
)
def test_rates_that_cannot_be_run_are_refused_before_anything_is(tmp_path, rates, why):
    settings = study_settings(study_path("quickstart"), "smoke") | rates
    with pytest.raises(InvalidValue, match=why):
        run_study(study_config(settings), tmp_path / "results", workers=1)
    assert not (tmp_path / "results").exists()


def test_another_seed_is_another_study():
    settings = study_settings(study_path("sea_snake"), "quick", seeds=[3, 4])
    assert settings["name"] == "sea_snake-quick-seeds-3-4"


def test_one_fluid_needs_no_mean(tmp_path):
    settings = study_settings(study_path("quickstart"), "smoke") | {"fluids": ["oil2@40"], "duration": 1.0}
    directory = run_study(study_config(settings), tmp_path / "results", workers=1)
    assert set(read_table(directory / "trials.csv")["objective"]) == {"oil2@40"}
    assert [row[0] for row in page_of(directory)["best"].rows] == ["oil2@40"]


def test_the_full_profile_is_the_published_budget():
    config = study_config(study_settings(study_path("sea_snake"), "full"))
    assert config.trials >= 200 and len(config.seeds) == 5 and len(config.objectives()) == 4
    assert config.name == "sea_snake"


def test_the_published_results_make_the_published_answer(published_reports):
    page = (published_reports / "sea_snake.html").read_text()
    answer = re.search(r'<div class="answer">.*?</div>', page, flags=re.DOTALL)[0]
    optima = read_table(Path(__file__).parents[2] / "results" / "sea_snake" / "optima.csv")
    own = optima.query("objective == 'water' and fluid == 'water'").set_index("variant")
    searched, finer = (own.loc[[name]].set_index("seed") for name in ("searched", "finer step"))
    best = finer.loc[searched["return"].idxmax()]
    assert f"swims {best['speed']:.3f} m/s at {best['power']:.2f} W there" in answer


def test_student_t_interval_of_five_values():
    # scipy.stats.t.ppf(0.975, 4) = 2.776445; the standard error of 1..5 is sqrt(2.5 / 5)
    low, high = confidence_interval(np.array([1.0, 2.0, 3.0, 4.0, 5.0]))
    assert (low, high) == pytest.approx((3 - 2.776445 * np.sqrt(0.5), 3 + 2.776445 * np.sqrt(0.5)), abs=1e-5)
    assert confidence_interval(np.array([1.0])) is None
