"""The study of robustness and its page, end to end on a small budget."""

from __future__ import annotations

import math
import shutil

import numpy as np
import pandas as pd
import pytest
from pages import page_of
from writing import write_manifest

import snakebench as sb
from snakebench.errors import InvalidValue
from snakebench.manifest import read_manifest
from snakebench.studies.config import study_path, study_settings
from snakebench.studies.contenders import contenders
from snakebench.studies.robustness.areas import areas, kept
from snakebench.studies.robustness.page import beside, least_table, of_unperturbed, ratios
from snakebench.studies.robustness.run import _swims, _targets
from snakebench.studies.running import run_study, study_config
from snakebench.tables import read_table

FLUIDS = ["water", "oil2"]
RANGES = {"mass": [0.9, 1.1], "delay": [0.0, 2.0], "rate_noise": [0.0, 1.5], "dead_joint": [0.0, 7.0]}
SMALL = {
    "fluids": FLUIDS,
    "duration": 3.0,
    "combinations": 2,
    "ranges": RANGES,
    "seeds": [0, 1],
    "contenders": {"sinusoids": "", "sea_snakes": "sea_snake", "waveforms": ""},
    "targets": {"heavy": {"perturbations": {"mass": 1.1}, "share": 0.8}, "unperturbed": {"share": 0.95}},
}


def config(**changes):
    return study_config(study_settings(study_path("robustness"), "smoke") | {"name": "robustness"} | SMALL | changes)


@pytest.fixture(scope="module")
def tables(results):
    return {
        name: read_table(results / f"{name}.csv") for name in ("sweeps", "combinations", "targets", "draws", "areas")
    }


def test_the_full_study_has_every_perturbation_with_eleven_values_and_fifty_combinations():
    full = study_config(study_settings(study_path("robustness"), "full"))
    assert set(full.ranges) == set(sb.Perturbations.model_fields) - {"seed"}
    assert full.steps >= 11 and full.combinations == 50
    assert (full.engine, full.verify, full.verify_rate) == ("planar", "pybullet", 960)


def test_the_full_study_asks_for_what_a_robust_policy_should_bear():
    full = study_config(study_settings(study_path("robustness"), "full"))
    together = {name: target.together() for name, target in full.targets.items()}
    joints = {name: p.dead_joint for name, p in together.items() if p.dead_joint}
    assert list(joints.values()) == [1, 2, 3, 4, 5, 6, 7] and {full.targets[name].share for name in joints} == {0.6}
    assert {full.targets[name].share for name in set(together) - set(joints) - {"unperturbed"}} == {0.8}
    assert not together["unperturbed"].active
    for name, names in {"noisy": ["angle_noise", "rate_noise", "gyro_noise"], "late": ["delay"]}.items():
        assert together[name].active == {one: full.ranges[one][1] for one in names}
    drag = ["pressure_drag", "viscous_drag", "normal_drag", "head_drag", "tail_drag"]
    for k, name in enumerate(("less_drag", "more_drag")):
        assert together[name].active == {one: full.ranges[one][k] for one in drag}


def test_a_target_is_a_swim_with_all_of_its_perturbations(tables):
    heavy = tables["sweeps"].query("perturbation == 'mass' and value == 1.1").drop(columns=["perturbation", "value"])
    own = tables["targets"].query("target == 'heavy'").drop(columns="target")
    pd.testing.assert_frame_equal(own.reset_index(drop=True), heavy.reset_index(drop=True))


def test_what_is_random_is_the_same_for_the_first_seeds_of_all(results):
    study = config(targets={"noisy": {"perturbations": {"start": 0.2, "rate_noise": 1.5}, "share": 0.8}})
    poses = {}
    for labels, case in _swims(study, contenders(study, results.parent), _targets(study), "planar"):
        poses.setdefault((labels["method"], labels["seed"]), set()).add(case.scenario.robot.pose)
    assert all(len(of_fluids) == 1 for of_fluids in poses.values())
    student, gait = (
        [pose for (name, _), pose in sorted(poses.items()) if name == of] for of in ("student", "sea_snake")
    )
    assert student[:1] == gait[:1] and student[0] != student[1]


def test_each_perturbation_is_swept_alone_from_its_smallest_to_its_largest_value(tables):
    values = tables["sweeps"].groupby("perturbation")["value"].unique().map(list).to_dict()
    assert values == {
        "none": [0.0],
        "mass": pytest.approx([0.9, 1.0, 1.1]),
        "delay": pytest.approx([0.0, 1.0, 2.0]),
        "rate_noise": pytest.approx([0.0, 0.75, 1.5]),
        "dead_joint": [0.0, 4.0, 7.0],
    }


def test_a_policy_swims_everywhere_and_a_gait_for_all_fluids_stands_for_its_kind(tables):
    places = tables["sweeps"].groupby(["method", "tuned_to"])["fluid"].unique().map(list).to_dict()
    assert places == {("student", "adaptive"): FLUIDS, ("sea_snake", "integrated"): FLUIDS}


