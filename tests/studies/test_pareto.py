"""The Pareto study from its settings to its page, with a budget of seconds."""

from __future__ import annotations

import base64
import gzip
import re
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

import snakebench as sb
from snakebench.errors import InvalidValue
from snakebench.names import CURRENCIES
from snakebench.report.equal_power import speeds_within
from snakebench.report.table import name_of
from snakebench.site import write_report
from snakebench.studies.config import study_path, study_settings
from snakebench.studies.fronts import front
from snakebench.studies.indicators import hypervolume
from snakebench.studies.pareto import run as pareto
from snakebench.studies.pareto.page import page
from snakebench.studies.published import published
from snakebench.studies.running import run_study, study_config
from snakebench.tables import read_table

SMOKE = study_settings(study_path("pareto"), "smoke", search="both")
SETTINGS = SMOKE | {
    "spaces": {name: SMOKE["spaces"][name] for name in ("paper", "extended")},
    "fluids": ["water", "5e-3,900"],
    "duration": 3.0,
    "reference": [0.0, 5.0],
}
GAIT = ["amplitude", "frequency", "phase"]


@pytest.fixture(scope="module")
def results(tmp_path_factory) -> Path:
    return run_study(study_config(SETTINGS), tmp_path_factory.mktemp("pareto"), 1)


@pytest.fixture(scope="module")
def shown(results) -> dict[str, Any]:
    """What the page shows."""
    return page(published(results))


@pytest.fixture(scope="module")
def tables(results) -> dict[str, pd.DataFrame]:
    return {path.stem: read_table(path) for path in results.glob("*.csv")}


def test_spaces_between_the_papers_and_the_wider_one_have_the_frequency_of_one_and_the_torque_of_the_other():
    paper, faster, stronger, extended = (SMOKE["spaces"][name] for name in ("paper", "faster", "stronger", "extended"))
    assert faster == paper | {"frequency": extended["frequency"]} == extended | {"amplitude": paper["amplitude"]}
    assert stronger == paper | {"amplitude": extended["amplitude"]} == extended | {"frequency": paper["frequency"]}


def test_the_grid_tries_every_gait_in_every_fluid(tables):
    counts = tables["grid"].groupby(["space", "fluid"], sort=False)[GAIT].nunique()
    assert (counts == 3).all(axis=None) and len(counts) == 2 * 2
    assert len(tables["grid"]) == 2 * 2 * 27


DIGITS = 1e-5  # tables have six


def test_a_slow_gait_swims_longer(tables):
    slow = tables["verified"][(tables["verified"]["frequency"] == 0.1)].iloc[0]
    gait = sb.SinusoidalTorque(**slow[GAIT].to_dict())
    medium = sb.named_fluid("water") if slow["fluid"] == "water" else sb.Fluid(kinematic_viscosity=5e-3, density=900.0)
    again = sb.evaluate(gait, fluid=medium, physics_rate=960, duration=10.0)
    assert slow["speed"] == pytest.approx(again.speed, rel=DIGITS)  # a period of 10 s, not the 3 s of the others


def test_published_points_are_the_verifying_engines(tables):
    points = tables["fronts"].dropna(subset="amplitude").query("front == 'water' and frequency > 0.4")[::3]
    assert len(points)
    for row in points.to_dict("records"):
        gait = sb.SinusoidalTorque(**{name: row[name] for name in GAIT})
        verified = sb.evaluate(gait, fluid="water", physics_rate=960, duration=3.0)
        searched = sb.evaluate(gait, fluid="water", engine="planar", physics_rate=90, duration=3.0)
        assert (row["speed"], row["power"]) == pytest.approx((verified.speed, verified.power), rel=DIGITS)
        assert row["speed_searched"] == pytest.approx(searched.speed, rel=DIGITS)
        assert row["power_searched"] == pytest.approx(searched.power, rel=DIGITS)


def test_fronts_are_mutually_non_dominated_by_the_power_of_their_currency_and_advance_on_it(tables):
    for (_, _, currency), part in tables["fronts"].groupby(["space", "front", "currency"]):
        points = part[["speed", CURRENCIES[currency]]].to_numpy()
        assert front(points).tolist() == list(range(len(points)))
        assert (points > 0).all()


def test_the_front_of_each_power_is_at_least_as_fast_at_it_as_that_of_the_other(tables):
    for _, part in tables["fronts"].groupby(["space", "front"]):
        for currency, power in CURRENCIES.items():
            own, other = part[part["currency"] == currency], part[part["currency"] != currency]
            at_others = speeds_within(own, other[power].to_numpy(), currency, widest=1)
            assert (at_others >= other["speed"]).all()


