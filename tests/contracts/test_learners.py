"""Learners of other libraries: their policies are judged as they swim; vector rewards add up to the evaluator's."""

from __future__ import annotations

import warnings
from pathlib import Path

import gymnasium
import mo_gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from mo_gymnasium.wrappers import LinearReward, MORecordEpisodeStatistics
from sb3_contrib import RecurrentPPO
from stable_baselines3 import PPO
from torch import nn

import snakebench as sb
from snakebench.errors import InvalidValue
from snakebench.execution import evaluation_key
from snakebench.simulation import ClosedLoop

ROOT = Path(__file__).parents[2]
THICKENING = sb.FluidField(along="time", knots=(0.5, 1.5), fluids=(sb.named_fluid("water"), sb.named_fluid("oil2")))
QUICK = {"engine": "planar", "physics_rate": 90, "duration": 2.0}
ACTIONS = np.random.default_rng(3).uniform(-1.2, 1.2, (60, 7)).astype(np.float32)  # some beyond the bounds
HELD = sb.HeldTargets(rate=30, targets=tuple(map(tuple, np.clip(ACTIONS.astype(float), -1, 1).tolist())))


class Wave:
    """A policy without parameters: a wave of target angles that counts its steps in its state."""

    def predict(self, observation, state=None, episode_start=None, deterministic=False):
        step = 0 if state is None or episode_start[0] else state
        return 0.7 * np.sin(3.0 * step / 30 - 0.7 * np.arange(7)) + 0.1 * observation[:7], step + 1


def fresh(kind, feels, **settings):
    policy = "MultiInput" if feels is None else "Mlp"
    environment = sb.SwimEnv(**QUICK, feels=feels)
    if kind == "recurrent":
        return RecurrentPPO(f"{policy}LstmPolicy", environment, n_steps=8, seed=1, device="cpu", **settings)
    return PPO(f"{policy}Policy", environment, n_steps=8, batch_size=8, seed=1, device="cpu", **settings)


def rolled_out(model, environment):
    """The episode's return in the environment, and the last observation."""
    observation, info = environment.reset(seed=0)
    state, start, over = None, np.array([True]), False
    while not over:
        action, state = model.predict(observation, state=state, episode_start=start, deterministic=True)
        observation, _, terminated, truncated, info = environment.step(action)
        start, over = np.array([False]), terminated or truncated
    return info["return"], observation


@pytest.mark.parametrize("engine", [{"engine": "pybullet", "physics_rate": 480}, QUICK], ids=["pybullet", "planar"])
@pytest.mark.parametrize("feels", [None, ("sensors",), ("privileged", "joint angle", "preference")])
@pytest.mark.parametrize("kind", ["plain", "recurrent"])
def test_a_prediction_swims_in_the_evaluator_as_in_the_environment_to_the_last_bit(engine, feels, kind):
    model, here = fresh(kind, feels), QUICK | engine
    earned, _ = rolled_out(model, sb.SwimEnv(fluid=THICKENING, feels=feels, **here))
    predictor = sb.Predictor(model, feels)
    assert isinstance(predictor, ClosedLoop)
    assert sb.evaluate(predictor, fluid=THICKENING, **here).episode_return == earned
    assert sb.evaluate(predictor, fluid=THICKENING, **here).episode_return == earned  # nothing is remembered


def test_the_price_that_an_environment_charges_is_observed_by_the_predictor():
    model = fresh("plain", ("sensors", "preference"))
    earned, _ = rolled_out(model, sb.SwimEnv(fluid="oil1", price=0.5, feels=("sensors", "preference"), **QUICK))
    dear, published = (
        sb.evaluate(sb.Predictor(model, ("sensors", "preference"), **price), fluid="oil1", **QUICK).episode_return
        for price in ({"price": 0.5}, {})
    )
    assert dear == earned != published


