"""Learning on perturbed robots: the environments do what the evaluator does, and a training can be continued."""

from __future__ import annotations

import numpy as np
import pytest

import snakebench as sb
from snakebench.engines import load_engine
from snakebench.errors import InvalidValue
from snakebench.learning.perturbed import PerturbedVecEnv
from snakebench.learning.perturbed_distillation import _Undeceived
from snakebench.learning.resume import learning_key
from snakebench.learning.rollouts import whole
from snakebench.learning.settings import Training
from snakebench.learning.training import _PolicyTeacher, train
from snakebench.studies.config import study_path, study_settings
from snakebench.studies.running import study_config

FIXED = {"delay": 1.0, "mass": 1.1, "servo_strength": 0.8, "normal_drag": 1.1, "viscous_drag": 0.9, "dead_joint": 3}
SAME = {name: (float(value), float(value)) for name, value in FIXED.items()}
WIDE = {"rate_noise": (0.0, 1.5), "delay": (0.0, 2.0), "jitter": (0.0, 1.0), "mass": (0.9, 1.1), "dropouts": (0.0, 1.0)}
ACTIONS = 0.6 * np.sin(0.15 * np.arange(60)[:, None] - 0.8 * np.arange(7))


class Replay:
    """A policy that repeats actions."""

    drives = "angle"

    def begin(self, robot, control_rate):
        rows = iter(ACTIONS)
        return lambda now, viscosity: next(rows)

    def digest(self) -> str:
        return "replay"


def training(ranges, **settings) -> Training:
    randomisation = {"perturbations": ranges, "viscosities": (1e-4, 1e-4)}
    return Training(**{"steps": 64, "members": 2, "randomisation": randomisation} | settings)


def replayed(scenario: sb.Scenario) -> sb.Trajectory:
    return sb.simulate(*sb.perturbed(Replay(), scenario, sb.Perturbations(**FIXED)))


