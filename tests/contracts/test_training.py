"""Trainings: sequences without a loop, groups by name, the same bytes after an interruption, an end at a NaN."""

from __future__ import annotations

import json
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pandas as pd
import pytest
import torch
from sb3_contrib import RecurrentPPO
from sb3_contrib.common.recurrent.buffers import RecurrentDictRolloutBuffer
from sb3_contrib.common.recurrent.type_aliases import RNNStates
from torch import nn

import snakebench as sb
from snakebench.errors import InvalidValue
from snakebench.gain_schedule import ScheduledGait
from snakebench.learning.demonstrations import Demonstrations
from snakebench.learning.resume import LearningFailed, TrainingFolder
from snakebench.learning.rollouts import minibatches, padded, sequences
from snakebench.learning.settings import Distillation, Imitation, Randomisation, Training
from snakebench.learning.training import curriculum, distil, ppo, train
from snakebench.learning.vector import SwimVecEnv
from snakebench.policy import Policy

RNG = np.random.default_rng(0)
BRIEF = {"duration": 1.0, "members": 8, "checkpoints": 3}
TRAININGS = {
    "recurrent": Training(steps=1200, rollout=24, lstm=(16, 16), **BRIEF),
    "recurrent, critic without memory": Training(steps=1200, rollout=24, lstm=(16, 16), critic_lstm=False, **BRIEF),
    "memoryless": Training(steps=1200, rollout=24, lstm=(), randomisation=Randomisation(pose=0.1, mass=0.1), **BRIEF),
}
TEACHER = TRAININGS["memoryless"].but(steps=200, checkpoints=1)
IMITATION = Imitation(
    demonstrations="x",
    iterations=6,
    rollout=20,
    handover=3,
    randomisation=Randomisation(prices=(0.05, 3.0)),
    lstm=(16,),
    **BRIEF,
)
DISTILLATION = Distillation(teacher="x", iterations=6, rollout=20, handover=3, lstm=(16,), **BRIEF)
PERTURBED = DISTILLATION.but(randomisation=Randomisation(perturbations={"rate_noise": (0.0, 1.5), "delay": (0.0, 2.0)}))


def learn(name, folder):
    if name in TRAININGS:
        return train(TRAININGS[name], 0, folder)
    if name == "imitation":
        targets = np.sin(np.arange(30)[:, None] / 30 * 2 * np.pi - np.arange(7))
        gait = ScheduledGait(viscosity=1e-6, price=0.5, targets=targets.tolist())
        return distil(IMITATION, Demonstrations([gait]), 0, folder)
    settings = PERTURBED if name == "perturbed distillation" else DISTILLATION
    return distil(settings, train(TEACHER, 0, folder.with_name("teacher")), 0, folder)


@pytest.mark.parametrize("name", [*TRAININGS, "distillation", "perturbed distillation", "imitation"])
def test_learning_goes_on_after_an_interruption_with_the_same_bytes(name, tmp_path, monkeypatch):
    whole = learn(name, tmp_path / "whole")
    keep, kept = TrainingFolder.write, []

    def keep_two(self, *args):
        if len(kept) == 2:
            raise KeyboardInterrupt
        kept.append(keep(self, *args))

    with monkeypatch.context() as patch:
        patch.setattr(TrainingFolder, "write", keep_two)
        with pytest.raises(KeyboardInterrupt):
            learn(name, tmp_path / "stopped")
    assert not (tmp_path / "stopped" / "policy.safetensors").exists()
    rows = pd.read_csv(tmp_path / "whole" / "log.csv")
    assert len(pd.read_csv(tmp_path / "stopped" / "log.csv")) == 2 and len(rows) == 3
    assert "steps" not in rows or (rows["steps"].is_monotonic_increasing and rows["steps"].is_unique)  # some is left
    torch.manual_seed(99)  # whatever happened in between
    later = []
    with monkeypatch.context() as patch:
        patch.setattr(TrainingFolder, "write", lambda *args: later.append(keep(*args)))
        assert learn(name, tmp_path / "stopped").digest() == whole.digest()
    assert len(later) == 1  # two of three checkpoints were there
    for file in ("log.csv", "policy.safetensors"):
        assert (tmp_path / "stopped" / file).read_bytes() == (tmp_path / "whole" / file).read_bytes()
    assert list((tmp_path / "whole" / "tensorboard").glob("events*"))