def test_named_groups_are_observed_as_one_array_in_their_order():
    whole, _ = sb.SwimEnv(fluid="oil1", **QUICK).reset()
    felt, _ = sb.SwimEnv(fluid="oil1", feels=["privileged", "sensors"], **QUICK).reset()
    np.testing.assert_array_equal(felt, np.concatenate([whole["sensors"], whole["privileged"]]))
    check_env(gymnasium.make("snakebench/Swim-v0", feels=["sensors"], **QUICK).unwrapped)
    with pytest.raises(InvalidValue, match="did you mean sensors"):
        sb.SwimEnv(feels=["sensor"], **QUICK)


def test_a_predictor_is_keyed_by_its_parameters_its_layers_and_what_it_feels():
    scenario = sb.Scenario(**QUICK)
    model, other = fresh("plain", ("sensors",)), fresh("plain", ("sensors",))
    key = evaluation_key(sb.Predictor(model, ("sensors",)), scenario)
    assert evaluation_key(sb.Predictor(other, ("sensors",)), scenario) == key  # of the same seed
    other.learn(8)
    bent = fresh("plain", ("sensors",), policy_kwargs={"activation_fn": nn.ReLU})
    keys = {
        key,
        evaluation_key(sb.Predictor(other, ("sensors",)), scenario),
        evaluation_key(sb.Predictor(bent, ("sensors",)), scenario),
        evaluation_key(sb.Predictor(model, ("sensors",), name="trained longer"), scenario),
        evaluation_key(sb.Predictor(model, ("sensors",), price=0.5), scenario),
    }
    assert len(keys) == 5


def test_a_model_without_parameters_needs_a_name_and_swims_with_one():
    with pytest.raises(InvalidValue, match="a name is needed"):
        sb.Predictor(Wave(), ["sensors"])
    wave = sb.Predictor(Wave(), ["sensors"], name="wave 1")
    assert wave.digest() != sb.Predictor(Wave(), ["sensors"], name="wave 2").digest()
    earned, _ = rolled_out(Wave(), sb.SwimEnv(fluid="water", feels=["sensors"], **QUICK))
    assert sb.evaluate(wave, fluid="water", **QUICK).episode_return == earned


def test_a_predictor_that_does_not_fit_is_refused_in_a_line():
    model = fresh("plain", ("sensors",))
    with pytest.raises(InvalidValue, match="35 numbers, the model observes 31"):
        sb.Predictor(model, ("sensors", "privileged"))
    with pytest.raises(InvalidValue, match="unknown observation 'sensor'"):
        sb.Predictor(model, ("sensor",))
    with pytest.raises(InvalidValue, match="made for 7 joints at 30 Hz, the robot has 7 at 15 Hz"):
        sb.evaluate(sb.Predictor(model, ("sensors",)), control_rate=15, engine="planar", duration=1.0)

    class Short(Wave):
        def predict(self, *args, **settings):
            return np.zeros(6), None

    with pytest.raises(InvalidValue, match=r"angles of shape \(6,\): \(7,\) is needed"):
        sb.evaluate(sb.Predictor(Short(), ["sensors"], name="short"), **QUICK)


@pytest.mark.parametrize("engine", [{"engine": "pybullet", "physics_rate": 480}, QUICK], ids=["pybullet", "planar"])
def test_vector_rewards_add_up_to_the_way_and_the_energy_of_the_evaluators_trajectory(engine):
    here = QUICK | engine
    environment = mo_gymnasium.make("snakebench/MO-Swim-v0", fluid=THICKENING, **here)
    environment.reset(seed=0)
    steps = [environment.step(action) for action in ACTIONS]
    total = np.sum([reward for _, reward, *_ in steps], axis=0)
    run = sb.simulate(HELD, fluid=THICKENING, **here)
    np.testing.assert_allclose(
        total, [run.center[-1, 0] - run.center[0, 0], -run.command_work[-1]], rtol=1e-12, atol=1e-14
    )
    assert steps[-1][3] and not steps[-1][2]
    assert steps[-1][-1]["return"] == sb.evaluate(HELD, fluid=THICKENING, **here).episode_return