def test_each_space_has_every_front_in_both_currencies(tables):
    worth = tables["indicators"].set_index(["space", "currency", "front"])
    names = ["water", "5e-3,900", "integrated", "simple-sum"]
    spaces = [(space, currency) for space in ("paper", "extended") for currency in CURRENCIES]
    assert worth.index.tolist() == [(*of, name) for of in spaces for name in names]


def test_the_wider_space_dominates_more_than_the_narrower_one(tables):
    for (_, currency), part in tables["fronts"].groupby(["front", "currency"]):
        points = {space: own[["speed", CURRENCIES[currency]]].to_numpy() for space, own in part.groupby("space")}
        wider, narrower = (hypervolume(points[space], (0.0, 5.0), widest=1) for space in ("extended", "paper"))
        assert wider >= narrower


def test_switching_dominates_one_gait_for_all(tables):
    shared = tables["fronts"].query("front == 'integrated'")
    assert len(shared.groupby(["space", "currency"])) == 4
    for row in shared.to_dict("records"):
        power = CURRENCIES[row["currency"]]
        switched = tables["switching"].query("space == @row['space'] and currency == @row['currency']")
        better = (switched["speed"] >= row["speed"] - 1e-12) & (switched[power] <= row[power] + 1e-12)
        assert better.any()


def test_a_simple_sum_point_averages_the_points_that_it_names(tables):
    fronts = tables["fronts"].set_index(["space", "front", "currency", "point"])
    for row in tables["switching"][::7].to_dict("records"):
        places = ((row["space"], fluid, row["currency"], row[f"{fluid}_point"]) for fluid in ("water", "5e-3,900"))
        parts = [fronts.loc[place] for place in places]
        for name in ("speed", "power", "positive_power"):
            assert row[name] == pytest.approx(np.mean([part[name] for part in parts]))


def test_indicators_are_those_of_the_published_points(tables):
    for row in tables["indicators"].to_dict("records"):
        table = tables["switching"].assign(front="simple-sum") if row["front"] == "simple-sum" else tables["fronts"]
        part = table.query("space == @row['space'] and front == @row['front'] and currency == @row['currency']")
        power = CURRENCIES[row["currency"]]
        points = part[["speed", power]].to_numpy()
        assert row["hypervolume"] == pytest.approx(hypervolume(points, (0.0, 5.0)))
        assert row["points"] == len(points) and row["beyond"] == (points[:, 1] >= 5).sum()
        assert row["fastest_speed"] == points[:, 0].max()
        expected = speeds_within(part, np.array([3.0]), row["currency"])[0] if row[f"fastest_{power}"] >= 3 else np.nan
        assert row["speed_at_3_W"] == pytest.approx(expected, nan_ok=True)
        assert row[f"thriftiest_{power}"] / row["thriftiest_speed"] == pytest.approx(
            (points[:, 1] / points[:, 0]).min()
        )
        other = part.set_index("speed")["positive_power"]
        for name in ("fastest", "thriftiest"):
            assert row[f"{name}_positive_power"] == other[row[f"{name}_speed"]]


def test_growth_counts_every_simulation_and_never_falls(tables):
    searches = tables["growth"].groupby(["space", "objective", "currency", "method", "seed"])
    assert len(searches) == 2 * 3 * 2 * 2
    for (_, objective, _, method, _), part in searches:
        per_gait = 2 if objective == "integrated" else 1
        assert part["simulations"].is_monotonic_increasing
        assert part["simulations"].iloc[-1] == per_gait * (27 if method == "grid" else 4 * 2)
        assert part["hypervolume"].is_monotonic_increasing


@pytest.mark.parametrize("currency", CURRENCIES)
def test_the_grids_growth_ends_at_the_area_that_its_points_dominate(tables, currency):
    grid = tables["grid"].query("space == 'paper' and fluid == 'water' and status == 'ok' and speed > 0 and power > 0")
    growth = tables["growth"].query("space == 'paper' and objective == 'water' and method == 'grid'")
    last = growth[growth["currency"] == currency].iloc[-1]
    points = grid[["speed", CURRENCIES[currency]]].to_numpy()
    assert last["hypervolume"] == pytest.approx(hypervolume(points, (0.0, 5.0), widest=1))