def test_a_finished_training_is_read_not_repeated(tmp_path, monkeypatch):
    first = learn("memoryless", tmp_path / "one")
    monkeypatch.setattr("snakebench.learning.training.ppo", lambda *_: pytest.fail("trained again"))
    assert learn("memoryless", tmp_path / "one").digest() == first.digest()


def test_a_damaged_checkpoint_begins_anew(tmp_path):
    whole = learn("memoryless", tmp_path / "whole")
    (tmp_path / "other").mkdir()
    (tmp_path / "other" / "checkpoint.pt").write_bytes(b"half a checkpoint")
    assert learn("memoryless", tmp_path / "other").digest() == whole.digest()


@pytest.mark.parametrize("name", [*TRAININGS, "distillation", "imitation"])
def test_a_nan_stops_the_training_and_keeps_the_last_good_checkpoint(name, tmp_path, monkeypatch):
    rows = []
    keep, observe = TrainingFolder.write, SwimVecEnv.observe
    monkeypatch.setattr(TrainingFolder, "write", lambda self, *args: rows.append(keep(self, *args)))

    def poisoned(self):
        groups = observe(self)
        if rows:
            groups["sensors"][0, 0] = np.nan
        return groups

    if name == "distillation":
        learn("memoryless", tmp_path / "teacher")
        rows.clear()
    monkeypatch.setattr(SwimVecEnv, "observe", poisoned)
    if name == "distillation":
        teacher = Policy.load(tmp_path / "teacher" / "policy.safetensors")
        with pytest.raises(LearningFailed, match=r"finite.*: the last good checkpoint and failure"):
            distil(DISTILLATION, teacher, 0, tmp_path / "failing")
    else:
        with pytest.raises(LearningFailed, match=r"finite.*: the last good checkpoint and failure"):
            learn(name, tmp_path / "failing")
    failure = json.loads((tmp_path / "failing" / "failure.json").read_text())
    assert any(statistics["not finite"] for statistics in failure["batch"].values())
    kept = TrainingFolder(tmp_path / "failing").checkpoint()
    assert kept is not None
    assert len(kept["rows"]) == 1
    weights = kept["student"] if name in ("distillation", "imitation") else kept["parameters"]["policy"]
    assert all(torch.isfinite(weight).all() for weight in weights.values())
    assert not (tmp_path / "failing" / "policy.safetensors").exists()


def test_rollouts_are_cut_where_episodes_start():
    starts = np.zeros((5, 3), bool)
    starts[0, 0] = starts[2, 1] = starts[4, 1] = True
    cut = sequences(starts)
    assert cut.member.tolist() == [0, 1, 1, 1, 2]
    assert cut.first.tolist() == [0, 0, 2, 4, 0]
    assert cut.length.tolist() == [5, 2, 2, 1, 5]


def collected(critic_lstm=True, rollouts=2, members=6, steps=16):
    """A model after rollouts in which episodes start and end, and the rewards that the environment gave in the last."""
    settings = {"duration": 1.0, "lstm": (8, 8), "critic_lstm": critic_lstm}
    model = ppo(Training(steps=1, members=members, rollout=steps, **settings), 0)
    earned, step = [], model.env.step
    model.env.step = lambda actions: earned.append(step(actions)) or earned[-1]
    with torch.no_grad():
        for parameter in model.policy.parameters():  # values and means far from 0
            parameter += 0.1 * torch.randn_like(parameter)
    model.train = lambda: None
    model.learn(rollouts * members * steps, log_interval=None)
    assert model.rollout_buffer.episode_starts[1:].any()
    return model, np.array([rewards for _, rewards, _, _ in earned[-steps:]])


