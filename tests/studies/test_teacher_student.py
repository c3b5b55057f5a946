"""The teacher-student study and its page, end to end on a small budget."""

from __future__ import annotations

import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from pages import cells, page_of

import snakebench as sb
import snakebench.learning.training as learning
from snakebench.errors import InvalidValue, StoreError
from snakebench.learning.resume import LearningFailed
from snakebench.learning.settings import VISCOSITIES, Distillation, Training
from snakebench.manifest import read_manifest
from snakebench.studies import training_jobs
from snakebench.studies.config import study_path, study_settings
from snakebench.studies.running import run_study, study_config
from snakebench.tables import read_table

ALONE = {"left_out": [], "only": ["teacher"], "published": [], "shown": []}
POLICIES = ["teacher", "symmetric", "student"]
FULL, ABLATED = [10, 11, 12, 13, 14], [10, 11, 12]  # seeds of the published policies


def settings(profile: str = "smoke", study: str = "teacher_student", **changes):
    small = {"duration": 1.0} if profile == "smoke" else {}
    return study_settings(study_path(study), profile) | small | changes


@pytest.fixture(scope="module")
def results(tmp_path_factory):
    return run_study(study_config(settings()), tmp_path_factory.mktemp("study") / "results", workers=2)


@pytest.fixture(scope="module")
def tables(results):
    return {name: read_table(results / f"{name}.csv") for name in ("curves", "evaluations", "range", "course", "steps")}


def outcome(directory):
    return {path.relative_to(directory): path.read_bytes() for path in directory.rglob("*.*") if path.suffix != ".json"}


def test_every_policy_is_evaluated_in_every_fluid_engine_and_viscosity(tables):
    evaluations = tables["evaluations"]
    assert evaluations.groupby("policy", sort=False).size().to_dict() == dict.fromkeys(POLICIES, 3 * 3)
    assert set(zip(evaluations["engine"], evaluations["physics_rate"], strict=True)) == {
        ("pybullet", 960),
        ("pybullet", 480),
        ("planar", 90),
    }
    assert sorted(set(tables["range"]["viscosity"])) == pytest.approx([1e-7, np.sqrt(1e-9), 1e-2])
    assert set(tables["range"]["physics_rate"]) == {960}


def test_published_policies_are_those_that_were_evaluated(results, tables):
    row = tables["evaluations"].set_index(["policy", "fluid", "variant"]).loc[("student", "oil1", "coarser step")]
    policy = sb.Policy.load(results / "policies" / "student-0.safetensors")
    again = sb.evaluate(policy, fluid="oil1", physics_rate=480, duration=1.0)
    assert (again.speed, again.power, again.episode_return) == (row["speed"], row["power"], row["return"])
    assert policy.card.origin == {"policy": "student", "seed": 0, "steps": 4 * 20 * 8}
    assert {path.name for path in (results / "policies").iterdir()} == {
        "teacher-0.safetensors",
        "symmetric-0.safetensors",
        "student-0.safetensors",
    }


def test_the_log_of_every_training_is_kept(tables):
    curves = tables["curves"]
    assert curves.groupby("policy").size().to_dict() == dict.fromkeys(POLICIES, 2)
    middle, end = curves[curves["policy"] == "teacher"]["steps"]
    rollout = 96 * 8
    assert 1000 <= middle < 1000 + rollout and 2000 <= end < 2000 + rollout
    assert curves[curves["policy"] == "student"]["error"].notna().all()


@pytest.mark.slow
def test_one_worker_gives_the_same_bytes_and_a_second_run_learns_nothing(results, tmp_path, monkeypatch):
    one = run_study(study_config(settings()), tmp_path, workers=1)
    assert outcome(one) == outcome(results)
    monkeypatch.setattr("snakebench.learning.training.ppo", lambda *_: pytest.fail("trained again"))
    monkeypatch.setattr("snakebench.learning.training.SwimVecEnv", lambda *_: pytest.fail("distilled again"))
    assert outcome(run_study(study_config(settings()), tmp_path, workers=1)) == outcome(results)
    assert read_manifest(one)["computed"] == 0


