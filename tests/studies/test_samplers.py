"""The comparison of samplers in the sea-snake study, end to end on a small budget."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from pages import cells, page_of

import snakebench as sb
from snakebench.errors import InvalidValue
from snakebench.manifest import read_manifest
from snakebench.site import write_report
from snakebench.studies.config import study_path, study_settings
from snakebench.studies.published import Published
from snakebench.studies.running import run_study, study_config
from snakebench.studies.samplers import SAMPLERS, Search
from snakebench.studies.sea_snake.page import comparison, holm
from snakebench.tables import read_table

ALL = ["tpe", "random", "cmaes", "gp"]
OBJECTIVES = ["water", "oil2", "mean"]
BUDGET = {
    "fluids": ["water", "oil2"],
    "engine": "planar",
    "physics_rate": 90,
    "trials": 16,
    "batch": 4,
    "seeds": [0, 1],
    "duration": 1.0,
}


def settings(**changes):
    return study_settings(study_path("quickstart"), "smoke") | BUDGET | {"compared": ALL} | changes


def tables(directory):
    return {path.name: path.read_bytes() for path in directory.glob("*.csv")}


@pytest.fixture(scope="module")
def results(tmp_path_factory):
    return run_study(study_config(settings()), tmp_path_factory.mktemp("samplers"), workers=1)


@pytest.fixture(scope="module")
def tried(results):
    return read_table(results / "samplers.csv")


@pytest.fixture(scope="module")
def winners(results):
    return read_table(results / "winners.csv")


def test_every_sampler_has_the_same_budget(tried):
    assert set(tried.groupby(["sampler", "objective", "seed"]).size()) == {16}
    assert list(tried["sampler"].unique()) == ALL
    assert list(tried["objective"].unique()) == OBJECTIVES
    assert list(tried) == ["sampler", "objective", "seed", "trial", "amplitude", "frequency", "phase", "value"]


def test_every_gait_lies_within_the_search_space(tried):
    for name, (low, high) in sb.SeaSnake.SPACE.items():
        assert tried[name].between(low, high).all()


def test_with_one_seed_all_samplers_begin_with_the_same_batch_and_then_part(tried):
    gaits = tried[(tried["objective"] == "water") & (tried["seed"] == 0)].pivot(
        index="trial", columns="sampler", values="amplitude"
    )
    assert (gaits[:4].nunique(axis=1) == 1).all()
    assert (gaits[12:].nunique(axis=1) == 4).all()


def test_the_value_of_a_gait_is_its_return_on_the_engine_of_the_comparison(tried):
    row = tried[(tried["objective"] == "mean") & (tried["sampler"] == "gp")].iloc[-1]
    gait = sb.SeaSnake(amplitude=row["amplitude"], frequency=row["frequency"], phase=row["phase"])
    returns = [
        sb.evaluate(gait, fluid=fluid, engine="planar", physics_rate=90, duration=1.0).episode_return
        for fluid in ("water", "oil2")
    ]
    assert row["value"] == pytest.approx(np.mean(returns), rel=1e-12)


def test_each_winner_is_the_best_of_its_search(tried, winners):
    searched = winners[winners["variant"] == "searched"].groupby(["sampler", "objective", "seed"])["return"].mean()
    best = tried.groupby(["sampler", "objective", "seed"])["value"].max()
    assert len(best) == 4 * 3 * 2
    assert searched.to_dict() == pytest.approx(best.to_dict())


def test_winners_are_verified_in_the_shared_evaluator_in_every_fluid_of_their_objective(results, winners):
    variants = set(zip(winners["variant"], winners["engine"], winners["physics_rate"], strict=True))
    assert variants == {
        ("searched", "planar", 90),
        ("coarser step", "pybullet", 480),
        ("finer step", "pybullet", 960),
    }
    assert len(winners) == 3 * 4 * 2 * (1 + 1 + 2)  # variants, samplers, seeds, fluids of the objectives
    assert list(winners) == ["sampler", *read_table(results / "optima.csv")]


def test_the_plan_counts_the_comparison(results):
    swims = 2 * (1 + 1 + 2)  # seeds, fluids of the objectives
    assert read_manifest(results)["evaluations"] == swims * (16 + 4) + 4 * swims * (16 + 3)


def test_the_comparison_leaves_the_studys_own_search_as_it_is(results, tmp_path):
    alone = run_study(study_config(settings(compared=[])), tmp_path, workers=1)
    assert set(tables(alone)) == {"trials.csv", "optima.csv"}
    assert tables(alone).items() <= tables(results).items()


@pytest.mark.slow
def test_a_replay_from_the_cache_gives_the_same_bytes(results):
    before = tables(results)
    again = run_study(study_config(settings()), results.parent, workers=1)
    assert tables(again) == before
    assert read_manifest(again)["computed"] == 0


@pytest.mark.slow
def test_two_workers_give_the_same_bytes(results, tmp_path):
    assert tables(run_study(study_config(settings()), tmp_path, workers=2)) == tables(results)


@pytest.mark.parametrize("sampler", ALL)
def test_every_sampler_but_random_learns_from_what_it_is_told(sampler):
    def asked(worth):
        search = Search(sampler, seed=0, batch=4, space={"x": (0.0, 1.0), "y": (0.0, 1.0)})
        for _ in range(4):
            gaits = search.ask(4)
            search.tell([worth * gait["x"] for gait in gaits])
        return np.mean([gait["x"] for gait in search.ask(4)])

    if sampler == "random":
        assert asked(1.0) == asked(-1.0)
    else:
        assert asked(1.0) > asked(-1.0)


@pytest.mark.parametrize("sampler", ALL)
@pytest.mark.parametrize("batch", [1, 3])
def test_gaits_that_are_worth_nothing_do_not_stop_a_search(sampler, batch):
    search = Search(sampler, seed=0, batch=batch, space={"x": (0.0, 1.0), "y": (0.0, 1.0)})
    for trial in range(10):
        gaits = search.ask(batch)
        search.tell([None if trial % 2 else gait["x"] for gait in gaits])
    assert len(search.ask(batch)) == batch


def test_the_page_compares_the_samplers(results, tmp_path):
    compared = page_of(results)["compared"]
    assert [row[0] for row in compared["reached"].rows[-4:]] == [
        f"mean, {name}" for name in ("TPE", "random", "CMA-ES", "GP")
    ]
    assert compared["differences"].rows and compared["verified"].rows
    assert write_report(results, tmp_path).stat().st_size > 10_000


def test_the_page_of_a_study_that_compares_nothing_has_no_such_section(tmp_path):
    config = study_config(settings(compared=[], trials=2, batch=2, seeds=[0]))
    assert page_of(run_study(config, tmp_path / "results", workers=1))["compared"] is None


def test_with_one_seed_no_difference_is_tested(tmp_path):
    config = study_config(settings(compared=["cmaes", "tpe"], trials=2, batch=2, seeds=[3], fluids=["water"]))
    compared = page_of(run_study(config, tmp_path / "results", workers=1))["compared"]
    assert compared["differences"] is None
    assert set(cells(compared["reached"], "95 % interval").values()) == {"needs two seeds"}


def made_up(values):
    """Tables of searches in which a sampler's value at each gait is known, by sampler and seed."""
    tried = pd.DataFrame(
        {"sampler": sampler, "objective": "water", "seed": seed, "trial": trial, "value": value}
        for sampler, seeds in values.items()
        for seed, series in enumerate(seeds)
        for trial, value in enumerate(series)
    )
    found = tried.groupby(["sampler", "objective", "seed"], sort=False)["value"].max().rename("return").reset_index()
    rows = found.assign(speed=0.1, power=1.0, amplitude=0.5, frequency=0.5, phase=0.5)
    winners = pd.concat(rows.assign(variant=variant) for variant in ("searched", "coarser step", "finer step"))
    config = {"compared": list(values), "trials": 4, "batch": 2, "seeds": list(range(len(values["tpe"])))}
    costs = dict.fromkeys(("positive_power", "cost_of_transport", "positive_cost_of_transport"), 1.0)
    return comparison(Published(Path(), {"config": config}, {"samplers": tried, "winners": winners.assign(**costs)}))


