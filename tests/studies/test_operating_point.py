"""The study of the paper's operating point and its page, end to end on a small budget."""

from __future__ import annotations

import shutil
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from pages import cells, page_of
from writing import write_manifest

import snakebench as sb
from snakebench.errors import InvalidValue
from snakebench.manifest import read_manifest
from snakebench.studies.config import study_path, study_settings
from snakebench.studies.operating_point.page import along_the_path, nearest_tails
from snakebench.studies.operating_point.preference import ROUNDS, Search, solve
from snakebench.studies.operating_point.tail import tail_amplitudes
from snakebench.studies.running import run_study, study_config
from snakebench.tables import read_table

PUBLISHED = Path(__file__).parents[2] / "results"
FLUIDS = ["water", "oil2"]
MASS, GRAVITY = 5.499, 9.80665  # of the paper's robot [kg], [m/s^2]


def config(**changes):
    settings = study_settings(study_path("operating_point"), "smoke")
    changed = {"name": "operating_point", "fluids": FLUIDS, "diameters": [0.10, 0.0686]}
    studies = {"policies": "learned_front", "sinusoids": "", "sea_snakes": "", "waveforms": ""}
    return study_config(settings | changed | {"contenders": studies} | changes)


def write_policy(results: Path, study: str, policy: Path) -> None:
    """Results of a study of policies that hold one policy."""
    directory = results / study
    (directory / "policies").mkdir(parents=True)
    shutil.copy(policy, directory / "policies" / "student-0.safetensors")
    write_manifest(directory, {"commit": "abc", "config": {"robot": sb.Robot().model_dump(mode="json")}})


@pytest.fixture(scope="module")
def run(tmp_path_factory, run_counted):
    results = tmp_path_factory.mktemp("operating_point")
    write_policy(results, "learned_front", PUBLISHED / "learned_front" / "policies" / "student-10.safetensors")
    return run_counted(config(), results)


@pytest.fixture(scope="module")
def points(results):
    return read_table(results / "points.csv")


@pytest.fixture(scope="module")
def matrix(results):
    return read_table(results / "matrix.csv")


class Law:
    """A policy whose power is `scale` / price; where it has none, it diverged."""

    def __init__(self, scale: float, price: float = 1.0, least: float = 0.0) -> None:
        self.scale, self.price, self.least = scale, price, least

    def at(self, price: float) -> Law:
        return Law(self.scale, price, self.least)


def solved(*laws: Law, power: float = 5.0):
    def evaluate(cases):
        tried = [case.controller for case in cases]
        return [SimpleNamespace(power=None if law.price < law.least else law.scale / law.price) for law in tried]

    searches = [Search(policy=law, scenario=None, power=power, prices=(0.01, 3.0)) for law in laws]
    return solve(searches, evaluate, 0.01)


def test_a_preference_is_solved_for_a_power_that_follows_a_known_law():
    for law, found in zip((0.5, 2.0), solved(Law(0.5), Law(2.0)), strict=True):
        assert found.match == "solved" and found.searches <= ROUNDS
        assert found.price == pytest.approx(law / 5.0, rel=0.011)


def test_out_of_range_the_nearest_end_is_taken_and_marked():
    weak, strong, good = solved(Law(0.01), Law(100.0), Law(1.0))  # at most 1 W; at least 33 W
    assert (weak.price, weak.match) == (pytest.approx(0.01), "below")
    assert (strong.price, strong.match) == (pytest.approx(3.0), "above")
    assert good.match == "solved"


def test_a_swim_that_diverges_takes_too_much():
    (found,) = solved(Law(2.0, least=0.05))  # at the low end of the range
    assert found.match == "solved" and found.price == pytest.approx(0.4, rel=0.011)


def test_a_search_ends_where_power_jumps_across_the_target():
    class Jump(Law):
        def at(self, price: float) -> Law:
            return Law(price * (10.0 if price < 0.2 else 2.0), price)  # 10 W, then 2 W

    (found,) = solved(Jump(1.0))
    assert found.match in ("below", "above") and found.searches <= ROUNDS