def test_a_batch_of_perturbed_robots_swims_as_the_evaluators():
    environment = PerturbedVecEnv(2, training(SAME))
    environment.seed(0)
    environment.reset()
    angles = []
    for action in ACTIONS:
        groups, *_ = environment.step(np.tile(action, (2, 1)).astype(np.float32))
        angles.append(groups["sensors"][:, :7])
    where = training(SAME).scenario().but(fluid=sb.Fluid(kinematic_viscosity=1e-4), duration=2.0)
    swim = replayed(where)
    expected = swim.joint_angle[where.physics_rate // 30 :: where.physics_rate // 30]
    for member in (0, 1):
        assert np.allclose(np.array(angles)[:, member], expected, atol=1e-6)  # actions of 32 bits


@pytest.mark.parametrize("engine", ["planar", "pybullet"])
def test_the_environment_swims_as_the_evaluator(engine):
    settings = {"fluid": "oil1", "engine": engine, "physics_rate": 480, "duration": 2.0}
    environment = sb.SwimEnv(**settings, perturbations=SAME)
    environment.reset(seed=0)
    angles, info = [], {}
    for action in ACTIONS:
        observation, _, _, over, info = environment.step(action)
        angles.append(observation["sensors"][:7])
    swim = replayed(sb.Scenario(**settings))
    assert over
    assert np.allclose(angles, swim.joint_angle[16::16], atol=1e-6)
    assert info["speed"] == pytest.approx((swim.center[-1, 0] - swim.center[0, 0]) / 2.0, rel=1e-9)


def test_the_environment_without_ranges_is_as_before():
    usual, none = (
        sb.SwimEnv(engine="planar", duration=1.0, fluid="water", **more) for more in ({}, {"perturbations": {}})
    )
    for environment in (usual, none):
        environment.reset(seed=0)
    ends = [[environment.step(action)[4] for action in ACTIONS[:30]][-1] for environment in (usual, none)]
    assert ends[0] == ends[1]
    held = sb.HeldTargets(rate=30.0, targets=tuple(map(tuple, ACTIONS[:30].tolist())))
    assert ends[0]["return"] == sb.evaluate(held, "water", engine="planar", duration=1.0).episode_return


def test_each_episode_has_perturbations_of_its_own_which_the_seed_decides():
    def shown(seed: int) -> list[np.ndarray]:
        environment = sb.SwimEnv(engine="planar", duration=1.0, fluid="water", perturbations=WIDE)
        observations = [environment.reset(seed=seed)[0]]
        observations += [environment.step(action)[0] for action in ACTIONS[:29]]
        return [*observations, environment.reset()[0]]

    runs = [np.array([one["sensors"] for one in shown(seed)]) for seed in (1, 1, 2)]
    assert np.array_equal(runs[0], runs[1]) and not np.array_equal(runs[0], runs[2])
    assert not np.array_equal(runs[0][0], runs[0][-1])


def test_a_policy_observes_noisy_rates_within_their_bound_and_what_is_privileged_without():
    environment = PerturbedVecEnv(8, training({"rate_noise": (1.5, 1.5)}, members=8))
    environment.seed(0)
    environment.reset()
    for action in ACTIONS:
        groups, *_ = environment.step(np.tile(action, (8, 1)).astype(np.float32))
        true = environment._batch.now
        noise = groups["sensors"][:, 7:14] / 0.1 - true.joint_rate
        assert 0.5 < np.abs(noise).max() <= 1.5 + 1e-5
        assert np.allclose(groups["privileged"][:, 1], true.head_rate[:, 0], atol=1e-6)
        assert np.allclose(groups["sensors"][:, :7], true.joint_angle, atol=1e-6)


def torques(action: np.ndarray, sensors: np.ndarray) -> np.ndarray:
    """The torques [N m] that are observed with angles and rates, by the servos' nominal law (specification)."""
    robot = sb.Robot()
    angle, rate = sensors[..., :7], sensors[..., 7:14] / 0.1
    driven = robot.proportional_gain * (action - angle) - robot.derivative_gain * rate
    return driven - robot.joint_stiffness * angle - robot.joint_damping * rate


def test_the_observed_torque_is_computed_from_what_is_measured_and_none_at_the_start():
    noisy = {"rate_noise": (1.5, 1.5), "angle_noise": (0.01, 0.01)}
    batch, one = PerturbedVecEnv(4, training(noisy, members=4)), sb.SwimEnv(engine="planar", perturbations=noisy)
    batch.seed(0)
    assert not batch.reset()["sensors"][:, 14:21].any() and not one.reset(seed=0)[0]["sensors"][14:21].any()
    for action in ACTIONS:
        groups, *_ = batch.step(np.tile(action, (4, 1)).astype(np.float32))
        alone, *_ = one.step(action)
        for sensors in (*groups["sensors"][~batch.starts], alone["sensors"]):
            assert sensors[14:21] / 0.2 == pytest.approx(torques(action, sensors), abs=1e-4)
        difference = batch.truth()["sensors"][:, 14:21] - groups["sensors"][:, 14:21]
        assert np.abs(difference).max() > 0.01


def test_a_teacher_is_shown_its_robots_as_they_are(tmp_path):
    teacher = train(training({}, rollout=16, checkpoints=1, lstm=(), mlp=(8,)), 0, tmp_path / "teacher")
    environment = PerturbedVecEnv(2, training({"rate_noise": (1.5, 1.5)}))
    environment.seed(0)
    measured = whole(environment.reset())
    told = _Undeceived(_PolicyTeacher(teacher, 2), environment).labels(measured, environment.starts)
    undeceived, deceived = (
        _PolicyTeacher(teacher, 2).labels(observed, environment.starts)
        for observed in (whole(environment.truth()), measured)
    )
    assert np.array_equal(told, undeceived) and not np.array_equal(told, deceived)


def test_perturbed_members_go_on_from_a_saved_state():
    one, other = (PerturbedVecEnv(4, training(WIDE, members=4)) for _ in range(2))
    one.seed(3)
    one.reset()
    steps = [np.tile(action, (4, 1)).astype(np.float32) for action in ACTIONS]
    for action in steps[:20]:
        one.step(action)
    other.reset()
    other.restore(one.state())
    assert all(np.array_equal(a, b) for a, b in zip(one.observe().values(), other.observe().values(), strict=True))
    for action in steps[20:]:
        (here, reward, *_), (there, other_reward, *_) = one.step(action), other.step(action)
        assert all(np.array_equal(here[name], there[name]) for name in here)
        assert np.array_equal(reward, other_reward)


def test_a_tiny_training_ends_and_does_so_again_with_the_same_policy(tmp_path):
    settings = training(WIDE, members=4, rollout=16, checkpoints=1, lstm=(), mlp=(8,), duration=2.0)
    policies = [train(settings, 0, tmp_path / name).content() for name in ("one", "other")]
    assert policies[0] == policies[1]


def test_without_perturbations_the_key_of_a_training_is_as_if_there_were_no_such_setting():
    usual, none = Training(steps=1000), Training(steps=1000, randomisation={"perturbations": {}})
    assert "perturbations" not in usual.model_dump()["randomisation"]
    keys = [learning_key(settings, 0) for settings in (usual, none, training(WIDE), training(SAME))]
    assert keys[0] == keys[1] and len(set(keys)) == 3


def test_servos_that_need_it_learn_with_finer_steps():
    ranges = {"speed_limit": (5.0, 9.0), "mass": (0.9, 1.1), "servo_strength": (0.8, 1.2)}
    fine, usual = training(ranges).scenario(), training({}).scenario()
    assert usual.physics_rate == 90 < fine.physics_rate
    p = sb.Perturbations(speed_limit=5.0, mass=0.9, servo_strength=1.2)
    robot = sb.perturbed(Replay(), fine, p)[1].robot
    assert load_engine("planar").stable_rate(robot, "angle") <= fine.physics_rate


def test_the_robust_student_learns_what_the_study_of_robustness_sweeps():
    robust, robustness = (study_config(study_settings(study_path(name), "full")) for name in ("robust", "robustness"))
    nominal = {
        job.key: job.settings for job in study_config(study_settings(study_path("teacher_student"))).training_jobs()
    }
    for job in robust.training_jobs():
        if job.teacher:
            assert job.settings.randomisation.perturbations == robustness.ranges
        else:  # the same training, done once
            assert job.settings == nominal[job.key]
    assert robustness.robust == robust.name
    assert set(robustness.robust_pilots) == {job.name for job in robust.training_jobs() if job.teacher}


def test_an_unknown_perturbation_is_refused_in_one_line():
    with pytest.raises(InvalidValue, match="unknown perturbation 'wind'") as error:
        training({"wind": (0.0, 1.0)})
    assert "\n" not in str(error.value)
    with pytest.raises(InvalidValue, match="unknown perturbation 'wind'"):
        sb.SwimEnv(perturbations={"wind": (0.0, 1.0)})
