"""Evaluations are remembered once, in order, and their keys know everything that matters."""

from __future__ import annotations

import json
import os
import sys
import time
import warnings
from unittest.mock import Mock, call

import numpy as np
import pytest
from threadpoolctl import threadpool_info, threadpool_limits
from writing import write_manifest

import snakebench as sb
from snakebench import execution
from snakebench.errors import InvalidValue, StoreError
from snakebench.execution import Case, Evaluator, evaluation_key
from snakebench.manifest import read_manifest
from snakebench.store import EvaluationCache
from snakebench.studies.config import study_path, study_settings
from snakebench.studies.running import run_study, study_config
from snakebench.workers import answers_to, open_workers

GAITS = [sb.SeaSnake(amplitude=a, frequency=1.0, phase=0.7) for a in (0.2, 0.4, 0.6)]
HERE = sb.Scenario(duration=0.5)


def test_answers_come_in_the_order_of_the_cases_and_are_counted(tmp_path):
    cases = [Case(GAITS[i], HERE) for i in (2, 0, 1, 0)]
    with EvaluationCache(tmp_path) as cache, open_workers(1) as workers:
        evaluator = Evaluator(cache, workers)
        answers = evaluator(cases)
    assert answers == [sb.evaluate(*case) for case in cases]
    assert (evaluator.answered, evaluator.computed) == (4, 3)


def test_nothing_is_evaluated_twice(tmp_path, monkeypatch):
    with EvaluationCache(tmp_path) as cache, open_workers(1) as workers:
        first = Evaluator(cache, workers)([Case(GAITS[0], HERE)])
        monkeypatch.setattr("snakebench.execution.evaluate", lambda *case: pytest.fail("evaluated again"))
        assert Evaluator(cache, workers)([Case(GAITS[0], HERE)]) == first


def ran(swim, scenario, times):
    """What a study might measure of a swim."""
    return {"way": times * (swim.center[-1, 0] - swim.center[0, 0]), "nothing": float("nan"), "in": scenario.engine}


ran.__module__ = "snakebench.reward"  # whose code is a part of the key


def test_what_is_measured_of_a_swim_is_remembered_by_what_it_is_given(tmp_path, monkeypatch):
    asked = [(Case(gait, HERE), [times]) for gait in GAITS[:2] for times in (1.0, 2.0)]
    with EvaluationCache(tmp_path) as cache, open_workers(1) as workers:
        evaluator = Evaluator(cache, workers)
        first = evaluator.measured(ran, asked)
        assert str(evaluator.measured(ran, asked)) == str(first)
        assert (evaluator.answered, evaluator.computed) == (8, 4)
        assert first[1]["way"] == 2 * first[0]["way"] != first[3]["way"]
        monkeypatch.setattr("snakebench.execution._key", lambda case, *_: evaluation_key(*case))
        evaluator.measured(ran, asked[:1])
        assert evaluator.computed == 5  # code, name and what is given count


def test_what_another_version_measures_is_refused(tmp_path, monkeypatch):
    monkeypatch.setattr("snakebench.execution._answer", lambda *_: ("another key", "{}"))
    with EvaluationCache(tmp_path) as cache, open_workers(1) as workers, pytest.raises(StoreError, match="version"):
        Evaluator(cache, workers).measured(ran, [(Case(GAITS[0], HERE), [1.0])])