def test_the_power_asked_for_is_that_of_the_papers_speed_and_cost_of_transport(points):
    expected = {"water": 0.33 * MASS * GRAVITY * 0.51, "oil2": 0.85 * MASS * GRAVITY * 0.14}
    assert points.groupby("fluid")["target_power"].unique().map(list).to_dict() == {
        fluid: [pytest.approx(power)] for fluid, power in expected.items()
    }


def test_in_planar_every_solved_preference_takes_that_power(points):
    swims = points[(points["variant"] == "planar") & (points["match"] == "solved")]
    assert len(swims) >= 3
    assert (swims["power"] / swims["target_power"]).to_numpy() == pytest.approx(1.0, abs=0.01)


def test_a_row_is_what_the_policy_does_at_its_preference(results, points):
    row = points.query("fluid == 'oil2' and variant == 'finer step' and diameter == 0.0686").iloc[0]
    policy = sb.Policy.load(results.parent / "learned_front" / "policies" / "student-0.safetensors")
    place = {"fluid": "oil2", "physics_rate": 960, "duration": 5.0, "robot": sb.Robot(diameter=0.0686)}
    again = sb.evaluate(policy.at(row["preference"]), **place)
    assert (row["speed"], row["power"]) == (again.speed, again.power)


def test_policies_swim_at_both_rates_and_in_planar_and_replays_in_every_fluid(points, matrix):
    assert points.groupby(["diameter", "as_trained", "fluid", "engine", "physics_rate"]).size().to_dict() == {
        (diameter, diameter == 0.1, fluid, engine, rate): 1
        for diameter in (0.10, 0.0686)
        for fluid in FLUIDS
        for engine, rate in (("planar", 90), ("pybullet", 480), ("pybullet", 960))
    }
    assert matrix.groupby(["diameter", "gait_of", "fluid", "physics_rate"]).size().to_dict() == {
        (diameter, gait, fluid, rate): 1
        for diameter in (0.10, 0.0686)
        for gait in FLUIDS
        for fluid in FLUIDS
        for rate in (480, 960)
    }


def test_what_is_asked_for_never_exceeds_what_is_expected(counted, results):
    assert all(done <= total for done, total in counted)
    assert counted[-1][0] == counted[-1][1] == read_manifest(results)["evaluations"]


@pytest.mark.slow
def test_again_nothing_is_computed_and_all_bytes_are_equal(results):
    before = {path.name: path.read_bytes() for path in [*results.glob("*.csv"), *results.glob("trajectories/*")]}
    again = run_study(config(), results.parent, workers=1)
    assert {path.name: path.read_bytes() for path in [*again.glob("*.csv"), *again.glob("trajectories/*")]} == before
    assert read_manifest(again)["computed"] == 0


def waving(angle: float = 0.5, course: float = 0.0) -> sb.Trajectory:
    """A straight robot that moves at 0.3 m/s; its last link swings by an angle [rad] at 1 Hz."""
    swim = sb.simulate(sb.SeaSnake(amplitude=0.1, frequency=1.0, phase=0.1), engine="planar", duration=6.0)
    along = np.column_stack([0.3 * swim.time * np.cos(course), 0.3 * swim.time * np.sin(course)])
    joints = np.zeros_like(swim.joint_angle)
    joints[:, -1] = angle * np.sin(2 * np.pi * swim.time)
    head = np.column_stack([along, np.full_like(swim.time, course)])
    return replace(swim, head=head, joint_angle=joints, center=along)


@pytest.mark.parametrize("course", [0.0, 0.7])
def test_tip_and_last_link_swing_by_the_arc_of_their_distance_from_the_joint(course):
    found = tail_amplitudes(waving(course=course), sb.Scenario())
    swing = np.sin(0.5) * np.array([0.322, 2 * 0.322, 0.161, 2 * 0.161])
    assert list(found.values()) == pytest.approx(swing.tolist(), rel=1e-3)
    assert list(found) == ["tip_half", "tip_full", "link_half", "link_full"]