def test_the_published_weights_and_the_remaining_terms_make_the_scalar_reward():
    vector, scalar = (gymnasium.make(f"snakebench/{name}-v0", fluid="oil1", **QUICK) for name in ("MO-Swim", "Swim"))
    vector.reset()
    scalar.reset()
    run = sb.simulate(HELD, fluid="oil1", **QUICK)
    torque = np.zeros(7)
    for k, action in enumerate(ACTIONS):
        _, reward, _, _, info = vector.step(action)
        assert 10 * reward[0] + 0.005 * reward[1] + info["remaining"] == pytest.approx(
            scalar.step(action)[1], rel=1e-12
        )
        end, target = 3 * (k + 1), np.clip(action.astype(float), -1, 1)
        robot, q, dq = run.robot, run.joint_angle[end], run.joint_rate[end]
        now = applied(robot, target, q, dq)
        others = -0.08 * target @ target - 0.002 * dq @ dq - 0.02 * (now - torque) @ (now - torque)  # paper, w_2 to w_4
        assert info["remaining"] == pytest.approx(others / 30, rel=1e-9)
        torque = now


def applied(robot, target, angle, rate):
    """The torque that acts on the joints: the servo's, saturated, and what the passive joint adds."""
    from snakebench.physics.joints import torque_under

    return torque_under(robot, "angle", target[None], angle[None], rate[None])[0]


def test_mo_gymnasium_finds_its_convention_and_its_wrappers_work():
    environment = mo_gymnasium.make("snakebench/MO-Swim-v0", fluid="water", feels=["sensors"], **QUICK)
    assert environment.unwrapped.reward_space.shape == (2,) and environment.unwrapped.reward_dim == 2
    assert environment.spec is not None and environment.spec.id == "snakebench/MO-Swim-v0"
    recorded = MORecordEpisodeStatistics(environment, gamma=0.99)
    weighed = LinearReward(recorded, weight=np.array([10.0, 0.005]))
    weighed.reset(seed=0)
    total = np.zeros(2)
    for action in ACTIONS:
        _, reward, _, truncated, info = weighed.step(action)
        assert environment.unwrapped.reward_space.contains(info["vector_reward"])
        assert reward == pytest.approx(10 * info["vector_reward"][0] + 0.005 * info["vector_reward"][1], rel=1e-12)
        total += info["vector_reward"]
    assert truncated
    np.testing.assert_allclose(info["episode"]["r"], total, rtol=1e-5)  # MO-Gymnasium adds up in 32 bits


def test_all_but_the_shape_of_the_reward_passes_gymnasiums_checker():
    class Weighed(sb.MOSwimEnv):
        def step(self, action):
            observation, reward, *others = super().step(action)
            return observation, float(reward @ [10, 0.005]), *others

    with warnings.catch_warnings(action="ignore", category=UserWarning):  # that it is not registered
        check_env(Weighed(**QUICK), skip_render_check=True)


def test_vector_environments_of_mo_gymnasium_run_side_by_side():
    from mo_gymnasium.wrappers.vector import MOSyncVectorEnv

    def make():
        return mo_gymnasium.make("snakebench/MO-Swim-v0", feels=["sensors"], **QUICK)

    both = MOSyncVectorEnv([make, make])
    observations, _ = both.reset(seed=[0, 1])
    _, rewards, *_ = both.step(np.zeros((2, 7), np.float32))
    assert observations.shape == (2, 31) and rewards.shape == (2, 2)
    both.close()


def test_a_robot_that_diverges_pays_in_the_vector_what_it_pays_in_the_scalar_reward():
    settings = {"robot": sb.Robot(proportional_gain=3000.0, derivative_gain=0.0), "fluid": "water", "engine": "planar"}
    environment = sb.MOSwimEnv(**settings, physics_rate=240, duration=20.0)
    environment.reset(seed=0)
    rng, terminated, truncated = np.random.default_rng(0), False, False
    while not (terminated or truncated):
        _, reward, terminated, truncated, _ = environment.step(rng.choice([-1.0, 1.0], 7))
    assert terminated and reward @ [10, 0.005] == pytest.approx(-10_000 / 30) and reward[1] == 0


def test_a_vector_reward_has_no_price():
    with pytest.raises(InvalidValue, match="its weights are the learner's own"):
        sb.MOSwimEnv(price=0.5)
