"""Baselines of the leaderboard: tuned for what is scored, true to their sources, and the same as entries."""

from __future__ import annotations

import argparse
import importlib.util
import os
import re
import subprocess
import sys
import tomllib
from pathlib import Path

import numpy as np
import pytest
import torch
from stable_baselines3.common.vec_env import VecExtractDictObs, VecFrameStack

import snakebench as sb
from snakebench.errors import StoreError
from snakebench.gain_schedule import GainSchedule
from snakebench.learning.network import onnx_entry, played
from snakebench.learning.vector import SwimVecEnv
from snakebench.metrics import stored_energy
from snakebench.policy import Card
from snakebench.scoring.entry import entry_of, read_entry
from snakebench.scoring.leaderboard import Card as EntryCard
from snakebench.scoring.leaderboard import write_entry
from snakebench.scoring.measurement import scored_swim
from snakebench.scoring.tasks import VERSION, load_tasks
from snakebench.scoring.trial import drawn_viscosities, trial
from snakebench.scoring.yardstick import Yardstick

EXAMPLES = Path(__file__).parents[2] / "examples"
QUIET = Card(lstm=())
ABOUT = {"name": "mine", "authors": ["me"], "information": "sensors"}
TINY = {
    "feedback_cpg.py": "--generations 1 --population 4 --fluids 2 --seconds 0.4 --threads 1",
    "evolution_strategy.py": "--generations 1 --pairs 2 --fluids 2 --seconds 0.4 --threads 1",
    "off_policy.py": "--steps 80 --pilot 40 --learners sac crossq --members 4 --updates 0.1 --seconds 0.4",
    "rma.py": "--steps 96 --iterations 1 --rollout 5 --members 4 --seconds 0.4",
}
MORE = {
    "feedback_cpg.py": "--generations 2",
    "evolution_strategy.py": "--generations 2",
    "off_policy.py": "--steps 160",
    "rma.py": "--steps 192 --iterations 2",
}


