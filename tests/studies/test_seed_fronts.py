"""Fronts of free waveforms, seed by seed, and how they are compared with policies of several seeds."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from scipy import stats

from snakebench.report.conclusions import conclusions
from snakebench.report.equal_power import speeds_within
from snakebench.report.table import gain
from snakebench.studies.published import published
from snakebench.studies.published_fronts import standings
from snakebench.studies.seed_fronts import of_each_seed

COMMITTED = Path(__file__).parents[2] / "results"
OF_NET_POWER = "front == @front and currency == 'net'"


@pytest.fixture(scope="module")
def study():
    return published(COMMITTED / "fourier")


@pytest.fixture(scope="module")
def by_seed(study):
    return of_each_seed(study).tables


@pytest.mark.parametrize("front", ["water", "oil1", "oil2", "integrated"])
def test_the_front_of_all_seeds_is_the_best_of_the_fronts_of_each(study, by_seed, front):
    every = by_seed["fronts"].query(OF_NET_POWER)[["speed", "power"]].drop_duplicates().to_numpy()  # a common start
    union = study.tables["fronts"].query(OF_NET_POWER)[["speed", "power"]].to_numpy()
    beaten = [((every[:, 0] >= v) & (every[:, 1] <= p)).sum() > 1 for v, p in every]
    best = {tuple(point) for point, worse in zip(every, beaten, strict=True) if not worse}
    assert best == {tuple(point) for point in union}


@pytest.mark.parametrize("front", ["water", "oil1", "oil2", "integrated"])
def test_no_seed_attains_more_than_the_best_of_all(study, by_seed, front):
    points, powers = by_seed["fronts"].query(OF_NET_POWER), np.geomspace(1.0, 20.0, 9)
    best = speeds_within(study.tables["fronts"].query(OF_NET_POWER), powers, widest=1)
    own = [speeds_within(part, powers, widest=1) for _, part in points.groupby("seed")]
    assert len(own) == 3 and (np.nanmax(own, axis=0) <= best).all() and (np.nanmean(own, axis=0) < best).any()


def test_ideal_switching_combines_points_of_one_seed(by_seed):
    fronts = by_seed["fronts"].set_index(["currency", "seed", "front", "point"])["speed"]
    rows = by_seed["switching"].groupby(["currency", "seed"]).last().reset_index()
    assert len(rows) == 6
    for row in rows.itertuples():
        points = {fluid: getattr(row, f"{fluid}_point") for fluid in ("water", "oil1", "oil2")}
        members = [fronts[row.currency, row.seed, fluid, point] for fluid, point in points.items()]
        assert row.speed == pytest.approx(sum(members) / 3)


def test_a_study_of_other_gaits_has_no_seeds_to_tell_apart():
    sinusoids = published(COMMITTED / "pareto")
    assert of_each_seed(sinusoids) is sinusoids


def test_waveforms_stand_beside_policies_with_every_seed_and_sinusoids_with_one():
    points, worth, _ = standings(published(COMMITTED / "learned_front"))
    for table in (points, worth):
        seeds = table.groupby("method")["seed"].unique().map(set).to_dict()
        assert (
            seeds["free waveform"] == {0, 1, 2}
            and seeds["student"] == {10, 11, 12, 13, 14}
            and seeds["sinusoid"] == {0}
        )


OURS, THEIRS = [0.50, 0.60, 0.55], [0.10, 0.20]
PAIRS = pd.DataFrame(
    [{"seed": i, "seed_fixed": j, "gain": a - b} for i, a in enumerate(OURS, start=10) for j, b in enumerate(THEIRS)]
)


def half_of_welch() -> float:
    low, high = stats.ttest_ind(OURS, THEIRS, equal_var=False).confidence_interval()
    return float(high - low) / 2


def test_a_gain_over_every_seed_has_the_interval_of_both_sides():
    assert gain("gain", 1)(PAIRS) == f"40.0 ± {100 * half_of_welch():.1f}"


def test_a_mean_in_a_conclusion_has_it_too():
    text = str(conclusions('{{ gains().mean("gain", 4) }}', {"gains": PAIRS}, "a file"))
    assert f"0.4000 ± {half_of_welch():.4f}" in text


def test_over_one_front_a_gain_has_students_interval():
    alone = PAIRS[PAIRS["seed_fixed"] == 0]
    half = stats.t.ppf(0.975, 2) * pd.Series(OURS).sem()
    assert gain("gain", 1)(alone) == f"45.0 ± {100 * half:.1f}"
