"""The validation study, the bench and their pages, end to end on a small budget."""

from __future__ import annotations

import re

import numpy as np
import pandas as pd
import pytest
from pages import page_of

import snakebench as sb
from snakebench import bench
from snakebench.errors import InvalidValue, SnakebenchError
from snakebench.manifest import read_manifest
from snakebench.site import write_report
from snakebench.studies.config import study_path, study_settings
from snakebench.studies.running import run_study, study_config
from snakebench.studies.validation.page import against_finest, errors, limits, observed_orders
from snakebench.tables import read_table


def config(**changes):
    return study_config(study_settings(study_path("validation"), "smoke") | changes)


@pytest.fixture(scope="module")
def results(tmp_path_factory):
    return run_study(config(), tmp_path_factory.mktemp("validation") / "results", workers=1)


def test_every_gait_swims_in_every_engine_at_every_stable_rate(results):
    runs = read_table(results / "runs.csv")
    assert runs["gait"].nunique() == 12 and set(runs["status"]) == {"ok"}
    counted = runs.groupby(["engine", "physics_rate"])["gait"].nunique().to_dict()
    expected = {("pybullet", 480): 12, ("pybullet", 960): 12, ("planar", 120): 12, ("planar", 480): 12}
    assert counted == expected


def test_rates_that_are_unstable_for_a_gait_are_left_out():
    from snakebench.studies.validation.run import _runs

    tried = {
        (about["drives"], about["engine"], about["physics_rate"])
        for about, _ in _runs(config(rates={"pybullet": [60, 90], "planar": [30, 60]}))
    }
    assert ("angle", "pybullet", 90) in tried and ("angle", "pybullet", 60) not in tried
    assert ("angle", "planar", 30) in tried and ("torque", "planar", 30) not in tried


def test_the_runs_are_the_evaluators(results):
    runs = read_table(results / "runs.csv")
    gait = config().gaits["calibration"]
    for row in runs[runs["gait"] == "calibration"].to_dict("records"):
        scenario = {"engine": row["engine"], "physics_rate": row["physics_rate"], "duration": 6.0}
        assert sb.evaluate(gait, **scenario).speed == row["speed"]


def test_the_order_and_the_ledger_of_each_engine_show_in_the_tables(results):
    order, adversaries = read_table(results / "order.csv"), read_table(results / "adversaries.csv")
    observed = observed_orders(order).groupby(["engine", "drives"])["observed"].median()
    assert observed["pybullet"].to_numpy() == pytest.approx(2, abs=0.1)
    assert observed["planar", "angle"] == pytest.approx(2, abs=0.2)
    assert observed["planar", "torque"] > 3
    gap = adversaries.set_index(["engine", "physics_rate"])["energy_gap"].abs()
    assert gap["planar", 240] < 0.01 and gap["pybullet", 960] < gap["pybullet", 480] < 0.05


def test_costs_are_measured_at_every_rate(results):
    costs, runs = (read_table(results / f"{name}.csv") for name in ("costs", "runs"))
    assert (costs["seconds_per_second"] > 0).all()
    timed, compared = (
        set(zip(table["engine"], table["drives"], table["physics_rate"], strict=True)) for table in (costs, runs)
    )
    assert timed == compared


def test_the_adversaries_are_those_of_the_ledger():
    from snakebench.studies.validation.run import _adversary

    assert np.array_equal(_adversary("alternating", 3, 2), [[-1, 1], [1, -1], [-1, 1]])
    assert set(np.unique(_adversary("bang-bang", 30, 7))) == {-1.0, 1.0}
    assert np.abs(_adversary("random", 300, 7)).max() <= 1 < 1.1 * np.abs(_adversary("random", 300, 7)).max()


def made_up_runs(bullet_error, planar_error):
    """Two swims whose speeds are (1 + error * (480 / rate)^2) times 0.1 and 0.2 m/s; powers and costs likewise."""
    rows = []
    for fluid, limit in (("water", 0.2), ("oil1", 0.1)):
        for engine, rate, error in (
            ("pybullet", 480, bullet_error),
            ("pybullet", 960, bullet_error / 4),
            ("planar", 120, planar_error),
            ("planar", 480, 0.0),
        ):
            value = limit * (1 + error)
            rows.append(
                {"gait": "g", "drives": "torque", "fluid": fluid, "engine": engine, "physics_rate": rate}
                | {"speed": value, "energy_gap": 0.0}
                | {f"{kind}{name}": 2 * value for kind in ("", "positive_") for name in ("power", "cost_of_transport")}
            )
    return pd.DataFrame(rows)


def test_errors_and_disagreement_are_against_the_reference():
    runs = made_up_runs(-0.06, 0.001)
    is_reference = (runs["engine"] == "planar") & (runs["physics_rate"] == 480)
    reference = runs[is_reference].set_index(["gait", "fluid"])
    of_speed = errors(runs[~is_reference], reference).groupby(["engine", "physics_rate"])["speed"].max()
    assert of_speed.to_dict() == pytest.approx(
        {("pybullet", 480): 0.06, ("pybullet", 960): 0.015, ("planar", 120): 0.001}
    )
    assert limits(runs, reference).abs().to_numpy().max() < 1e-12