def test_a_failed_training_is_told_and_the_others_are_kept(tmp_path, monkeypatch):
    trained = learning.train

    def fail(training, seed, folder, origin):
        if origin["policy"] == "teacher":
            raise LearningFailed("numbers are not finite")
        return trained(training, seed, folder, origin)

    with monkeypatch.context() as patch:
        patch.setattr("snakebench.learning.training.train", fail)
        with pytest.raises(LearningFailed, match="teacher 0: numbers are not finite"):
            run_study(study_config(settings()), tmp_path, workers=1)
    assert not list((tmp_path / "teacher_student-smoke").glob("*.csv"))
    assert list((tmp_path / ".cache" / "training").glob("symmetric-0-*/policy.safetensors"))


def test_the_page_shows_policies_figures_and_servos(results):
    page = page_of(results)
    for name in ("main", "returns", "effort", "course", "servos", "seeds"):
        assert page[name].rows, name
    for name in ("learning", "distillation", "over_viscosity", "torques"):
        assert page[name].startswith("<svg"), name
    assert "student in oil2" in {swimmer["label"] for swimmer in page["swimmers"]}


def test_the_page_of_ablations_shows_what_they_are_compared_with(results):
    directory = run_study(study_config(settings(study="memory")), results.parent, workers=1)
    page = page_of(directory)
    assert list(cells(page["returns"], "n")) == ["memoryless teacher"]
    usual, own = (cells(page["usual"], "mean"), cells(page_of(results)["returns"], "mean"))
    assert list(own) == POLICIES and usual == {name: own[name] for name in ("teacher", "student", "symmetric")}
    assert page_of(results)["usual"] is None


def test_the_page_does_without_a_student(tmp_path):
    config = study_config(settings(only=["teacher"], published=[], shown=["teacher"]))
    page = page_of(run_study(config, tmp_path, workers=1))
    assert page["distillation"] is None
    assert list(cells(page["returns"], "mean share [%]").values()) == ["–"]
    assert "teacher in water" in {swimmer["label"] for swimmer in page["swimmers"]}


def test_settings_of_all_trainings_lie_under_those_of_each_policy():
    config = study_config(settings("full"))
    jobs = {job.key: job.settings for job in config.training_jobs()}
    teacher, student = jobs["teacher", 14], jobs["student", 14]
    assert isinstance(teacher, Training) and teacher.lstm == (128, 128) and teacher.steps == 2_000_000
    assert isinstance(student, Distillation) and student.teacher == "teacher" and student.feels == ("sensors",)
    symmetric = jobs["symmetric", 10]
    assert isinstance(symmetric, Training)
    assert symmetric.but(feels=teacher.feels, critic=teacher.critic, kl=teacher.kl).digest() == teacher.digest()


def jobs_of(study):
    """The training jobs of the published profile, by policy."""
    jobs = {}
    for job in study_config(settings("full", study)).training_jobs():
        jobs.setdefault(job.name, []).append(job)
    return jobs


@pytest.fixture(scope="module")
def full():
    """Those of the reported policies of the paper's reward; `teacher` is the same in two studies."""
    usual, ablations = jobs_of("teacher_student"), jobs_of("ablations")
    assert ablations.pop("teacher") == usual["teacher"]
    return usual | ablations | jobs_of("memory")


@pytest.mark.parametrize(
    ("ablation", "of", "changed", "seeds"),
    [
        ("limited_teacher", "teacher", ["robot"], ABLATED),
        ("limited_student", "student", ["robot", "teacher"], ABLATED),
        ("literal_student", "student", ["handover", "groups", "passes"], FULL),
        ("symmetric_long", "symmetric", ["steps"], ABLATED),
        ("memoryless_teacher", "teacher_short", ["lstm"], ABLATED),
    ],
)
def test_an_ablation_changes_one_thing_and_has_seeds_of_what_it_is_compared_with(full, ablation, of, changed, seeds):
    own, usual = full[ablation], full[of]
    assert [job.seed for job in own] == seeds and {job.seed for job in usual} >= set(seeds)
    kept = {name: getattr(usual[0].settings, name) for name in changed}
    assert own[0].settings != usual[0].settings and own[0].settings.but(**kept) == usual[0].settings
    assert own[0].settings.robot.torque_limit == (4.0 if "robot" in changed else None)


