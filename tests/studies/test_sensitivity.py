"""The sensitivity study and its page, end to end on a small budget."""

from __future__ import annotations

import shutil

import numpy as np
import pandas as pd
import pytest
from pages import cells, page_of
from writing import write_manifest, write_table

import snakebench as sb
import snakebench.studies
from snakebench.errors import InvalidValue
from snakebench.manifest import read_manifest
from snakebench.studies.config import study_path, study_settings
from snakebench.studies.running import run_study, study_config
from snakebench.studies.sensitivity.page import beyond, margin_table, margins
from snakebench.tables import read_table

FLUIDS = ["water", "oil2"]
SPACES = {"paper": {"amplitude": [1.0, 4.0], "frequency": [0.6, 0.8], "phase": [0.6, 1.0]}}
SMALL = {
    "fluids": FLUIDS,
    "duration": 3.0,
    "rates": [480, 960],
    "planar_rate": 120,
    "search_rate": 90,
    "grid": [2, 2, 2],
    "spaces": SPACES,
    "contenders": {"sea_snakes": "", "waveforms": ""},
    "robots": {"default": {}, "slim": {"diameter": 0.0686}, "five_joints": {"joints": 5}},
}


def config(**changes):
    return study_config(study_settings(study_path("sensitivity"), "smoke") | {"name": "sensitivity"} | SMALL | changes)


@pytest.fixture(scope="module")
def tables(results):
    return {name: read_table(results / f"{name}.csv") for name in ("swims", "fronts", "indicators", "contenders")}


@pytest.mark.parametrize(
    "changes, line",
    [
        ({"rates": [480, 1920]}, "rates: 960 Hz, the verify_rate, must be among them"),
        ({"robots": {"slim": {"diameter": 0.0686}}}, "robots: the study's own robot must be among them"),
    ],
)
def test_what_all_is_compared_with_must_be_there(changes, line):
    with pytest.raises(InvalidValue, match=line):
        config(**changes)


def test_everything_swims_where_the_robot_has_as_many_joints_and_the_step_is_stable(tables):
    policy, gait = tables["swims"].query("method == 'student'"), tables["swims"].query("method == 'paper'")
    steps = {(robot, engine, rate) for robot, engine, rate in policy[["robot", "engine", "physics_rate"]].to_numpy()}
    assert steps == {
        *((robot, "pybullet", rate) for robot in ("default", "slim") for rate in (480, 960)),
        *((robot, "planar", 120) for robot in ("default", "slim")),
    }
    assert ("slim", "pybullet", 480) in set(map(tuple, gait[["robot", "engine", "physics_rate"]].to_numpy()))
    assert (
        tables["swims"].groupby(["method", "tuned_to", "robot", "engine", "physics_rate"])["fluid"].nunique() == 2
    ).all()


def test_a_swim_on_another_robot_is_that_of_the_published_policy(results, tables):
    row = tables["swims"].query("method == 'student' and robot == 'slim' and physics_rate == 960 and fluid == 'oil2'")
    policy = sb.Policy.load(results.parent / "teacher_student" / "policies" / "student-0.safetensors")
    slim = sb.Robot(diameter=0.0686)
    again = sb.evaluate(policy, fluid="oil2", robot=slim, physics_rate=960, duration=3.0)
    assert (row["speed"].iloc[0], row["power"].iloc[0]) == (again.speed, again.power)


def test_the_default_robots_fronts_are_those_of_the_pareto_study_with_the_same_grid(results, tables):
    same = {name: SMALL[name] for name in ("fluids", "duration", "grid", "spaces")}
    settings = study_settings(study_path("pareto"), "smoke") | {"name": "pareto-alike", "search": "grid", "seeds": [0]}
    settings |= {"currencies": ["net"]}
    pareto = settings | same | {"engine": "planar", "physics_rate": 90, "periods": 6}
    directory = run_study(study_config(pareto), results.parent, workers=1)
    assert read_manifest(directory)["computed"] == 0  # all of it was evaluated by the sensitivity study
    for name in ("fronts", "indicators"):
        own = tables[name].query("robot == 'default'").drop(columns="robot").reset_index(drop=True)
        pd.testing.assert_frame_equal(own, read_table(directory / f"{name}.csv"), check_dtype=False)


def test_every_robot_has_its_own_fronts(tables):
    fronts = tables["fronts"]
    assert list(dict.fromkeys(fronts["robot"])) == ["default", "slim", "five_joints"]
    best = fronts.query("front == 'water' and robot == 'five_joints'").iloc[-1]
    gait = sb.SinusoidalTorque(**best[["amplitude", "frequency", "phase"]].to_dict())
    seconds = max(3.0, np.ceil(6 / gait.frequency))
    again = sb.evaluate(gait, fluid="water", robot=sb.Robot.with_joints(5), physics_rate=960, duration=seconds)
    assert (best["speed"], best["power"]) == pytest.approx((again.speed, again.power), rel=1e-5)  # six digits


