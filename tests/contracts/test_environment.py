"""The environments are the evaluator: same rewards, same return, nothing else observed than what is said."""

from __future__ import annotations

import subprocess
import sys

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env as check_by_gymnasium
from stable_baselines3.common.env_checker import check_env as check_by_sb3

import snakebench as sb
from snakebench.errors import InvalidValue
from snakebench.learning.environment import SwimEnv
from snakebench.learning.settings import Randomisation, Swimming
from snakebench.learning.vector import SwimVecEnv
from snakebench.observation import GROUPS, PRIVILEGED, SENSORS, columns

THICKENING = sb.FluidField(along="time", knots=(0.5, 1.5), fluids=(sb.named_fluid("water"), sb.named_fluid("oil2")))
AHEAD = sb.FluidField(along="x", knots=(-0.5, 0.5), fluids=(sb.named_fluid("oil2"), sb.named_fluid("water")))
RNG = np.random.default_rng(3)
ACTIONS = RNG.uniform(-1.2, 1.2, (60, 7)).astype(np.float32)  # some beyond the bounds, which clip them


def evaluated(actions, engine, fluid, rate):
    clipped = np.clip(actions.astype(np.float64), -1, 1)
    gait = sb.HeldTargets(rate=30, targets=tuple(map(tuple, clipped.tolist())))
    return sb.evaluate(gait, engine=engine, fluid=fluid, physics_rate=rate, duration=len(actions) / 30)


@pytest.mark.parametrize("check", [check_by_gymnasium, check_by_sb3])
@pytest.mark.parametrize("engine", ["pybullet", "planar"])
def test_the_checkers_of_gymnasium_and_stable_baselines_pass(check, engine):
    environment = gymnasium.make("snakebench/Swim-v0", engine=engine, duration=0.5).unwrapped
    assert isinstance(environment, SwimEnv)
    check(environment)


def test_there_are_31_sensors_4_privileged_numbers_and_a_preference():
    space = SwimEnv(engine="planar").observation_space
    assert {name: box.shape for name, box in space.items()} == {
        "sensors": (31,),
        "privileged": (4,),
        "preference": (1,),
    }
    assert [q.name for q in PRIVILEGED] == ["viscosity", "head velocity"]
    assert "viscosity" not in {q.name for q in SENSORS}


@pytest.mark.parametrize(("engine", "rate"), [("pybullet", 480), ("planar", 90)])
@pytest.mark.parametrize("fluid", [sb.named_fluid("oil1"), THICKENING, AHEAD], ids=["oil1", "time", "x"])
def test_the_return_is_the_evaluators_to_the_last_bit(engine, rate, fluid):
    environment = SwimEnv(fluid=fluid, engine=engine, physics_rate=rate, duration=2.0)
    environment.reset(seed=0)
    rewards, over = [], False
    for action in ACTIONS:
        assert not over
        _, reward, terminated, over, info = environment.step(action)
        rewards.append(reward)
    assert over and not terminated
    assert info["return"] == evaluated(ACTIONS, engine, fluid, rate).episode_return
    assert sum(rewards) == pytest.approx(info["return"], rel=1e-12)


def test_the_viscosity_observed_follows_the_field():
    gait = sb.HeldTargets(rate=30, targets=np.clip(ACTIONS.astype(float), -1, 1).tolist())
    swim = sb.simulate(gait, engine="planar", physics_rate=90, fluid=AHEAD, duration=2.0)
    ahead = np.interp(swim.head[-1, 0], (-0.5, 0.5), np.log10((4.79e-3, 1.14e-6)))
    for fluid, last in ((THICKENING, np.log10(4.79e-3)), (AHEAD, ahead)):
        environment = SwimEnv(fluid=fluid, engine="planar", physics_rate=90, duration=2.0)
        observed = [environment.reset(seed=0)[0]["privileged"][0]]
        for action in ACTIONS:
            observation, *_, info = environment.step(action)
            observed.append(observation["privileged"][0])
        assert observed[-1] == pytest.approx(0.4 * last + 1.8, rel=1e-5)
        assert info["viscosity"] == pytest.approx(10**last, rel=1e-5)
        assert len(set(observed)) > 20
    ramp = SwimEnv(fluid=THICKENING, engine="planar", duration=2.0)
    ramp.reset()
    for action in ACTIONS[:30]:
        *_, info = ramp.step(action)
    half = np.sqrt(1.14e-6 * 4.79e-3)  # half of the way from 0.5 s to 1.5 s, in the logarithm
    assert info["viscosity"] == pytest.approx(half, rel=1e-9)