def test_a_perturbed_mass_is_another_robots(tables, results):
    row = tables["sweeps"].query("method == 'student' and seed == 1 and perturbation == 'mass' and value == 1.1")
    policy = sb.Policy.load(results.parent / "teacher_student" / "policies" / "student-1.safetensors")
    usual = sb.Robot()
    heavy = usual.but(masses=tuple(1.1 * mass for mass in usual.masses), cover_mass=1.1 * usual.cover_mass)
    settings = {"engine": "planar", "physics_rate": 240, "duration": 3.0}
    again = [sb.evaluate(policy, fluid, robot=heavy, **settings).speed for fluid in row["fluid"]]
    assert row["speed"].tolist() == pytest.approx(again, rel=1e-12)


def test_combinations_are_drawn_within_their_ranges_and_no_joint_is_dead_in_them(tables):
    draws = tables["draws"]
    for name in set(RANGES) - {"dead_joint"}:
        assert draws[name].between(*RANGES[name]).all() and draws[name].nunique() == 2
    assert (draws["dead_joint"] == 0).all()
    assert set(tables["combinations"]["draw"]) == {0, 1}


def test_further_combinations_leave_the_first_ones_as_they_are(results, tables):
    more = run_study(config(name="more", combinations=3), results.parent, workers=1)
    pd.testing.assert_frame_equal(read_table(more / "draws.csv").iloc[:2], tables["draws"])


@pytest.mark.slow
def test_workers_do_not_change_the_result(results, tmp_path, write_contenders):
    again = run_study(config(), write_contenders(tmp_path), workers=2)
    for name in ("sweeps", "combinations", "targets", "draws", "areas"):
        assert (again / f"{name}.csv").read_bytes() == (results / f"{name}.csv").read_bytes()


def test_what_is_asked_for_never_exceeds_what_is_expected(counted, results):
    assert all(done <= total for done, total in counted)
    assert counted[-1][0] == counted[-1][1] == read_manifest(results)["evaluations"]


def made_up(**speeds):
    """Sweeps of a student in water: of each perturbation speeds at 0, 1, 3; the nominal speed is 0.5."""
    rows = [
        {"perturbation": name, "value": value, "speed": speed, "path_speed": 0.5, "power": 2.0, "positive_power": 3.0}
        for name, several in ({"none": [0.5]} | speeds).items()
        for value, speed in zip((0.0, 1.0, 3.0), several, strict=False)
    ]
    return pd.DataFrame(rows).assign(status="ok", method="student", tuned_to="adaptive", seed=0, fluid="water")


def test_the_area_of_a_straight_line_is_the_mean_of_its_ends():
    found = areas(made_up(falling=[0.5, 0.4, 0.2], steady=[0.5, 0.5, 0.5])).set_index("perturbation")
    assert found["speed"].to_dict() == pytest.approx({"falling": 0.7, "steady": 1.0})
    assert found["power"].tolist() == pytest.approx([1.0, 1.0])
    assert found.loc["steady", "course"] == pytest.approx(0.0)


def test_the_area_of_dead_joints_is_the_mean_over_the_joints():
    rows = areas(made_up(dead_joint=[0.5, 0.3, 0.1]))
    assert rows["speed"].iloc[0] == pytest.approx((0.3 + 0.1) / 2 / 0.5)


def test_areas_of_each_seed_are_shares_of_its_own_swim():
    slow = made_up(falling=[0.5, 0.4, 0.2]).assign(seed=1)
    slow["speed"] /= 2
    both = areas(pd.concat([made_up(falling=[0.5, 0.5, 0.5]), slow]))
    assert both.set_index("seed")["speed"].to_dict() == pytest.approx({0: 1.0, 1: 0.7})


def test_speeds_are_shares_of_the_mean_of_another_policy_in_the_fluid():
    nominal = pd.DataFrame({"method": "b", "fluid": ["water", "water", "oil2"], "speed": [0.4, 0.6, 0.1]})
    swims = pd.DataFrame(
        {"fluid": ["water", "oil2", "water"], "speed": [0.4, 0.2, np.nan], "status": ["ok", "ok", "diverged"]}
    )
    assert of_unperturbed(swims, nominal, "b")["share"].tolist() == pytest.approx([0.8, 2.0, 0.0])
    assert of_unperturbed(swims, nominal, "c").empty


def test_the_course_is_the_angle_of_the_mean_velocity():
    swims = made_up(turned=[0.25])
    assert kept(swims, swims)["course"].iloc[-1] == pytest.approx(math.pi / 3)


def test_a_run_that_diverged_counts_as_no_speed():
    swims = made_up(wild=[0.5, 0.5, 0.5])
    swims.loc[swims["value"] == 3.0, ["status", "speed"]] = "diverged", None
    assert areas(swims)["speed"].iloc[0] == pytest.approx((1.0 * 1 + 0.5 * 2) / 3)