def sequences_first(array):
    return torch.from_numpy(np.ascontiguousarray(array.swapaxes(0, 1))).flatten(0, 1)


@pytest.mark.parametrize("critic_lstm", [True, False])
def test_rollouts_are_what_sb3_contrib_evaluates_on_the_same_observations(critic_lstm):
    model, _ = collected(critic_lstm)
    buffer, first = model.rollout_buffer, model._first_states
    assert all(state.abs().sum() > 0 for state in first.pi)
    observations = {name: sequences_first(group) for name, group in buffer.observations.items()}
    starts, actions = sequences_first(buffer.episode_starts), sequences_first(buffer.actions)
    values, log_probs, _ = model.policy.evaluate_actions(observations, actions, first, starts)
    torch.testing.assert_close(sequences_first(buffer.values), values.detach().flatten(), atol=1e-5, rtol=1e-5)
    torch.testing.assert_close(sequences_first(buffer.log_probs), log_probs.detach(), atol=1e-4, rtol=1e-5)
    assert np.std(buffer.values) > 0.01


@pytest.mark.parametrize("critic_lstm", [True, False])
def test_advantages_and_states_are_those_of_sb3_contribs_own_rollout(critic_lstm, monkeypatch):
    """The same steps again, with its own loop over time, its own buffer and its own bootstrap at time limits."""
    model, earned = collected(critic_lstm, rollouts=1)
    ours, states = model.rollout_buffer, model._last_lstm_states
    actions = iter(torch.from_numpy(ours.actions))
    other, _ = collected(critic_lstm, rollouts=1)
    other.policy.load_state_dict(model.policy.state_dict())
    forward = other.policy.forward

    def replayed(observation, lstm_states, episode_starts):
        _, values, _, new = forward(observation, lstm_states, episode_starts)
        action = next(actions)
        log_prob = other.policy.get_distribution(observation, lstm_states.pi, episode_starts)[0].log_prob(action)
        return action, values, log_prob, new

    monkeypatch.setattr(other.policy, "forward", replayed)
    theirs = RecurrentDictRolloutBuffer(
        16, other.observation_space, other.action_space, (16, 2, 6, 8), gae_lambda=0.95, gamma=0.99, n_envs=6
    )
    zero = torch.zeros(2, 6, 8), torch.zeros(2, 6, 8)
    other._last_lstm_states, other._last_episode_starts = RNNStates(zero, zero), np.ones(6, bool)
    other.env.seed(0)
    other._last_obs = other.env.reset()
    callback = other._init_callback(None)
    RecurrentPPO.collect_rollouts(other, other.env, callback, theirs, 16)
    assert (ours.rewards != earned).any()  # a time limit was bootstrapped
    for name in ("rewards", "values", "log_probs", "advantages", "returns", "episode_starts"):
        np.testing.assert_allclose(getattr(ours, name), getattr(theirs, name), atol=1e-4, rtol=1e-4, err_msg=name)
    memories = ("pi", "vf") if critic_lstm else ("pi",)
    for name in memories:
        for one, two in zip(getattr(states, name), getattr(other._last_lstm_states, name), strict=True):
            torch.testing.assert_close(one, two, atol=1e-5, rtol=1e-5)


