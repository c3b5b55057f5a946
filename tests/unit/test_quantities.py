"""Numbers of the report can be followed to rows of published tables."""

from __future__ import annotations

import pandas as pd
import pytest
from scipy import stats

from snakebench.comparison.gain_ledger import best_mean, change
from snakebench.comparison.quantities import Measurement, Missing, Results, combined, command_of
from snakebench.comparison.verdicts import above, ordered, verdict
from snakebench.store import write_manifest
from snakebench.tables import write_table

SPEEDS = pd.DataFrame(
    {"fluid": ["water", "water", "water", "oil1"], "seed": [0, 0, 1, 0], "speed": [0.1, 0.3, 0.4, 0.9]}
)


def of(*values: float) -> Measurement:
    return Measurement("a", "m/s", values, "study/table.csv", "all", "snakebench run-study study")


@pytest.fixture
def results(tmp_path):
    (tmp_path / "pareto").mkdir()
    write_table(tmp_path / "pareto" / "swims.csv", SPEEDS)
    write_manifest(tmp_path / "pareto", {"study": "pareto", "config": {}})
    return Results(tmp_path)


def test_a_quantity_has_one_value_a_seed_and_says_where_it_is_from(results):
    quantity = results.quantity("speed in water", "m/s", "pareto", "swims", "speed", fluid="water")
    assert quantity.values == pytest.approx((0.2, 0.4)) and quantity.mean == pytest.approx(0.3)
    assert quantity.row()["table"] == "pareto/swims.csv"
    assert quantity.row()["rows"] == "fluid = water: speed"
    assert quantity.row()["command"] == "snakebench run-study pareto"
    assert results.taken == [quantity]


def test_an_interval_is_students_t():
    low, high = of(1.0, 2.0, 4.0).interval
    half = stats.t.ppf(0.975, 2) * pd.Series([1.0, 2.0, 4.0]).sem()
    assert (low, high) == pytest.approx((7 / 3 - half, 7 / 3 + half))
    assert of(1.0).interval is None


@pytest.mark.parametrize(
    ("take", "said"),
    [
        (lambda r: r.table("fourier", "optima"), "fourier: no results; snakebench run-study fourier makes them"),
        (lambda r: r.table("pareto", "fronts"), "snakebench run-study pareto makes it"),
        (lambda r: r.quantity("a", "", "pareto", "swims", "power"), "no column 'Column not found: power'"),
        (lambda r: r.quantity("a", "", "pareto", "swims", "speed", robot="slim"), "no column 'robot'"),
        (lambda r: r.quantity("a", "", "pareto", "swims", "speed", fluid="tar"), "no rows with fluid = tar"),
    ],
)
def test_what_is_missing_is_named_with_the_command_that_makes_it(results, take, said):
    with pytest.raises(Missing) as error:
        take(results)
    assert said in str(error.value) and "snakebench run-study" in str(error.value)


def test_results_of_another_format_are_not_used(results):
    (results.root / "pareto" / "manifest.json").write_text('{"format": 99, "study": "pareto"}')
    with pytest.raises(Missing, match="format 99"):
        results.directory("pareto")


def test_the_published_profile_comes_before_a_smaller_one(results):
    (results.root / "pareto-quick").mkdir()
    write_manifest(results.root / "pareto-quick", {"study": "pareto-quick", "config": {}})
    assert results.directory("pareto").name == "pareto"
    (results.root / "pareto" / "manifest.json").unlink()
    assert results.directory("pareto").name == "pareto-quick"
    assert command_of("pareto-quick") == "snakebench run-study pareto --profile quick"


def test_numbers_are_combined_seed_by_seed():
    share = combined("share", {"own": of(1.0, 3.0), "teacher": of(2.0, 4.0)}, lambda a, b: a / b)
    assert share.values == (0.5, 0.75)
    assert combined("gain", {"own": of(1.0, 3.0), "front": of(2.0)}, lambda a, b: a - b).values == (-1.0, 1.0)


def test_paired_seeds_differ_by_their_differences_and_others_by_welch():
    before, after = of(1.0, 2.0, 3.0), of(1.5, 2.4, 3.6)
    center, low, high = change(before, after, paired=True)
    half = stats.t.ppf(0.975, 2) * pd.Series([0.5, 0.4, 0.6]).sem()
    assert (center, low, high) == pytest.approx((0.5, 0.5 - half, 0.5 + half))
    _, wide_low, wide_high = change(before, after)
    assert wide_low < low and wide_high > high
    assert change(of(1.0), of(2.0)) == (1.0, 1.0, 1.0)
    center, low, high = change(of(1.0), after)
    half = stats.t.ppf(0.975, 2) * pd.Series(after.values).sem()
    assert (center, low, high) == pytest.approx((1.5, 1.5 - half, 1.5 + half))


def test_switching_spends_the_mean_power_where_it_is_worth_most():
    water, oil = pd.DataFrame([(0.2, 1.0), (0.5, 5.0)]).to_numpy(), pd.DataFrame([(0.1, 1.0), (0.2, 5.0)]).to_numpy()
    assert best_mean([water, oil], 3.0) == pytest.approx(((0.5 + 0.1) / 2, 3.0))
    assert best_mean([water, oil], 5.0) == pytest.approx(((0.5 + 0.2) / 2, 5.0))
    assert best_mean([water, oil], 0.5).tolist() == [0.0, 0.0]


def test_a_verdict_asks_for_the_whole_interval():
    assert verdict([True, True]) == "reproduced"
    assert verdict([True, False]) == "in part"
    assert verdict([False, False]) == "not"
    assert above(of(1.0, 1.1, 1.2), 0.8) and not above(of(0.5, 1.0, 1.5), 0.8) and above(of(0.9), 0.8)
    assert ordered([of(1.0, 2.0), of(1.5, 2.5)]) and not ordered([of(1.0, 2.0), of(1.5, 1.9)])