def test_a_swim_is_kept_and_made_again_when_its_file_is_damaged(tmp_path, monkeypatch):
    with EvaluationCache(tmp_path) as cache, open_workers(1) as workers:
        evaluator = Evaluator(cache, workers)
        first = evaluator.trajectory(Case(GAITS[0], HERE), HERE.physics_rate // 8).content()
        assert first == sb.simulate(GAITS[0], scenario=HERE).thinned(8).content()
        (path,) = (tmp_path / ".cache" / "swims").iterdir()
        path.write_bytes(path.read_bytes()[:100])
        assert evaluator.trajectory(Case(GAITS[0], HERE), HERE.physics_rate // 8).content() == first
        monkeypatch.setattr("snakebench.execution.simulate", lambda *_, **__: pytest.fail("simulated again"))
        assert evaluator.trajectory(Case(GAITS[0], HERE), HERE.physics_rate // 8).content() == first


@pytest.mark.slow
def test_workers_that_have_grown_by_much_are_replaced_without_a_word(tmp_path):
    def grow(megabytes):  # as importing PyTorch does
        sys.hoard = b"x" * (megabytes * 2**20)
        time.sleep(1.1)  # loky looks once a second
        return os.getpid()

    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        with EvaluationCache(tmp_path) as cache, open_workers(2) as workers:
            pids = list(Evaluator(cache, workers).compute(grow, [(1,), (1,), *[(400,)] * 6]))
    assert len(set(pids)) > 2
    assert not told


def threads(_):
    """How many threads this process gives to linear algebra."""
    return {one["num_threads"] for one in threadpool_info() if one["user_api"] == "blas"}


@pytest.mark.parametrize("workers", [1, 2])
def test_an_answer_has_one_thread_for_linear_algebra_so_that_its_last_digits_are_the_same(workers):
    with threadpool_limits(2, "blas"):
        assert threads(0) == {2}
        with open_workers(workers) as crew, answers_to(crew, threads, [(k,) for k in range(4)]) as answers:
            assert list(answers) == [{1}] * 4
        assert threads(0) == {2}


def test_a_study_says_when_the_cache_is_of_another_physics_and_does_not_use_it(tmp_path, monkeypatch, capsys):
    settings = study_settings(study_path("quickstart"), "smoke") | {"fluids": ["water"], "duration": 1.0}

    def computed() -> int:
        directory = run_study(study_config(settings), tmp_path, 1)
        return json.loads((directory / "manifest.json").read_text())["computed"]

    first = computed()
    assert first > 0 and computed() == 0
    assert "another version" not in capsys.readouterr().err
    monkeypatch.setattr("snakebench.engines.bullet.VERSION", "of another physics")
    assert computed() == first
    assert (
        "the cache is of another version of pybullet's physics, or of other metrics: it stays, unused"
        in capsys.readouterr().err
    )


def test_a_study_says_when_the_results_that_are_there_are_of_another_physics(tmp_path, capsys):
    settings = study_settings(study_path("quickstart"), "smoke") | {"fluids": ["water"], "duration": 1.0}
    directory = run_study(study_config(settings), tmp_path, 1)
    run_study(study_config(settings), tmp_path, 1)
    assert "another version" not in capsys.readouterr().err
    manifest = read_manifest(directory)
    del manifest["physics"]  # as version 1.0 wrote it
    write_manifest(directory, manifest | {"versions": manifest["versions"] | {"snakebench": "1.0.0"}})
    run_study(study_config(settings), tmp_path, 1)
    said = capsys.readouterr().err
    assert f"the results in {directory} are of snakebench 1.0.0 with another version of the physics" in said
    assert "reports read them until this run has evaluated everything again" in said
    assert set(read_manifest(directory)["physics"]) == {"pybullet"}


@pytest.mark.parametrize(
    "change",
    [
        {"fluid": "oil1"},
        {"fluid": sb.FluidField(along="x", knots=(0.0,), fluids=(sb.named_fluid("water"),))},
        {"robot": sb.Robot(diameter=0.07)},
        {"robot": sb.Robot(joint_damping=0.01)},
        {"physics_rate": 960},
        {"control_rate": 60},
        {"duration": 0.6},
    ],
)
def test_the_key_changes_with_the_scenario(change):
    fields = {name: getattr(HERE, name) for name in sb.Scenario.model_fields}
    assert evaluation_key(GAITS[0], sb.Scenario(**(fields | change))) != evaluation_key(GAITS[0], HERE)


def test_the_key_changes_with_the_gait_and_with_the_engine(monkeypatch):
    key = evaluation_key(GAITS[0], HERE)
    assert evaluation_key(GAITS[1], HERE) != key
    monkeypatch.setattr("snakebench.engines.bullet.VERSION", "another")
    assert evaluation_key(GAITS[0], HERE) != key


def test_a_fluid_given_by_name_or_by_value_is_one_scenario():
    water = sb.Fluid(kinematic_viscosity=1.14e-6, density=999.0)
    assert sb.Scenario(fluid="water").digest() == sb.Scenario(fluid=water).digest()


def test_settings_change_a_given_scenario():
    assert sb.simulate(GAITS[0], HERE, duration=0.2).time[-1] == pytest.approx(0.2)


@pytest.mark.parametrize(
    ("setting", "why"),
    [
        ({"scenario": "water"}, "scenario = 'water': a Scenario is needed"),
        ({"fluid": 3}, "fluid = 3: a Fluid"),
        ({"robot": "eel"}, "unknown robot 'eel'"),
        ({"control_rate": 0}, "control_rate = 0"),
        ({"engine": "planet"}, "unknown engine 'planet'"),
    ],
)
def test_impossible_scenarios_are_refused(setting, why):
    with pytest.raises(InvalidValue, match=why):
        sb.evaluate(GAITS[0], **setting)


def test_the_public_names_are_there():
    assert all(getattr(sb, name) is not None for name in sb.__all__)
    with pytest.raises(AttributeError):
        _ = sb.nonsense


def test_anything_that_commands_can_be_evaluated():
    class Paddle:
        """A gait from outside the package: only the last joint moves."""

        drives = "torque"

        def commands(self, times, n_joints):
            wave = np.zeros((len(times), n_joints))
            wave[:, -1] = 2.0 * np.sin(2 * np.pi * times)
            return wave

        def digest(self):
            return "paddle 1"

    evaluation = sb.evaluate(Paddle(), duration=10.0)
    assert evaluation.status == "ok" and evaluation.swim_frequency == pytest.approx(1.0, abs=0.01)


def test_only_a_long_compilation_is_announced(monkeypatch):
    timer, before, lines = Mock(), [], []
    monkeypatch.setattr(execution, "Timer", timer)
    monkeypatch.setattr(execution, "evaluate", lambda *_, **__: before.extend(timer.return_value.method_calls))
    execution.compile_engine("planar", lines.append)
    assert before == [call.start()] and timer.return_value.method_calls == [call.start(), call.cancel()]
    seconds, say, words = timer.call_args.args
    assert seconds == 2.0 and lines == []
    say(*words)
    assert lines == ["compiling the planar engine, some 20 s for this time only"]


@pytest.mark.parametrize("engine", ["pybullet", "planar"])
@pytest.mark.parametrize(("kind", "drives"), [("gait", "angles"), ("policy", "torque")])
def test_what_a_controller_drives_must_be_known(kind, drives, engine):
    class Gait:
        def commands(self, times, n_joints):
            return np.zeros((len(times), n_joints))

        def digest(self):
            return ""

    class Loop(Gait):
        def begin(self, robot, control_rate):
            return lambda now, viscosity: np.zeros(robot.n_joints)

    controller = Gait() if kind == "gait" else Loop()
    controller.drives = drives
    with pytest.raises(InvalidValue, match=f"drives = '{drives}': it drives angle"):
        sb.simulate(controller, engine=engine, duration=1.0)


@pytest.mark.parametrize("rate", [0, -30, 30.0, True])
def test_a_control_rate_that_is_no_whole_number_is_refused(rate):
    run = sb.simulate(GAITS[0], scenario=HERE)
    with pytest.raises(InvalidValue, match=r"control_rate = .*: a whole number from 1 is needed"):
        sb.measure(run, rate)


def test_paths_may_be_text(tmp_path):
    sb.simulate(GAITS[0], scenario=HERE).save(str(tmp_path / "run.npz"))
    assert sb.Trajectory.load(str(tmp_path / "run.npz")).rate == HERE.physics_rate
    with pytest.raises(InvalidValue, match=r"Robot: 7.5 joints: allowed are 2 to"):
        sb.Robot.with_joints(7.5)