def test_the_goal_is_a_share_of_the_way_from_a_random_gait_whatever_the_sign():
    # The first batches hold -10 and 0, median -5; the best is 5, so that 4.9 counts as there and 4.89 does not.
    shown = made_up({"tpe": [[-10, 0, 4.89, 5], [-10, 0, 4.9, 4.9]], "random": [[-10, 0, 0, 4.89], [-10, 0, 4.95, 1]]})
    rows = {row[0]: row[-2:] for row in shown["reached"].rows}
    assert rows["water, TPE"] == ["3.5", "2 of 2"]  # after 4 and 3
    assert rows["water, random"] == ["more than 4", "1 of 2"]


def test_gaits_that_failed_count_as_tried():
    shown = made_up({"random": [[0, 0, 1, 1], [0, 0, 1, 1]], "tpe": [[0, 0, None, 5], [0, 0, None, 5]]})
    assert cells(shown["reached"], "gaits until 99 %") == {"water, random": "more than 4", "water, TPE": "4"}


def test_the_paired_test_sees_a_difference_that_is_small_beside_the_spread_of_the_seeds():
    # Differences 1.0, 1.1, 0.9: mean 1, standard error 0.1 / sqrt(3), t = 17.32, p = 0.00332 with 2 degrees of freedom.
    shown = made_up({"tpe": [[0, 10.0], [0, 20.0], [0, 30.0]], "cmaes": [[0, 11.0], [0, 21.1], [0, 30.9]]})
    assert shown["differences"].rows == [["water, CMA-ES − TPE", "3", "+1", "+0.75 to +1.2", "0.0033", "0.0033"]]