def example(name):
    spec = importlib.util.spec_from_file_location(name, EXAMPLES / f"{name}.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


cpg, strategy, mppi = (example(name) for name in ("feedback_cpg", "evolution_strategy", "mppi"))


def cpg_of(**changes):
    """A pattern generator without feedback but for the changes."""
    plain = {"frequency": 0.6, "amplitude": 0.8, "taper": 0.5, "lag": 0.7, "coupling": 6.0, "stretch": 0.0, "load": 0.0}
    rest = {"shift": 0.0, "adaptation": 0.0, "relaxation": 1.0, "widening": 0.0, "stiffening": 0.0}
    return cpg.FeedbackCpg(list({**plain, **rest, **changes}.values()))


def wave(members):
    """A travelling wave that looks at nothing."""
    step = iter(range(10**6))
    return lambda _: np.tile(0.9 * np.sin(2 * np.pi * 0.6 * next(step) / 30 - 0.7 * np.arange(7)), (members, 1))


# Trials


def test_the_limit_of_many_swims_is_that_of_each():
    yardstick, rng = Yardstick(load_tasks("v1"), "positive"), np.random.default_rng(0)
    viscosities, powers = 10 ** rng.uniform(-7.5, -1.5, 12), 10 ** rng.uniform(-3, 3, 12)
    each = [yardstick.at(sb.Fluid(kinematic_viscosity=v), p)[0] for v, p in zip(viscosities, powers, strict=True)]
    np.testing.assert_allclose(yardstick.speeds(viscosities, powers), each, rtol=1e-12)


def test_a_trial_measures_what_a_scored_swim_measures():
    viscosities = np.array([1e-6, 3e-3])
    found = trial(wave(2), viscosities, seconds=6.0, start=3.0)
    act = wave(1)
    gait = sb.HeldTargets(rate=30, targets=[act(None)[0].tolist() for _ in range(180)])
    for k, viscosity in enumerate(viscosities):
        fluid = sb.Fluid(kinematic_viscosity=float(viscosity))
        scenario = sb.Scenario(fluid=fluid, engine="planar", physics_rate=90, duration=6.0)
        swim = sb.simulate(gait, scenario)
        measured, stored = scored_swim(swim, scenario, 3.0), stored_energy(swim)
        work = swim.command_work[-1] - swim.command_work[270] - stored[-1] + stored[270]
        assert measured["power"] == pytest.approx(work / 3.0, rel=1e-9)
        assert found.speed[k] == pytest.approx(measured["speed"], rel=1e-9)
        assert found.positive_power[k] == pytest.approx(measured["positive_power"], rel=1e-9)
        limit = Yardstick(load_tasks(VERSION), "positive").at(fluid, measured["positive_power"])[0]
        assert found.share[k] == pytest.approx(measured["speed"] / limit, rel=1e-9)


def test_swimming_backwards_counts_less_than_standing_still():
    forwards, backwards, still = wave(1), wave(1), lambda _: np.zeros((1, 7))
    shares = [
        trial(act, np.array([1e-4]), 4.0, 2.0).share[0]
        for act in (forwards, lambda seen: backwards(seen)[:, ::-1], still)
    ]
    assert shares[0] > 0.1 > shares[2] > -1e-6 > shares[1]


def test_viscosities_are_one_in_each_part_of_the_range():
    places = (np.log10(drawn_viscosities(np.random.default_rng(1), 10)) + 7) / 5 * 10
    assert np.floor(places).tolist() == list(range(10))


# Central pattern generator with feedback


def test_without_feedback_a_pattern_generator_settles_at_its_sinusoid():
    act = played(cpg_of(), cpg.MEMORY, 1)
    targets = np.array([act(np.zeros((1, 31), np.float32))[0] for _ in range(600)])[300:]
    times = np.arange(301, 601) / 30
    amplitudes = 0.8 * np.linspace(0.5, 1.0, 7)
    turning = 2 * np.pi * 0.6 * times[:, None] - 0.7 * np.arange(7)
    late = np.angle((targets[:, 0] * np.exp(-1j * turning[:, 0])).mean() * 1j)
    np.testing.assert_allclose(targets, amplitudes * np.sin(turning + late), atol=2e-3)


def test_feedback_makes_the_frequency_depend_on_the_fluid():
    fluids = np.array([1e-6, 5e-3])

    def phases(network):
        state = [torch.zeros(2, size) for size in cpg.MEMORY.values()]

        def act(observation):
            action, *state[:] = network(torch.from_numpy(observation), *state)
            return action.numpy()

        trial(act, fluids, 8.0, 4.0)
        return state[0].mean(1).numpy() / (2 * np.pi * 8.0)  # mean frequency [Hz]

    plain, loaded = phases(cpg_of()), phases(cpg_of(load=-2.0, shift=-1.57, adaptation=1.0))
    assert plain[0] == pytest.approx(plain[1], rel=1e-6)
    assert loaded[0] > 1.3 * loaded[1]  # a thicker fluid loads the joints more


def test_mirrored_sensors_and_phases_give_mirrored_targets():
    network, rng = cpg_of(stretch=3.0, load=-1.0, shift=0.4, adaptation=0.7, widening=0.5), np.random.default_rng(0)
    seen, phase = (torch.tensor(rng.normal(size=n), dtype=torch.float32) for n in (31, 7))
    change, growth = torch.tensor([0.2]), torch.tensor([0.9])
    left, _, *after = network(seen, phase, change, growth)
    right, _, *mirrored = network(-seen, phase + np.pi, change, growth)
    torch.testing.assert_close(right, -left, atol=1e-5, rtol=0)
    torch.testing.assert_close(mirrored, after, atol=1e-5, rtol=0)


# Evolution strategy


@pytest.fixture
def asked(tmp_path):
    return argparse.Namespace(
        generations=60, pairs=20, fluids=2, seconds=0.4, noise=0.05, rate=0.02, every=1, threads=1, seed=0, out=tmp_path
    )


def test_an_evolution_strategy_climbs_a_known_hill(asked, monkeypatch):
    top = strategy.first_weights(np.random.default_rng(0)).copy()
    top[:5] += 0.5
    monkeypatch.setattr(strategy, "shares", lambda candidates, *_: -np.square(candidates[:, :5] - top[:5]).sum(axis=1))
    weights, *_ = strategy.train(asked)
    assert np.abs(weights - top)[:5].max() < 0.15


def test_an_interrupted_evolution_ends_as_an_uninterrupted_one(asked, tmp_path, capsys):
    asked.generations, asked.pairs = 2, 2
    strategy.train(asked)
    asked.generations = 3
    assert "generation 2" in capsys.readouterr().out
    resumed = strategy.train(asked)[0]
    assert [line.split(":")[0] for line in capsys.readouterr().out.splitlines()] == ["generation 3"]
    for checkpoint in tmp_path.glob("checkpoint-*.npz"):
        checkpoint.unlink()
    np.testing.assert_array_equal(resumed, strategy.train(asked)[0])


def test_an_evolution_with_other_settings_begins_anew(asked, monkeypatch):
    monkeypatch.setattr(strategy, "shares", lambda candidates, *_: -np.square(candidates).sum(axis=1))
    asked.generations = 2
    first = strategy.train(asked)[0]
    asked.seed = 1
    assert np.abs(strategy.train(asked)[0] - first).max() > 0.1
    asked.seed = 0
    np.testing.assert_array_equal(strategy.train(asked)[0], first)


# Model predictive control


def swimming(seconds, viscosity):
    """A robot in the middle of a wave."""
    batch, act = sb.Batch([sb.Robot()], [sb.Fluid(kinematic_viscosity=viscosity)], "angle", 90), wave(1)
    for _ in range(round(30 * seconds)):
        batch.advance(act(None), 3)
    return batch


def test_a_model_goes_on_from_the_state_of_a_robot():
    batch, fluid = swimming(1.5, 1e-4), sb.Fluid(kinematic_viscosity=1e-4)
    model = mppi.Model([sb.Robot()] * 2, [fluid] * 2, "angle", 90)
    model.place(type(batch.now)(*(part[0] for part in batch.now)), fluid)
    plans = np.random.default_rng(0).uniform(-1, 1, (2, 10, 7))
    begin = batch.now
    distance, work = model.swim(plans)
    for target in plans[1]:
        now = batch.advance(target[None], 3)
    assert distance[1] == pytest.approx(now.center[0, 0] - begin.center[0, 0], abs=1e-4)
    assert work[1] == pytest.approx(now.energy[0, 1] - begin.energy[0, 1], rel=1e-3)
    assert abs(distance[0] - distance[1]) > 1e-4


def test_a_plan_is_never_worse_in_the_model_than_the_one_it_came_from():
    viscosity = 1e-4
    batch = swimming(1.0, viscosity)
    now = type(batch.now)(*(part[0] for part in batch.now))
    planner = mppi.Mppi(samples=12, horizon=10, past=15).begin(sb.Robot(), 30)
    planner.past.extend([(now.center[0] - 0.1, now.energy[1] - 2.0)] * 15 + [(now.center[0], now.energy[1])])
    plan, reached = planner.plan, []
    for _ in range(4):
        reached.append(planner.shares(planner.single, now, viscosity, plan[None])[0])
        plan = planner.better(now, viscosity, plan)
    assert reached == sorted(reached) and reached[-1] > reached[0]


def test_model_predictive_control_swims_and_counts_as_privileged():
    controller = mppi.Mppi(samples=4, horizon=4)
    swim = sb.simulate(controller, "oil1", engine="planar", duration=1.0)
    assert not swim.diverged and np.abs(swim.joint_angle).max() > 0.1
    assert entry_of(controller).information == "privileged"
    assert controller.digest() == mppi.Mppi(samples=4, horizon=4).digest() != mppi.Mppi(samples=5, horizon=4).digest()


def test_the_fluid_of_model_predictive_control_may_be_an_estimate():
    targets = np.array([wave(1)(None)[0] for _ in range(2)]).tolist()
    gait = {"viscosity": 1e-5, "price": 0.1, "targets": targets}
    estimator = {"weights": [np.zeros((1, 58)).tolist()], "biases": [[-4.0]]}  # which says 1e-4 of all that it sees
    schedule = GainSchedule(gaits=[gait], estimator=estimator)
    planner = mppi.Mppi(samples=2, horizon=2, schedule=schedule).begin(sb.Robot(), 30)
    used, planner.better = [], lambda _, viscosity, plan: used.append(viscosity) or plan
    now = swimming(0.1, 1e-4).now
    for _ in range(120):
        planner(type(now)(*(part[0] for part in now)), 1e-7)
    assert used[0] == pytest.approx(10**-4.5) and used[-1] == pytest.approx(1e-4, rel=0.02)


# Entries


@pytest.mark.parametrize(
    "name", [name if name == "feedback_cpg.py" else pytest.param(name, marks=pytest.mark.slow) for name in TINY]
)
def test_an_example_writes_an_entry_with_its_cost(name, tmp_path):
    command = [sys.executable, str(EXAMPLES / name), *TINY[name].split(), "--out", str(tmp_path / "entry")]
    done = subprocess.run(command, cwd=tmp_path, env=dict(os.environ), capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    card = EntryCard(**tomllib.loads((tmp_path / "entry" / "card.toml").read_text()))
    entry = read_entry(tmp_path / "entry" / card.file)
    assert entry.information == card.information == "sensors"
    assert f"{card.training_steps} control steps" in done.stdout.splitlines()[-1] and card.training_steps > 0


@pytest.mark.slow
@pytest.mark.parametrize("name", TINY)
def test_an_example_continues_from_its_checkpoint(name, tmp_path):
    steps, told = [], []
    for words in (TINY[name], f"{TINY[name]} {MORE[name]}"):
        command = [sys.executable, str(EXAMPLES / name), *words.split(), "--out", str(tmp_path / "entry")]
        done = subprocess.run(command, cwd=tmp_path, env=dict(os.environ), capture_output=True, text=True)
        assert done.returncode == 0, done.stderr
        steps.append(EntryCard(**tomllib.loads((tmp_path / "entry" / "card.toml").read_text())).training_steps)
        told.append({*re.findall(r"^(?:\w+: )?(?:generation \d+|iteration \d+|\d+ steps)(?=[:,])", done.stdout, re.M)})
    assert steps[1] > steps[0] and told[0] and told[0].isdisjoint(told[1])


@pytest.mark.parametrize("kind", ["cpg", "strategy"])
def test_an_entry_swims_like_the_network_that_was_tuned(kind, tmp_path):
    network, memory = {
        "cpg": lambda: (cpg_of(stretch=3.0, load=-1.0, shift=0.4, adaptation=0.7, widening=0.5), cpg.MEMORY),
        "strategy": lambda: (
            strategy.Recurrent(4 * strategy.first_weights(np.random.default_rng(1))),
            strategy.MEMORY,
        ),
    }[kind]()
    viscosity = 1e-4
    path = write_entry(tmp_path, onnx_entry(network, memory, QUIET), **ABOUT)
    fluid = sb.Fluid(kinematic_viscosity=viscosity)
    scenario = sb.Scenario(fluid=fluid, engine="planar", physics_rate=90, duration=4.0)
    measured = scored_swim(sb.simulate(read_entry(path).settings[0].controller, scenario), scenario, 2.0)
    found = trial(played(network, memory, 1), np.array([viscosity]), 4.0, 2.0)
    assert found.speed[0] == pytest.approx(measured["speed"], abs=1e-4)
    assert found.positive_power[0] == pytest.approx(measured["positive_power"], rel=1e-3)


@pytest.mark.parametrize("name", ["tqc", "sac", "crossq"])
def test_an_off_policy_actor_acts_as_its_learner_predicts(name):
    off_policy = example("off_policy")
    asked = argparse.Namespace(members=2, buffer=100, updates=0.1, seed=3)
    model = off_policy.learner(name, asked)
    environment = VecFrameStack(VecExtractDictObs(SwimVecEnv(2), "sensors"), off_policy.FRAMES)
    act, observation = played(off_policy.Stacked(model.actor), off_policy.MEMORY, 2), environment.reset()
    model.policy.set_training_mode(False)
    for _ in range(12):
        action = model.predict(observation, deterministic=True)[0]
        np.testing.assert_allclose(act(observation[:, -off_policy.SENSORS :]), action, atol=1e-6)
        observation = environment.step(action)[0]


def test_an_adapted_policy_that_estimates_right_acts_like_the_one_that_is_told():
    rma = example("rma")
    model = rma.BasePPO("MultiInputPolicy", SwimVecEnv(2), n_steps=8, batch_size=16, device="cpu",
                              policy_kwargs={"features_extractor_class": rma.Told, "net_arch": [16]})  # fmt: skip
    base = rma.Base(model.policy)
    network, seen = rma.Adapted(base), torch.randn(3, rma.SENSORS + rma.PRIVILEGED)
    told = base(seen)[0]
    network.estimate = lambda _: base.encoder(seen[:, rma.SENSORS :])
    adapted, history = network(seen[:, : rma.SENSORS], torch.zeros(3, rma.MEMORY["history"]))
    torch.testing.assert_close(adapted, told)
    torch.testing.assert_close(history[:, -rma.SENSORS :], seen[:, : rma.SENSORS])
    groups = {"sensors": seen[:, : rma.SENSORS], "privileged": seen[:, rma.SENSORS :], "preference": torch.zeros(3, 1)}
    predicted = model.policy.get_distribution(groups).mode()
    torch.testing.assert_close(predicted.clamp(-1, 1), told)


def test_an_entry_is_not_written_where_a_file_is_in_the_way(tmp_path):
    (tmp_path / "mine").write_text("")
    with pytest.raises(StoreError, match="cannot write to the directory"):
        write_entry(tmp_path / "mine", b"", **ABOUT)