def test_what_is_asked_for_never_exceeds_what_is_expected(counted, results):
    assert all(done <= total for done, total in counted)
    assert counted[-1][0] == counted[-1][1] == read_manifest(results)["evaluations"]


@pytest.mark.slow
def test_again_nothing_is_computed_and_all_bytes_are_equal(results):
    before = {path.name: path.read_bytes() for path in results.glob("*.csv")}
    again = run_study(config(), results.parent, workers=1)
    assert {path.name: path.read_bytes() for path in again.glob("*.csv")} == before
    assert read_manifest(again)["computed"] == 0


FRONTS = pd.DataFrame(
    [
        {"robot": "default", "space": "paper", "front": front, "speed": speed, "power": power}
        for front in ("water", "oil2", "integrated")
        for speed, power in ((0.1, 1.0), (0.2, 4.0))
    ]
)


def swims(*speeds_powers_frequencies):
    """A student's swims in water and in oil2, by seed."""
    numbers = [dict(zip(("speed", "power", "swim_frequency"), row, strict=True)) for row in speeds_powers_frequencies]
    labels = {"place": "here", "robot": "default", "method": "student", "tail_amplitude": 0.1, "torque_amplitude": 1.0}
    rows = [labels | {"seed": k // 2, "fluid": FLUIDS[k % 2]} | row for k, row in enumerate(numbers)]
    return pd.DataFrame(rows)


def margins_in(table, conclusion):
    found = margins(table, FRONTS, FLUIDS, ["student"])
    return found[found["conclusion"] == conclusion]["margin"].tolist()


def test_a_swim_is_compared_with_the_front_at_its_own_power():
    own = pd.DataFrame({"speed": [0.15, 0.15, 0.3, 0.3], "power": [3.9, 4.0, 0.5, np.nan]})
    found = beyond(FRONTS, own.assign(robot="default", fluid="water"))["margin"]
    np.testing.assert_allclose(found, [0.5, -0.25, np.inf, np.nan])


def test_every_swim_has_a_margin_over_the_front_of_its_fluid():
    table = swims((0.3, 4.0, 1.0), (0.25, 5.0, 0.5), (0.4, 4.0, 1.0), (0.3, 5.0, 0.8))
    assert sorted(margins_in(table, "faster-than-paper")) == pytest.approx([0.25, 0.5, 0.5, 1.0])


def test_a_trend_has_a_margin_for_every_seed():
    table = swims((0.1, 4.0, 0.5), (0.25, 5.0, 1.0), (0.4, 4.0, 1.0), (0.3, 5.0, 0.8))
    assert margins_in(table, "frequency-falls") == pytest.approx([-1.0, 0.2])


def test_one_gait_for_all_is_compared_with_the_means_over_the_fluids():
    table = swims((0.3, 6.0, 1.0), (0.2, 2.0, 0.5))  # 0.25 m/s at 4 W
    assert margins_in(table, "faster-than-paper-for-all") == pytest.approx([0.25])


def test_a_swim_that_failed_does_not_hold():
    table = margin_table(margins(swims((np.nan, np.nan, np.nan), (0.25, 5.0, 0.5)), FRONTS, FLUIDS, ["student"]))
    assert table.rows[0][1] == "1 of 2, least +25 %"


def test_policies_trained_anew_are_compared_with_the_headline(results, tables, tmp_path):
    assert page_of(results)["anew"].rows == []
    results = shutil.copytree(results, tmp_path / "sensitivity")
    own = tables["swims"].query("method == 'student' and seed == 0 and robot == 'default' and physics_rate == 960")
    anew = own.assign(variant="finer step", viscosity=1e-3, speed=2 * own["speed"])
    beside = results.parent / "relearned-smoke"
    beside.mkdir()
    parts = [anew.assign(policy=f"student_{name}", seed=seed) for name in ("slim", "15Hz") for seed in (0, 1)]
    write_table(beside / "evaluations.csv", pd.concat(parts).drop(columns=["method", "tuned_to", "robot"]))
    policies = {"student_slim": {"robot": {"diameter": 0.0686}}, "student_15Hz": {"control_rate": 15}}
    write_manifest(beside, {"fluids": {}, "config": {"method": "teacher_student", "policies": policies}})
    page = page_of(results)
    assert {"slim, retrained", "15 Hz, retrained"} <= set(page["margins"].head)
    assert cells(page["anew"], "change [%]")["student 15Hz, water"] == "100.0 ± 0.0"  # twice as fast


def test_a_page_is_made_of_what_is_there(results, tables):
    table = tables["swims"]
    lost = (table["method"] == "paper") & (table["robot"] == "slim")
    failed = table.assign(status=table["status"].mask(lost, "diverged"))
    for part in (failed, table[table["robot"] == "default"], table[table["method"] == "student"]):
        assert page_of(results, swims=part)["margins"].rows
    page = page_of(results, swims=table[table["tuned_to"] != "adaptive"])
    assert page["steps"].rows and not page["margins"].rows