def test_equal_searches_do_not_differ():
    shown = made_up({"tpe": [[0, 1.0], [0, 2.0]], "gp": [[0, 1.0], [0, 2.0]]})
    assert shown["differences"].rows[0][2:] == ["+0", "+0 to +0", "1", "1"]


def test_holm_raises_the_least_p_most_and_keeps_their_order():
    # 0.01 x 3, 0.02 x 2, and 0.03 x 1 raised to the one before it.
    assert holm(np.array([0.03, 0.01, 0.02])) == pytest.approx([0.04, 0.03, 0.04])
    assert holm(np.array([0.6, 0.9])) == pytest.approx([1.0, 1.0])


def test_an_unknown_sampler_is_refused_with_the_known_ones():
    with pytest.raises(InvalidValue, match=r"unknown sampler 'cma': did you mean cmaes\? allowed are tpe, random"):
        study_config(settings(compared=["tpe", "cma"]))


def test_a_sampler_named_twice_is_refused():
    with pytest.raises(InvalidValue, match=r"compared = .*values must differ from each other"):
        study_config(settings(compared=["tpe", "gp", "tpe"]))


def test_an_unstable_rate_of_the_comparison_is_refused_before_anything_is_run(tmp_path):
    with pytest.raises(InvalidValue, match="physics rate 60 Hz"):
        run_study(study_config(settings(compared_engine="pybullet", compared_rate=60)), tmp_path / "no", workers=1)
    assert not (tmp_path / "no").exists()


def test_gp_without_torch_is_refused_before_anything_is_run_with_the_command_that_installs_it(monkeypatch, tmp_path):
    monkeypatch.setitem(sys.modules, "torch", None)
    with pytest.raises(InvalidValue, match=r'needs torch: .*pip install .*"\.\[gp\]"') as caught:
        run_study(study_config(settings()), tmp_path / "no", workers=1)
    assert "\n" not in str(caught.value)
    assert not (tmp_path / "no").exists()


def test_other_samplers_need_no_torch(monkeypatch, tmp_path):
    monkeypatch.setitem(sys.modules, "torch", None)
    config = study_config(settings(compared=ALL[:3], trials=2, batch=2, seeds=[0], duration=0.5))
    assert (run_study(config, tmp_path, workers=1) / "winners.csv").exists()


def test_the_quickstart_compares_nothing_and_the_full_profile_all():
    assert study_config(study_settings(study_path("quickstart"))).compared == ()
    assert study_config(study_settings(study_path("sea_snake"), "full")).compared == tuple(SAMPLERS)
