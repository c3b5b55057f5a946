"""Speed of learning: ours beside sb3-contrib's RecurrentPPO as shipped and version 1.0's, and of a policy's step.

All learn in the same environments with the paper's network (actor and critic of 2 x 128 each) and five epochs; steps
are control steps of all environments together, rollouts and updates included.

    pytest benchmarks/test_learning.py
    pytest benchmarks/test_learning.py -m slow   # what is learned: returns of three seeds
"""

from __future__ import annotations

import numpy as np
import pytest
import torch
from sb3_contrib import RecurrentPPO
from sb3_contrib.common.recurrent.buffers import RecurrentDictRolloutBuffer
from scipy import stats
from torch import nn

import snakebench as sb
from snakebench.engines.planar import Batch
from snakebench.fluid import PAPERS
from snakebench.learning import training as learning
from snakebench.learning.ppo import SequencePPO
from snakebench.learning.settings import Training
from snakebench.learning.training import ppo, train
from snakebench.learning.vector import SplitBatch, SwimVecEnv
from snakebench.policy import Card, Policy

# Environments, steps of a rollout, and samples of a minibatch: the habit of the library that the paper names and
# our own, with the paper's four minibatches; and sb3-contrib's own rollout and minibatch.
SETTINGS = {"24 x 128": (128, 24, 768), "96 x 64": (64, 96, 1536), "128 x 64, as shipped": (64, 128, 128)}


def ours(members, rollout, minibatch, **changes):
    training = Training(
        steps=1, members=members, rollout=rollout, minibatches=members * rollout // minibatch, **changes
    )
    return ppo(training, 0)


def feed_forward_critic(members, rollout, minibatch):
    return ours(members, rollout, minibatch, critic_lstm=False)


class _Version1(SequencePPO):
    """Rollouts as in version 1.0: sb3-contrib's, in which actor and critic run step by step, into its buffer."""

    def _setup_model(self):
        super()._setup_model()
        shape = (self.n_steps, self.policy.lstm_actor.num_layers, self.n_envs, self.policy.lstm_actor.hidden_size)
        where = self.observation_space, self.action_space, shape, self.device
        self.rollout_buffer = RecurrentDictRolloutBuffer(self.n_steps, *where, self.gae_lambda, self.gamma, self.n_envs)

    def collect_rollouts(self, *args, **settings):
        self._first_states = self._last_lstm_states
        return RecurrentPPO.collect_rollouts(self, *args, **settings)


@pytest.fixture
def version_1(monkeypatch):
    """A function that makes version 1.0's learner, whose robots swim in one thread."""
    monkeypatch.setattr(SplitBatch, "_swim", Batch._swim)
    monkeypatch.setattr(learning, "SequencePPO", _Version1)
    return ours


def sb3_contrib(members, rollout, minibatch):
    sizes = {"lstm_hidden_size": 128, "n_lstm_layers": 2, "net_arch": [64, 64], "activation_fn": nn.ELU}
    return RecurrentPPO(
        "MultiInputLstmPolicy",
        SwimVecEnv(members),
        n_steps=rollout,
        batch_size=minibatch,
        n_epochs=5,
        policy_kwargs=sizes,
        device="cpu",
        seed=0,
    )


def measure(benchmark, setting, learner):
    torch.set_num_threads(1)
    members, rollout, minibatch = SETTINGS[setting]
    model = learner(members, rollout, minibatch)
    steps = members * rollout
    benchmark.group, benchmark.extra_info["steps"] = f"control steps learned from, {setting}", steps
    benchmark.extra_info["base"] = f"test_recurrent_learning[{setting}-sb3_contrib]"
    rounds = 1 if minibatch == 128 else 8
    benchmark.pedantic(
        lambda: model.learn(steps, reset_num_timesteps=False, log_interval=10**9), rounds=rounds, warmup_rounds=1
    )


@pytest.mark.parametrize("learner", [sb3_contrib, ours, feed_forward_critic])
@pytest.mark.parametrize("setting", SETTINGS)
def test_recurrent_learning(benchmark, learner, setting):
    measure(benchmark, setting, learner)


@pytest.mark.parametrize("setting", SETTINGS)
def test_recurrent_learning_in_version_1(benchmark, version_1, setting):
    measure(benchmark, setting, version_1)


@pytest.mark.slow
def test_returns_of_three_seeds_are_no_worse_than_those_of_version_1(tmp_path, request):
    """A short training; no mean return is below the 95 % interval of version 1.0's."""
    returns = {}
    for name, settings in {"ours": {}, "feed_forward_critic": {"critic_lstm": False}, "version_1": {}}.items():
        if name == "version_1":
            request.getfixturevalue(name)
        training = Training(steps=500_000, checkpoints=1, **settings)
        returns[name] = [mean_return(train(training, seed, tmp_path / f"{name}-{seed}")) for seed in range(3)]
    middle = np.mean(returns["version_1"])
    width = stats.t.ppf(0.975, 2) * stats.sem(returns["version_1"])
    for name, of_seeds in returns.items():
        print(f"{name:20} return {np.mean(of_seeds):6.1f}   seeds", *(f"{value:6.1f}" for value in of_seeds))
        assert np.mean(of_seeds) > middle - width


def mean_return(policy):
    """Over the paper's fluids, in planar."""
    runs = [sb.evaluate(policy, fluid, engine="planar", physics_rate=90) for fluid in PAPERS]
    return np.mean([run.episode_return for run in runs])


def test_memoryless_learning(benchmark):
    torch.set_num_threads(1)
    model = ours(128, 24, 768, lstm=())
    benchmark.group, benchmark.extra_info["steps"] = "control steps learned from, memoryless", 3072
    benchmark.extra_info["base"] = "test_memoryless_learning"
    benchmark.pedantic(
        lambda: model.learn(3072, reset_num_timesteps=False, log_interval=10**9), rounds=8, warmup_rounds=1
    )


def test_a_policys_step(benchmark):
    """To be compared with the 33 ms of a control step."""
    card, rng = Card(), np.random.default_rng(0)
    policy = Policy(card, {name: rng.normal(size=shape).astype(np.float32) for name, shape in card.shapes().items()})
    observation = rng.normal(size=35).astype(np.float32)
    benchmark(policy.act, observation, policy.fresh_memory())