@pytest.mark.parametrize("critic_lstm", [True, False])
def test_minibatches_have_the_gradients_of_sb3_contribs_losses(critic_lstm, monkeypatch):
    """Whole padded sequences, in two threads, against its loop over time on all steps."""
    monkeypatch.setattr("snakebench.learning.actor._BFLOAT16", False)
    model, _ = collected(critic_lstm)
    buffer, first, policy = model.rollout_buffer, model._first_states, model.policy
    monkeypatch.setattr(policy.optimizer, "step", lambda: None)
    monkeypatch.setattr(torch.nn.utils, "clip_grad_norm_", lambda *_: None)
    model.ent_coef = 0.01
    with torch.no_grad():
        policy.action_net.bias += 0.05  # the policy has changed since the rollout
        policy.log_std += 0.1
    whole = padded(buffer, model._columns, (first.pi, first.vf))
    with ThreadPoolExecutor(1) as beside:
        value_loss, change = model._update(next(minibatches(whole, 1)), beside)
    ours = {name: parameter.grad.clone() for name, parameter in policy.named_parameters()}

    observations = {name: sequences_first(group) for name, group in buffer.observations.items()}
    starts, actions = sequences_first(buffer.episode_starts), sequences_first(buffer.actions)
    values, log_prob, entropy = policy.evaluate_actions(observations, actions, first, starts)
    advantages = sequences_first(buffer.advantages)
    advantages = (advantages - advantages.mean()) / (advantages.std() + 1e-8)
    log_ratio = log_prob - sequences_first(buffer.log_probs)
    ratio = log_ratio.exp()
    gain = torch.min(advantages * ratio, advantages * ratio.clamp(0.8, 1.2)).mean()
    error = nn.functional.mse_loss(sequences_first(buffer.returns), values.flatten())
    policy.optimizer.zero_grad()
    (-gain - 0.01 * entropy.mean() + model.vf_coef * error).backward()
    assert value_loss == pytest.approx(float(error.detach()), rel=1e-4)
    assert change == pytest.approx(float((ratio - 1 - log_ratio).mean().detach()), rel=1e-3)
    for name, parameter in policy.named_parameters():
        torch.testing.assert_close(ours[name], parameter.grad, atol=1e-5, rtol=1e-3, msg=name)


def test_every_step_is_learned_from_once_in_the_order_of_time():
    model, _ = collected()
    buffer, first = model.rollout_buffer, model._first_states
    buffer.returns[:] = 10.0 * np.arange(16)[:, None] + np.arange(6)
    seen = []
    for batch in minibatches(padded(buffer, model._columns, (first.pi, first.vf)), 3):
        for k in range(batch.within.shape[1]):
            found = batch.returns[batch.within[:, k] > 0, k].numpy()
            assert (np.diff(found) == 10).all()
            begin, member = divmod(int(found[0]), 10)
            assert not buffer.episode_starts[begin + 1 : begin + len(found), member].any()
            goes_on = begin == 0 and not buffer.episode_starts[0, member]
            assert torch.equal(batch.actor_state[0][:, k], first.pi[0][:, member] * goes_on)
            assert torch.equal(batch.critic_state[1][:, k], first.vf[1][:, member] * goes_on)
            seen += found.tolist()
    assert sorted(seen) == sorted(buffer.returns.ravel().tolist())


@pytest.mark.parametrize("lstm", [(), (8,)])
@pytest.mark.parametrize(
    ("feels", "critic"),
    [
        (("sensors", "privileged"), ("sensors", "privileged")),
        (("sensors",), ("sensors",)),
        (("sensors",), ("sensors", "privileged")),
        (("sensors", "viscosity"), ("sensors", "head velocity")),
    ],
)
def test_actor_and_critic_observe_what_their_settings_name(feels, critic, lstm):
    training = Training(steps=1, members=2, feels=feels, critic=critic, lstm=lstm)
    network = ppo(training, 0).policy
    widths = {"sensors": 31, "privileged": 4, "preference": 1}
    seen = {group: torch.randn(2, width, requires_grad=True) for group, width in widths.items()}
    state = (torch.zeros(1, 2, 8), torch.zeros(1, 2, 8))
    extra = (state, torch.zeros(2)) if lstm else ()
    for answer, names in (
        ((network.get_distribution(seen, *extra)), feels),
        (network.predict_values(seen, *extra), critic),
    ):
        distribution = answer[0] if isinstance(answer, tuple) else answer
        value = distribution if isinstance(distribution, torch.Tensor) else distribution.distribution.mean
        slopes = torch.autograd.grad(value.sum(), list(seen.values()), allow_unused=True)
        sensors, privileged, preference = (None if slope is None else (slope != 0).any(dim=0) for slope in slopes)
        assert sensors is not None and sensors.all()
        assert preference is None or not preference.any()
        expected = ["viscosity" in names or "privileged" in names] + [
            "head velocity" in names or "privileged" in names
        ] * 3
        found = [False] * 4 if privileged is None else privileged.tolist()
        assert found == expected