def test_the_long_symmetric_policy_takes_as_many_steps_as_teacher_and_student_together(full):
    assert (
        full["symmetric_long"][0].settings.all_steps
        == full["teacher"][0].settings.all_steps + full["student"][0].settings.all_steps
    )


def test_no_seed_of_a_candidate_is_reported(full):
    candidates, reported = ({job.seed for own in jobs.values() for job in own} for jobs in (jobs_of("tuning"), full))
    assert candidates == {0, 1, 2} and reported == set(FULL)


@pytest.mark.parametrize(("policy", "prefix"), [("symmetric", "kl_"), ("symmetric_short", "short_kl_")])
def test_a_chosen_policy_is_one_of_its_candidates(full, policy, prefix):
    candidates = [jobs[0].settings for name, jobs in jobs_of("tuning").items() if name.startswith(prefix)]
    chosen = full[policy][0].settings
    assert len(candidates) >= 3 and chosen in [candidate.but(steps=chosen.steps) for candidate in candidates]
    assert len({candidate.but(kl=0.1).digest() for candidate in candidates}) == 1


@pytest.mark.parametrize(("policy", "prefix"), [("symmetric", "kl_"), ("symmetric_short", "short_kl_")])
def test_the_candidate_of_the_highest_return_is_chosen(full, policy, prefix):
    ranged = read_table(Path(__file__).parents[2] / "results" / "tuning" / "range.csv")
    means = ranged[ranged["policy"].str.startswith(prefix)].groupby("policy")["return"].mean()
    assert jobs_of("tuning")[means.idxmax()][0].settings.kl == full[policy][0].settings.kl


def test_no_candidate_is_chosen_in_a_fluid_that_is_reported():
    config = study_config(settings("full", "tuning"))
    ranged = np.geomspace(*VISCOSITIES, config.viscosities)
    reported = [sb.named_fluid(name).kinematic_viscosity for name in config.fluids]
    assert np.abs(np.log(np.divide.outer(ranged, reported))).min() > 0.1


def test_long_learning_is_estimated_by_the_speed_of_this_machine(monkeypatch):
    small, full = (study_config(settings(profile)).training_jobs() for profile in ("smoke", "full"))
    monkeypatch.setattr(training_jobs, "_slowness", lambda: pytest.fail("measured for a short one"))
    usual = training_jobs.learning_seconds(small, 1)
    monkeypatch.setattr(training_jobs, "_slowness", lambda: 3.0)
    assert training_jobs.learning_seconds(small, 1) == usual < 10
    seconds = [training_jobs.learning_seconds(full, workers) for workers in (1, 2)]
    assert seconds[0] == pytest.approx(3 * sum(job.seconds for job in full)) and seconds[1] >= seconds[0] / 2


def test_what_one_study_learns_another_waits_for(tmp_path, monkeypatch):
    job, calls = study_config(settings()).training_jobs()[0], []

    def train(training, seed, folder, origin):
        calls.append("begun")
        time.sleep(0.5)
        (folder / "policy.safetensors").write_bytes(b"learned")
        calls.append("ended")

    monkeypatch.setattr("snakebench.learning.training.train", train)
    with ThreadPoolExecutor(2) as pool:
        assert list(pool.map(training_jobs._learn_one, [job] * 2, [None] * 2, [tmp_path] * 2)) == [None, None]
    assert calls == ["begun", "ended"]


def test_a_training_that_cannot_be_locked_is_told_in_a_line(tmp_path):
    (tmp_path / ".lock").mkdir()
    error = training_jobs._learn_one(study_config(settings()).training_jobs()[0], None, tmp_path)
    assert isinstance(error, StoreError) and "cannot lock" in str(error)