def test_a_grid_is_swum_once_for_both_currencies_and_a_search_is_for_one():
    evaluations = {}
    for search in ("grid", "nsga2"):
        for currencies in (["net"], ["net", "positive"]):
            config = study_config(SETTINGS | {"search": search, "currencies": currencies, "duration": 1.0})
            planned = pareto.plan(config)
            evaluations[search, len(currencies)] = sum(
                load.times for load in planned if load.scenario.engine == "planar"
            )
    assert evaluations["grid", 1] == evaluations["grid", 2]
    assert 2 * evaluations["nsga2", 1] == evaluations["nsga2", 2]


@pytest.mark.parametrize("currency", CURRENCIES)
def test_fronts_of_one_currency_make_a_page(currency, tmp_path):
    settings = SETTINGS | {"search": "grid", "grid": [2, 3, 2], "currencies": [currency], "duration": 1.0}
    text = write_report(run_study(study_config(settings), tmp_path / "results", 1), tmp_path).read_text()
    assert ("positive power P+, what" in text) == (currency == "positive") != ("as in the paper" in text)


def test_more_than_a_hundred_characters_of_settings_are_named_by_a_digest():
    fluids = [f"1.{k:02}e-3,900" for k in range(9)]
    names = [study_settings(study_path("pareto"), "smoke", fluids=kinds)["name"] for kinds in (fluids, fluids[::-1])]
    assert re.fullmatch(r"pareto-smoke-fluids-1\.00e-3,900-.*1\.05e-3,900-[0-9a-f]{8}", names[0])
    assert names[0] != names[1] and max(map(len, names)) <= 100
    assert study_config(study_settings(study_path("pareto"), "smoke", fluids=fluids)).name == names[0]


@pytest.mark.slow
def test_neither_the_batches_of_a_grid_nor_the_workers_change_anything(tmp_path, monkeypatch):
    config = study_config(SETTINGS | {"grid": [2, 3, 2], "duration": 1.0})
    one = run_study(config, tmp_path / "one", 1)
    monkeypatch.setattr(pareto, "_BATCH", 10)
    two = run_study(config, tmp_path / "two", 2)
    first, second = ({path.name: path.read_bytes() for path in of.glob("*.csv")} for of in (one, two))
    assert len(first) > 3 and first == second


@pytest.mark.slow
def test_one_fluid_makes_one_front_and_pybullet_may_search(tmp_path):
    changes = {"fluids": ["oil1"], "engine": "pybullet", "physics_rate": 480, "search": "nsga2", "duration": 1.0}
    changes |= {"powers": [0.5, 2.0], "robot": sb.Robot(cover_mass=2.0)}
    directory = run_study(study_config(SETTINGS | changes), tmp_path, 1)
    assert set(read_table(directory / "fronts.csv")["front"]) == {"oil1"}
    assert not (directory / "grid.csv").exists()
    assert write_report(directory, tmp_path).stat().st_size > 10_000
    content = page(published(directory))
    assert not content["overall"] and content["attainment"] is not None and not content["searches"].rows
    assert content["powers"] == ["0.5", "2"] and content["equal_power"].head[1:] == ["0.5 W", "2 W", "fastest"]
    assert content["masses"] == pytest.approx([4.957 + 2.0, 4.957 + 0.542])  # of the links and the cover [kg]


def test_the_page_shows_how_many_points_of_each_front_the_reference_loses(tables, shown):
    indicators, (head, rows) = tables["indicators"], shown["front_table"]
    assert (indicators["beyond"] > 0).any()
    assert {row[0]: row[head.index("beyond")] for row in rows} == {
        f"{name_of(row.space)}, {row.front}" + ", P+" * (row.currency == "positive"): str(row.beyond)
        for row in indicators.itertuples()
    }


def test_the_named_gaits_are_those_of_the_fronts(tables, shown):
    head, rows = shown["gaits"]
    fastest = tables["fronts"].query("space == 'paper' and front == 'water' and currency == 'net'").iloc[-1]
    row = next(row for row in rows if row[0] == "sinusoid, water: fastest")
    labels = ["amplitude [N m]", "frequency [Hz]", "phase [rad]"]
    assert [row[head.index(label)] for label in labels] == [f"{fastest[name]:.2f}" for name in GAIT]
    assert row[head.index("steady")] == ("yes" if fastest["steady"] else "no")