def test_the_weight_of_propulsion_and_the_highest_price_grow_over_a_share_of_the_training():
    training = Training(steps=1, propulsion=2.0, growth=0.5)
    assert [curriculum(training, done) for done in (0.0, 0.25, 0.5, 1.0)] == [
        {"propulsion": weight} for weight in (2.0, 6.0, 10.0, 10.0)
    ]
    assert curriculum(Training(steps=1), 0.0) == {"propulsion": 10.0}
    names = ("sensors", "preference")
    priced = Training(steps=1, feels=names, randomisation=Randomisation(prices=(0.01, 1.0)), price_growth=0.4)
    highest = [curriculum(priced, done)["highest_price"] for done in (0.0, 0.2, 0.4, 1.0)]
    assert highest == pytest.approx([0.01, 0.1, 1.0, 1.0])


def test_a_curriculum_changes_what_is_learned_but_not_the_return():
    one, other = SwimVecEnv(4), SwimVecEnv(4)
    other.propulsion = 1.0
    actions, returns = RNG.uniform(-1, 1, (50, 4, 7)).astype(np.float32), []
    for vector in (one, other):
        vector.seed(0)
        vector.reset()
        rewards = np.array([vector.step(action)[1] for action in actions])
        returns.append(vector.state()["return"])
        speeds = vector._batch.now.center[:, 0] - vector.state()["start"]
        assert rewards.sum(axis=0) == pytest.approx(returns[-1] - (10 - vector.propulsion) * speeds, rel=1e-4)
    np.testing.assert_array_equal(*returns)


@pytest.mark.parametrize(
    ("settings", "match"),
    [
        ({"lstm": (8, 16)}, "layers of one size"),
        ({"feels": ("sonar",)}, "unknown observation 'sonar'"),
        ({"discount": 1.5}, "discount = 1.5"),
        ({"members": 0}, "members = 0"),
        ({"members": 1, "rollout": 7, "minibatches": 4}, "minibatches = 4: too many for 7 steps"),
        ({"randomisation": {"viscosities": (1e-2, 1e-7)}}, "viscosities = .*: an ascending range"),
    ],
)
def test_settings_out_of_range_are_refused(settings, match):
    with pytest.raises(InvalidValue, match=match):
        Training(steps=1, **settings)


def test_minibatches_of_a_distillation_are_of_whole_members():
    with pytest.raises(InvalidValue, match="groups = 4: too many for 2 members"):
        Distillation(teacher="teacher", members=2)


@pytest.mark.slow
def test_a_memoryless_teacher_learns_to_swim_and_a_student_learns_from_it(tmp_path):
    teacher = train(Training(steps=400_000, lstm=(), checkpoints=2), 0, tmp_path / "teacher")
    student = distil(
        Distillation(teacher="teacher", iterations=60, handover=40, checkpoints=1), teacher, 0, tmp_path / "student"
    )
    runs = [sb.evaluate(policy, engine="planar", physics_rate=90) for policy in (teacher, student)]
    assert runs[0].speed > 0.3  # the best sinusoid in the paper's range swims 0.36 m/s
    assert runs[1].episode_return > 0.8 * runs[0].episode_return