STUDENT = {"teacher": "teacher"}
CHAIN = {"teacher": {}, "student": STUDENT, "pupil": {"teacher": "student"}}
SLOW = {"teacher": {}, "student": STUDENT | {"control_rate": 15}}
WEAK = {"perturbations": {"speed_limit": [0.0, 15.0]}}


@pytest.mark.parametrize(
    ("changes", "match"),
    [
        ({"only": ["studnet"]}, "unknown policy 'studnet': did you mean student"),
        ({"only": ["student"]}, "its teacher 'teacher' is not learned with that seed"),
        ({"policies": {"teacher": {"step": 5}}, **ALONE}, "unknown field 'step'"),
        ({"policies": {"teacher": {"feels": ["sonar"]}}, **ALONE}, "unknown observation 'sonar'"),
        ({"policies": {"teacher": {"seeds": 3}}, **ALONE}, "policies.teacher.seeds = 3: a list of whole"),
        ({"policies": {"teacher": {"seeds": []}}, **ALONE}, r"policies.teacher.seeds = \[\]: a list of whole"),
        ({"policies": {"teacher": {"robot": {"wheels": 4}}}, **ALONE}, "unknown field 'wheels'"),
        ({"seeds": [1, 1]}, "values must differ"),
        ({"shown": ["nobody"]}, "unknown policy 'nobody'"),
        ({"shown": ["teacher-0"]}, "unknown policy 'teacher-0'"),
        ({"left_out": ["nobody-0"]}, "unknown policy 'nobody-0'"),
        ({"training": {"steps": 1, "kl": -1.0}}, "kl = -1.0"),
        ({"policies": {"teacher": {"propulsion": 5.0}}, **ALONE}, "propulsion = 5: it needs growth"),
        ({"policies": {"teacher": {"price_growth": 0.3}}, **ALONE}, "there are no randomisation.prices"),
        ({"policies": CHAIN, **ALONE | {"only": []}}, "its teacher 'student' imitates itself"),
        ({"policies": SLOW, **ALONE | {"only": []}}, "joints and control_rate must be its teacher's: 7, 30 Hz"),
        ({"policies": {"teacher": {"randomisation": WEAK}}, **ALONE}, "0 is no limit, begin the range above it"),
    ],
)
def test_settings_that_cannot_be_learned_are_refused_in_a_line(changes, match):
    with pytest.raises(InvalidValue, match=match) as refused:
        study_config(settings(**changes))
    assert "\n" not in str(refused.value)


def test_a_cluster_is_refused():
    with pytest.raises(InvalidValue, match="executor = dask: teacher_student learns on this machine"):
        run_study(study_config(settings()), None, workers=1, executor="dask")


def test_the_load_of_servos_is_shown_beside_the_limits_of_their_robot(tmp_path):
    limited = {"torque_limit": 4.0, "speed_limit": 6.5}
    policies = {"free": {"lstm": []}, "limited": {"lstm": [], "robot": limited}}
    config = study_config(settings(policies=policies, **ALONE | {"only": []}))
    directory = run_study(config, tmp_path, workers=1)
    needed = {"command_torque_rms": 2.0, "command_torque_peak": 4.0, "joint_speed_peak": 5.0, "heat": 20.0}
    seeds = [needed | {"command_torque_rms": 3.0, "joint_speed_peak": 7.0}, needed]
    row = read_table(directory / "evaluations.csv").query("variant == 'finer step' and fluid == 'water'").iloc[0]
    swims = [{**row, "policy": name, "seed": k} | seed for name in policies for k, seed in enumerate(seeds)]
    others = read_table(directory / "evaluations.csv").query("fluid != 'water' or variant != 'finer step'")
    page = page_of(directory, evaluations=pd.concat([pd.DataFrame(swims), others]))
    assert [row for row in page["servos"].rows if "water" in row[0]] == [
        [f"{name}, water", "2", "2.5", "4", "7", "20.0"] for name in policies
    ]
    assert cells(page["effort"], "limits") == {"free": "none", "limited": "up to 4 N m, up to 6.5 rad/s"}