def test_a_run_that_diverged_has_no_tail_amplitude():
    assert set(tail_amplitudes(replace(waving(), diverged=True), sb.Scenario()).values()) == {None}


def test_the_nearest_diameter_is_that_of_the_smaller_of_the_largest_errors():
    rows = [
        {"diameter": 0.05, "fluid": "water", "tip_half": 0.447, "tip_full": 0.9},  # right in one fluid only
        {"diameter": 0.05, "fluid": "oil2", "tip_half": 0.125, "tip_full": 0.249},
        {"diameter": 0.10, "fluid": "water", "tip_half": 0.402, "tip_full": 0.8},  # 10 % too small in both
        {"diameter": 0.10, "fluid": "oil2", "tip_half": 0.224, "tip_full": 0.5},
    ]
    nearest = nearest_tails(pd.DataFrame(rows).assign(link_half=np.nan, link_full=np.nan)).set_index("definition")
    assert list(nearest.index) == ["tip_half", "tip_full"]  # of the others nothing is known
    assert nearest.loc["tip_half", ["diameter", "water", "oil2"]].tolist() == [0.10, 0.402, 0.224]
    assert nearest.loc["tip_half", "error"] == pytest.approx(0.1, abs=0.002)


def test_along_the_path_speed_and_costs_are_of_the_path():
    row = {"speed": -0.1, "path_speed": 0.2, "power": 3.0, "positive_power": 4.0}
    costs = {"cost_of_transport": np.nan, "positive_cost_of_transport": np.nan, "status": "ok"}
    found = along_the_path(pd.DataFrame([row | costs, row | costs | {"status": "diverged"}]), MASS * GRAVITY)
    assert found.loc[0, "speed"] == 0.2
    assert found.loc[0, "cost_of_transport"] == pytest.approx(3.0 / (MASS * GRAVITY * 0.2))
    assert found.loc[0, "positive_cost_of_transport"] == pytest.approx(4.0 / (MASS * GRAVITY * 0.2))
    assert found.loc[1, ["speed", "cost_of_transport"]].isna().all()


def test_the_page_has_the_papers_values_beside_and_names_what_was_not_solved(results, points):
    content = page_of(results)
    assert cells(content["points"], "v [m/s]")["paper's policy, oil2"] == "0.140"
    assert cells(content["points"], "f [Hz]")["paper's policy, water"] == "0.470"
    assert any("0.0686 m, not retrained" in row[0] for row in content["points"].rows)
    missed = points.assign(match=points["match"].mask(points["fluid"] == "oil2", "below"))
    listed = page_of(results, points=missed)["missed"]
    assert {(row["fluid"], row["match"]) for row in listed} >= {("oil2", "below")}


def test_the_page_is_made_where_no_swim_left_a_replay_or_all_diverged(results, points, matrix):
    assert page_of(results, matrix=matrix[:0])["home"].rows == []
    assert page_of(results, points=points.assign(status="diverged"))["failed"]["diverged"] == 2 * len(FLUIDS)


def test_other_fluids_are_refused_in_one_line():
    with pytest.raises(InvalidValue, match=r"fluids.*1e-3.*water, oil1, oil2 only") as error:
        config(fluids=["water", "1e-3"])
    assert "\n" not in str(error.value)


def test_a_policy_without_a_preference_is_refused_in_one_line(tmp_path):
    write_policy(tmp_path, "plain", PUBLISHED / "teacher_student" / "policies" / "student-10.safetensors")
    studies = {"policies": "plain", "sinusoids": "", "sea_snakes": "", "waveforms": ""}
    with pytest.raises(InvalidValue, match="student of plain has no preference: those of learned_front") as error:
        run_study(config(contenders=studies), tmp_path, workers=1)
    assert "\n" not in str(error.value)