def test_adversaries_are_held_against_planars_finest_rate():
    rows = [("planar", 120, 2.1, 0.3), ("planar", 960, 2.0, 0.0), ("pybullet", 480, 3.0, 0.4)]
    table = pd.DataFrame(
        {"adversary": "random", "fluid": "water", "engine": engine, "physics_rate": rate, "power": power}
        | {"positive_power": 4 - power, "end_x": end, "end_y": end * 0.75}
        for engine, rate, power, end in rows
    )
    found = against_finest(table)
    assert found["power_off"].tolist() == pytest.approx([0.05, 0.0, 0.5])
    assert found["positive_power_off"].tolist() == pytest.approx([0.05, 0.0, 0.5])
    assert found["displaced"].tolist() == pytest.approx([0.375, 0.0, 0.5])


def test_the_observed_order_is_that_of_the_errors():
    order = pd.DataFrame(
        {"gait": "g", "drives": "torque", "engine": "planar", "physics_rate": [60, 120, 360]}
        | {"error": [1.0, 1 / 16, 1 / 16 / 81]}
    )
    observed = observed_orders(order)
    assert observed["observed"].to_numpy() == pytest.approx([4, 4])


@pytest.fixture(scope="module")
def written(results, tmp_path_factory):
    return write_report(results, tmp_path_factory.mktemp("reports"))


def test_the_page_has_a_row_for_every_swim_and_no_undefined_number(results, written):
    page, text = page_of(results), re.sub('base64,[^"]+', "", written.read_text())
    assert len(page["agreement"].rows) == 12
    assert text.count("<svg") == 3 and "NaN" not in text and ">nan" not in text


def test_the_page_is_the_same_each_time(results, written, tmp_path):
    assert write_report(results, tmp_path).read_bytes() == written.read_bytes()


@pytest.mark.parametrize(
    ("changes", "complaint"),
    [
        ({"rates": {"bullet": [480]}}, "did you mean pybullet"),
        ({"rates": {"pybullet": [60, 480], "planar": [120]}}, "gait .*: .* two of at least \\d+ Hz"),
        ({"rates": {"pybullet": [480, 960], "planar": []}}, "rates"),
        ({"rates": {"pybullet": [480, 970], "planar": [120]}}, "multiple of control_rate 30"),
        ({"rates": {"pybullet": [480, 480], "planar": [120]}}, "differ from each other"),
        ({"reference_rate": 30}, "planar: at least 45 Hz is needed, such as 60"),
        ({"order_rates": {"pybullet": [480, 970]}}, "multiple of control_rate 30"),
        ({"order_rates": {"planar": [120]}}, r"order_rates.planar = \[120\]: two rates or more"),
        ({"order_reference_rate": 240}, "below order_reference_rate 240"),
        ({"order_rates": {}}, "order_rates"),
        ({"order_duration": 0.001}, "duration = 0.001"),
        ({"adversary_rates": {"pybullet": [60]}}, "at least 85 Hz is needed, such as 90"),
        ({"adversary_rates": {}}, "adversary_rates"),
        ({"adversaries": []}, "adversaries"),
        ({"adversaries": ["random", "random"]}, "differ from each other"),
        ({"adversaries": ["polite"]}, "adversaries"),
        ({"gaits": {}}, "gaits"),
        ({"gaits": {"five": {"kind": "replayed-torque", "period": 1.0, "torque": [[0.0] * 5] * 2}}}, "gait five"),
        ({"gaits": {"cow": {"kind": "sea-cow"}}}, "unknown gait 'sea-cow': did you mean sea-snake"),
        ({"fluids": ["watr"]}, "did you mean water"),
        ({"reference_rate": 0}, "reference_rate"),
        ({"colour": "red"}, "colour"),
    ],
)
def test_impossible_settings_are_refused_before_anything_is_run(tmp_path, monkeypatch, changes, complaint):
    monkeypatch.setattr("snakebench.studies.running.Evaluator", lambda *_: pytest.fail("something was run"))
    with pytest.raises((InvalidValue, SnakebenchError), match=complaint):
        run_study(config(**changes), tmp_path, 1)


@pytest.fixture(scope="module")
def benched(results):
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(bench, "_ROUNDS", 1)
        patch.setattr(bench, "_PIECE", 0.5)
        patch.setattr(bench, "compile_seconds", lambda: 20.0)
        return bench.run_bench(results.parent, 1)


def test_the_bench_times_every_workload_and_tells_its_error(benched):
    table = read_table(benched / "bench.csv")
    assert (table["simulated"] > 0).all() and (table["steps_per_second"] > 0).all()
    evaluator = table[table["workload"] == "evaluator"]
    assert evaluator["times_evaluator"].tolist() == [1.0, 1.0]
    planar = table[table["engine"] == "planar"]
    assert planar["speed_error"].max() < 0.002 and planar["power_error"].max() < 0.002
    assert (evaluator["speed_error"] < 0.01).all()
    angles = table[table["drives"] == "angle"]
    assert angles["control_steps_per_second"].to_numpy() == pytest.approx(30 * angles["simulated"])
    assert read_manifest(benched)["scaling"] is None


def test_the_bench_has_a_page(benched, tmp_path):
    assert write_report(benched, tmp_path).read_text().count("<svg") == 1


def test_sea_snake_runs_on_the_planar_engine_under_its_own_name(tmp_path):
    settings = study_settings(study_path("quickstart"), "smoke", engine="planar")
    directory = run_study(study_config(settings | {"fluids": ["water"], "duration": 2.0}), tmp_path, 1)
    assert directory.name == "quickstart-smoke-engine-planar"
    optima = read_table(directory / "optima.csv")
    assert set(optima["physics_rate"]) == {240, 480, 960}