def test_two_policies_are_compared_by_their_speeds_and_a_run_that_is_not_valid_has_none():
    plain = pd.DataFrame(
        [("a", "water", 0.9), ("b", "water", 1.0), ("a", "oil2", 0.2), ("b", "oil2", 0.1)],
        columns=["method", "fluid", "speed"],
    )
    draws = [  # of each draw and fluid the speeds of a and of two seeds of b
        (0, "water", 0.8, (0.6, 0.8)),
        (0, "oil2", 0.1, (0.1, 0.3)),
        (1, "water", 0.5, (0.6, 0.6)),
        (1, "oil2", 0.1, (0.0, None)),
    ]
    rows = [
        (method, fluid, draw, math.nan if speed is None else speed, "diverged" if speed is None else "ok")
        for draw, fluid, ours, theirs in draws
        for method, speed in [("a", ours), *(("b", one) for one in theirs)]
    ]
    combinations = pd.DataFrame(rows, columns=["method", "fluid", "draw", "speed", "status"])
    table = beside(ratios(plain, combinations, "a", "b"))
    both = (0.8 + 0.5 + 0.1 / 0.1 + 0.1 / 0.1) / (0.7 + 0.6 + 0.2 / 0.1 + 0.0)
    assert table.rows == [
        ["water", "0.900", f"{1.3 / 1.3:.3f}", "1"],
        ["oil2", "2.000", f"{0.2 / 0.2:.3f}", "1"],
        ["all", "1.450", f"{both:.3f}", "1"],
    ]
    assert table.head[3] == "faster, of 2" and ratios(plain, combinations, "a", "c").empty


def test_the_least_speed_that_is_kept_is_shown_with_its_place():
    rows = [("mass", value, seed, speed) for seed in (0, 1) for value, speed in ((0.9, 0.7 + 0.2 * seed), (1.1, 0.9))]
    swept = pd.DataFrame(rows, columns=["perturbation", "value", "seed", "speed"]).assign(method="a", fluid="water")
    swept["course"] = np.radians(np.where(swept["value"] == 0.9, 20 + 10 * swept["seed"], 5))
    unknown = swept.assign(method="b", speed=np.nan)  # its unperturbed swim was not valid
    assert least_table(pd.concat([swept, unknown]), ["water"]).rows == [["mass, a", "0.800", "0.9", "25"]]


def test_the_page_has_a_picture_of_each_perturbation(results):
    shown = page_of(results)
    assert len(shown["pictures"]) == len(RANGES)
    assert all(picture.startswith("<svg") for picture in [*shown["pictures"].values(), shown["combinations"]])
    assert not shown["robust"]
    assert len(shown["areas"].rows) == 2 * len(RANGES)
    assert [row[:2] for row in shown["targets"].rows] == [
        [f"{target}, {name}", asked]
        for target, asked in (("heavy", "80"), ("unperturbed", "95"))
        for name in ("student", "sea snake")
    ]


def test_robust_policies_join_as_soon_as_there_are_some(tmp_path, write_contenders):
    results = write_contenders(tmp_path)
    robust = shutil.copytree(results / "teacher_student", results / "robust")
    (robust / "policies" / "student-0.safetensors").rename(robust / "policies" / "robust_student-0.safetensors")
    write_manifest(robust, {"commit": "abc", "config": {"robot": sb.Robot().model_dump(mode="json")}})
    small = {"seeds": [0], "combinations": 0, "ranges": {"mass": [0.9, 1.1]}, "robust": "robust"}
    directory = run_study(config(**small), results, workers=1)
    assert "robust_student" in set(read_table(directory / "sweeps.csv")["method"])
    assert page_of(directory)["robust"]


def test_robust_policies_have_names_of_their_own(tmp_path, write_contenders):
    results = write_contenders(tmp_path)
    shutil.copytree(results / "teacher_student", results / "robust")
    small = {"seeds": [0], "combinations": 0, "ranges": {"mass": [0.9, 1.1]}, "robust": "robust"}
    with pytest.raises(InvalidValue, match=r"\[contenders\]: student-0 is there twice"):
        run_study(config(**small, robust_pilots=["student"]), results, workers=1)


@pytest.mark.parametrize(
    "ranges, line",
    [
        ({"masses": [0.9, 1.1]}, "unknown perturbation 'masses'"),
        ({"mass": [1.1, 0.9]}, "an ascending range is needed"),
        ({"mass": [0.0, 1.1]}, "allowed are 0.1 to 10"),
        ({"mass": [1.1, 1.1]}, "a range of more than one value is needed"),
        ({"dead_joint": [0.0, 0.4]}, "a range of more than one value is needed"),
    ],
)
def test_bad_ranges_are_refused_in_one_line(ranges, line):
    with pytest.raises(InvalidValue, match=line) as error:
        config(ranges=ranges, alone=[])
    assert "\n" not in str(error.value)