def test_a_search_is_judged_by_what_it_reached_with_a_tenth_of_the_grids_simulations(tables, shown):
    searches = shown["findings"]["searches"].set_index(["space", "objective", "currency"])
    growth = tables["growth"].query("space == 'paper' and objective == 'water' and currency == 'positive'")
    grid, nsga2 = (growth[growth["method"] == name] for name in ("grid", "nsga2"))
    early = nsga2[nsga2["simulations"] <= 2.7]["hypervolume"].max()  # of 27 of the grid
    whole = grid["hypervolume"].max()
    assert searches.loc[("paper", "water", "positive"), "share"] == pytest.approx(100 * early / whole, nan_ok=True)
    reached = nsga2[nsga2["hypervolume"] >= 0.99 * whole]["simulations"].min()
    assert searches.loc[("paper", "water", "positive"), "simulations"] == pytest.approx(reached, nan_ok=True)


def test_tables_can_be_saved_from_the_page(results, tmp_path):
    text = write_report(results, tmp_path).read_text()
    link = r'download="pareto-smoke-search-both-(\w+).csv.gz" href="data:application/gzip;base64,([^"]+)"'
    saved = dict(re.findall(link, text))
    assert set(saved) == {path.stem for path in results.glob("*.csv")} >= {"fronts", "switching", "indicators"}
    for name, content in saved.items():
        assert gzip.decompress(base64.b64decode(content)) == (results / f"{name}.csv").read_bytes()


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"grid": [0, 3, 3]}, "grid.0 = 0"),
        ({"grid": [3, 3]}, "grid"),
        ({"population": 1}, "population = 1"),
        ({"generations": 0}, "generations = 0"),
        ({"spaces": {}}, "spaces"),
        ({"spaces": {"own": {"amplitude": [2.0, 1.0]}}}, "first bound must be below"),
        ({"spaces": {"own": {"depth": [1.0, 2.0]}}}, "unknown parameter 'depth'"),
        ({"reference": [0.0, 0.0]}, "reference.1 = 0.0"),
        ({"fluids": []}, "fluids"),
        ({"fluids": ["water", "1.14e-6,999"]}, "values must differ"),
        ({"fluids": ["honey"]}, "unknown fluid 'honey'"),
        ({"fluids": ["1e-3,"]}, "unknown fluid '1e-3,'"),
        ({"fluids": ["-1"]}, "kinematic_viscosity = -1"),
        ({"verify_rate": 961}, "verify_rate = 961: Input should be a multiple of 2"),
        ({"search": "random"}, "search"),
        ({"currencies": []}, "currencies"),
        ({"currencies": ["net", "net"]}, "values must differ"),
        ({"currencies": ["gross"]}, "currencies.0 = 'gross'"),
    ],
)
def test_wrong_settings_are_refused_before_anything_is_run(changes, message):
    with pytest.raises(InvalidValue, match=re.escape(message)):
        study_config(SETTINGS | changes)


COMMITTED = Path(__file__).parents[2] / "results" / "pareto" / "fronts.csv"


@pytest.mark.slow
def test_what_was_searched_at_90_hz_is_near_the_limit_on_the_committed_fronts():
    fronts = read_table(COMMITTED)
    of_a_fluid = fronts[fronts["front"].isin(["water", "oil1", "oil2"]) & (fronts["power"] >= 0.01)]  # as drawn
    for row in of_a_fluid[::60].to_dict("records"):
        gait = sb.SinusoidalTorque(**{name: row[name] for name in GAIT})
        seconds = max(30.0, np.ceil(6 / gait.frequency))
        fine = sb.evaluate(gait, fluid=row["front"], engine="planar", physics_rate=480, duration=seconds)
        assert row["speed_searched"] == pytest.approx(fine.speed, rel=0.007)
        assert row["power_searched"] == pytest.approx(fine.power, rel=0.008)


@pytest.mark.slow
def test_sea_snake_gaits_have_fronts_too(tmp_path):
    settings = study_settings(study_path("sea_snake_front"), "smoke") | {"fluids": ["water", "oil1"], "duration": 3.0}
    results = run_study(study_config(settings), tmp_path / "results", 1)
    fronts = read_table(results / "fronts.csv")
    best = fronts[(fronts["front"] == "water") & (fronts["currency"] == "net")].iloc[-1]
    again = sb.evaluate(sb.SeaSnake(**best[GAIT].to_dict()), fluid="water", physics_rate=960, duration=3.0)
    assert (best["speed"], best["power"]) == pytest.approx((again.speed, again.power), rel=DIGITS)
    content = page(published(results))
    assert "amplitude [rad]" in content["gaits"].head and content["paper"] is None