def test_fluids_are_drawn_log_uniformly_and_a_seed_draws_the_same():
    environment = SwimEnv(engine="planar", duration=0.1)
    drawn = [environment.reset(seed=7)[1]["viscosity"]]
    drawn += [environment.reset()[1]["viscosity"] for _ in range(400)]
    assert environment.reset(seed=7)[1]["viscosity"] == drawn[0]
    places = (np.log10(drawn) + 7) / 5
    assert places.min() > 0 and places.max() < 1
    assert places.mean() == pytest.approx(0.5, abs=4 * np.sqrt(1 / 12 / 400))
    assert places.std() == pytest.approx(np.sqrt(1 / 12), rel=0.1)
    assert environment.reset(options={"fluid": "oil2"})[1]["viscosity"] == 4.79e-3


def test_what_does_not_fit_is_refused_in_a_line():
    environment = SwimEnv(engine="planar", duration=0.1)
    with pytest.raises(InvalidValue, match="call reset first"):
        environment.step(ACTIONS[0])
    with pytest.raises(InvalidValue, match="only fluid is one"):
        environment.reset(options={"viscosity": 1.0})
    environment.reset()
    for action, match in ((np.zeros(6, np.float32), "7 fit"), (np.full(7, np.nan, np.float32), "finite")):
        with pytest.raises(InvalidValue, match=match):
            environment.step(action)
    for _ in range(3):
        environment.step(ACTIONS[0])
    with pytest.raises(InvalidValue, match="call reset first"):
        environment.step(ACTIONS[0])


def test_a_robot_that_diverges_ends_its_episode_and_pays():
    robot = sb.Robot(proportional_gain=3000.0, derivative_gain=0.0)
    environment = SwimEnv(engine="planar", robot=robot, fluid="water", physics_rate=240, duration=20.0)
    environment.reset(seed=0)
    rng, terminated, truncated, rewards = np.random.default_rng(0), False, False, list[float]()
    while not (terminated or truncated):
        observation, reward, terminated, truncated, info = environment.step(rng.choice([-1.0, 1.0], 7))
        rewards += [] if terminated else [reward]
    assert terminated and not truncated
    assert reward == pytest.approx(-10_000 / 30) and info["return"] < -300
    rewards.append(reward)
    assert info["return"] == pytest.approx(sum(rewards), rel=1e-12)
    assert all(np.isfinite(group).all() for group in observation.values())


def test_a_member_of_the_batch_is_the_environment():
    vector = SwimVecEnv(3, Swimming(duration=2.0))
    vector.seed(5)
    observations = vector.reset()
    viscosities = vector.state()["viscosity"]
    singles = [
        SwimEnv(fluid=sb.Fluid(kinematic_viscosity=float(v)), engine="planar", physics_rate=90) for v in viscosities
    ]
    first = [single.reset()[0] for single in singles]
    vector.set_attr("_age", np.zeros(3, np.int64))
    for action in ACTIONS[:40]:
        for b, observation in enumerate(first):
            for name in GROUPS:
                np.testing.assert_array_equal(observations[name][b], observation[name])
        observations, rewards, _, _ = vector.step(np.tile(action, (3, 1)))
        answers = [single.step(action) for single in singles]
        first = [answer[0] for answer in answers]
        np.testing.assert_array_equal(rewards, np.float32([answer[1] for answer in answers]))


def test_episodes_begin_at_random_ages_and_end_with_what_learners_need():
    vector = SwimVecEnv(16, Swimming(duration=1.0))
    vector.seed(0)
    vector.reset()
    ends, told = [], []
    for k in range(70):
        observations, _, dones, infos = vector.step(np.tile(ACTIONS[k % 60], (16, 1)))
        for b in np.flatnonzero(dones):
            ends.append(k)
            told.append(infos[b]["episode"])
            assert infos[b]["TimeLimit.truncated"]
            assert np.abs(infos[b]["terminal_observation"]["sensors"]).max() > 0
            assert (observations["sensors"][b] == 0).all()
    assert len({k for k in ends if k < 30}) > 5  # not all at once
    assert {episode["l"] for episode in told if episode["whole"]} == {30}
    assert any(not episode["whole"] for episode in told)


def test_a_batch_goes_on_from_its_state():
    swimming = Swimming(duration=0.5, randomisation=Randomisation(pose=0.2, mass=0.1, diameter=0.1))
    one, other = SwimVecEnv(4, swimming), SwimVecEnv(4, swimming)
    one.seed(1)
    one.reset()
    for action in ACTIONS[:10]:
        one.step(np.tile(action, (4, 1)))
    other.restore(one.state())
    for action in ACTIONS[10:]:
        expected, got = (vector.step(np.tile(action, (4, 1))) for vector in (one, other))
        np.testing.assert_array_equal(expected[1], got[1])
        np.testing.assert_array_equal(expected[0]["sensors"], got[0]["sensors"])


def test_pose_mass_and_diameter_are_drawn_for_each_episode():
    vector = SwimVecEnv(32, Swimming(randomisation=Randomisation(pose=0.2, mass=0.1, diameter=0.05)))
    vector.seed(0)
    angles = vector.reset()["sensors"][:, :7]
    assert angles.std() == pytest.approx(0.2, rel=0.2)
    robots = vector.get_attr("_batch", [0])[0].robots
    masses = np.array([robot.total_mass for robot in robots]) / sb.Robot().total_mass
    assert 0.9 < masses.min() < 0.95 and 1.05 < masses.max() < 1.1
    assert len({robot.diameter for robot in robots}) == 32


def test_a_bent_robot_at_rest_is_placed_as_the_links_say():
    batch = sb.Batch([sb.Robot()], [sb.named_fluid("water")], "angle", 90)
    angles = np.linspace(-0.5, 0.7, 7)
    batch.restart([0], joint_angles=angles[None])
    now = batch.now
    np.testing.assert_array_equal(now.joint_angle[0], angles)
    moved = batch.advance(angles[None], 1)  # hardly: the target is the pose, the spring pulls back
    np.testing.assert_allclose(moved.head[0, :2], now.head[0, :2], atol=2e-3)
    assert abs(moved.head[0, 2]) < 0.02  # the head stays along x
    np.testing.assert_allclose(moved.center[0], now.center[0], atol=1e-5)


def test_a_step_is_worth_the_root_of_its_speed_less_its_power_at_the_price_observed():
    worth, observed = {}, {}
    for price in (None, 0.005, 0.5):
        environment = SwimEnv(fluid="water", engine="planar", physics_rate=90, duration=2.0, price=price)
        observation, _ = environment.reset()
        steps = [environment.step(action) for action in ACTIONS]
        worth[price] = np.array([reward for _, reward, *_ in steps])
        observed[price] = float(observation["preference"][0])
        assert steps[-1][-1]["return"] == evaluated(ACTIONS, "planar", sb.named_fluid("water"), 90).episode_return
    assert observed[None] == observed[0.005] == pytest.approx(0.75 * np.log10(0.005) + 0.75)
    assert observed[0.5] == pytest.approx(0.75 * np.log10(0.5) + 0.75)
    held = tuple(map(tuple, np.clip(ACTIONS.astype(float), -1, 1).tolist()))
    run = sb.simulate(sb.HeldTargets(rate=30, targets=held), engine="planar", physics_rate=90, duration=2.0)
    velocity, power = (30 * np.diff(part[::3]) for part in (run.center[:, 0], run.command_work))
    root = np.sign(velocity) * np.abs(velocity) ** 0.5
    assert (velocity < 0).any() and (velocity > 0).any()
    for price in (0.005, 0.5):
        whole = 30 * worth[None] + 16 * root - 10 * velocity + (0.005 - price) * power
        np.testing.assert_allclose(30 * worth[price], whole, rtol=1e-9, atol=1e-9)
    with pytest.raises(InvalidValue, match="price = 0"):
        SwimEnv(price=0)


def test_prices_are_drawn_up_to_the_highest_and_charged():
    swimming = Swimming(duration=0.5, feels=("sensors", "preference"), randomisation=Randomisation(prices=(0.005, 2.0)))
    vector = SwimVecEnv(64, swimming)
    vector.seed(0)
    observed = vector.reset()["preference"][:, 0]
    assert observed.min() < -0.8 and 0.8 < observed.max() < 1.0
    vector.set_attr("highest_price", 0.01)
    vector.set_attr("_age", np.full(64, 14))  # all begin anew
    assert vector.step(np.tile(ACTIONS[0], (64, 1)))[0]["preference"].max() <= 0.75 * np.log10(0.01) + 0.75 + 1e-6


def test_a_member_is_charged_its_own_price():
    vector = SwimVecEnv(2, Swimming(feels=("sensors", "preference"), randomisation=Randomisation(prices=(0.005, 2.0))))
    vector.seed(0)
    vector.reset()
    prices = vector.state()["price"]
    media = vector.state()["viscosity"]
    singles = [
        SwimEnv(fluid=sb.Fluid(kinematic_viscosity=float(v)), engine="planar", physics_rate=90, price=float(p))
        for v, p in zip(media, prices, strict=True)
    ]
    for single in singles:
        single.reset()
    vector.set_attr("_age", np.zeros(2, np.int64))
    for action in ACTIONS[:10]:
        rewards = vector.step(np.tile(action, (2, 1)))[1]
        np.testing.assert_allclose(rewards, [single.step(action)[1] for single in singles], rtol=1e-5, atol=1e-6)


def test_a_policy_that_observes_the_preference_needs_a_range_of_prices_and_no_other_may_have_one():
    with pytest.raises(InvalidValue, match=r"needs randomisation\.prices, the range"):
        Swimming(feels=("sensors", "preference"))
    for prices in ((0.1, 0.1), (0.5, 0.1)):
        with pytest.raises(InvalidValue, match="an ascending range is needed"):
            Swimming(feels=("sensors", "preference"), randomisation=Randomisation(prices=prices))
    with pytest.raises(InvalidValue, match="and a policy that observes it"):
        Swimming(randomisation=Randomisation(prices=(0.1, 1.0)))


def test_names_choose_columns():
    assert columns(["sensors"], 7).tolist() == list(range(31))
    assert columns(["privileged", "sensors"], 7).tolist() == list(range(35))
    assert columns(["viscosity"], 7).tolist() == [31]
    assert columns(["head velocity", "joint angle"], 2).tolist() == [0, 1, 12, 13, 14]
    assert len(columns(["sensors"], 4)) == 19
    with pytest.raises(InvalidValue, match="did you mean viscosity"):
        columns(["viscosty"], 7)


def test_the_environment_is_made_without_importing_anything_else():
    script = """
import gymnasium
env = gymnasium.make("snakebench.envs:snakebench/Swim-v0", engine="planar")
print(env.spec.max_episode_steps, gymnasium.envs.registration.EnvSpec.from_json(env.spec.to_json()).id)
"""
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True)
    assert done.stdout == "900 snakebench/Swim-v0\n", done.stderr


@pytest.mark.parametrize("name", ["Swim", "MO-Swim"])
def test_an_episode_longer_than_makes_limit_is_not_cut_silently(name):
    asked = {"engine": "planar", "physics_rate": 90, "duration": 31.0, "fluid": "water"}
    cut = gymnasium.make(f"snakebench/{name}-v0", **asked)
    whole = gymnasium.make(f"snakebench/{name}-v0", **asked, max_episode_steps=-1)
    still = np.zeros(7, np.float32)
    for environment in (cut, whole):
        environment.reset(seed=0)
        assert [environment.step(still)[3] for _ in range(900)] == [False] * 899 + [environment is cut]
    with pytest.warns(UserWarning, match="max_episode_steps=-1"):
        cut.reset(seed=0)
    assert [whole.step(still)[3] for _ in range(30)] == [False] * 29 + [True]
    whole.close()


def test_the_picture_shows_the_robot_from_above():
    environment = SwimEnv(fluid="water", engine="planar", duration=2.0, render_mode="rgb_array")
    environment.reset(seed=0)
    rest = environment.render()
    assert rest.shape == (240, 480, 3) and rest.dtype == np.uint8
    dark, red = (np.argwhere((rest == colour).all(axis=2)) for colour in ((38, 70, 83), (231, 111, 81)))
    assert red[:, 1].min() > dark[:, 1].max() - 10  # the head is in front, to the right
    pixel = 1.6 * 1.49 / 480
    assert np.ptp([*dark[:, 1], *red[:, 1]]) * pixel == pytest.approx(1.49 + 0.1, abs=0.02)  # with its round ends
    assert np.ptp(dark[:, 0]) * pixel == pytest.approx(0.1, abs=0.02)
    for action in ACTIONS[:30]:
        environment.step(action)
    assert (environment.render() != rest).any()


@pytest.mark.parametrize("name", ["Swim", "MO-Swim"])
def test_the_environment_renders_what_gymnasium_asks_for(name):
    environment = gymnasium.make(f"snakebench/{name}-v0", engine="planar", control_rate=20, render_mode="rgb_array")
    assert environment.metadata["render_modes"] == ["rgb_array"] and environment.metadata["render_fps"] == 20
    environment.reset(seed=0)
    assert environment.render().shape == (240, 480, 3)
    assert SwimEnv(engine="planar").render() is None
    if name == "Swim":
        check_by_gymnasium(environment.unwrapped)


def test_what_cannot_be_rendered_is_refused():
    with pytest.raises(InvalidValue, match="render_mode = 'human': allowed are None and 'rgb_array'"):
        SwimEnv(engine="planar", render_mode="human")
    with pytest.raises(InvalidValue, match="call reset first"):
        SwimEnv(engine="planar", render_mode="rgb_array").render()
