"""Speed of learning: ours beside sb3-contrib's RecurrentPPO as shipped, and of a policy's step.

Both learn in the same environments with the paper's network (actor and critic of 2 x 128 each) and five epochs; steps
are control steps of all environments together, rollouts and updates included.

    pytest benchmarks/test_learning.py
"""

from __future__ import annotations

import numpy as np
import pytest
import torch
from sb3_contrib import RecurrentPPO
from torch import nn

from snakebench.learning.settings import Training
from snakebench.learning.training import ppo
from snakebench.learning.vector import SwimVecEnv
from snakebench.policy import Card, Policy

# Environments, steps of a rollout, and samples of a minibatch: the habit of the library that the paper names, and
# sb3-contrib's own rollout, with the paper's four minibatches; and its own minibatch as well.
SETTINGS = {"24 x 128": (128, 24, 768), "128 x 64": (64, 128, 2048), "128 x 64, as shipped": (64, 128, 128)}


def ours(members, rollout, minibatch, **changes):
    training = Training(
        steps=1, members=members, rollout=rollout, minibatches=members * rollout // minibatch, **changes
    )
    return ppo(training, 0)


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


@pytest.mark.parametrize("learner", [sb3_contrib, ours])
@pytest.mark.parametrize("setting", SETTINGS)
def test_recurrent_learning(benchmark, learner, setting):
    torch.set_num_threads(1)
    members, rollout, minibatch = SETTINGS[setting]
    model = learner(members, rollout, minibatch)
    steps = members * rollout
    benchmark.group, benchmark.extra_info["steps"] = f"control steps learned from, {setting}", steps
    benchmark.extra_info["base"] = "test_recurrent_learning[" + setting + "-sb3_contrib]"
    rounds = 1 if minibatch == 128 else 4
    benchmark.pedantic(
        lambda: model.learn(steps, reset_num_timesteps=False, log_interval=10**9), rounds=rounds, warmup_rounds=1
    )


def test_memoryless_learning(benchmark):
    torch.set_num_threads(1)
    model = ours(128, 24, 768, lstm=())
    benchmark.group, benchmark.extra_info["steps"] = "control steps learned from, memoryless", 3072
    benchmark.extra_info["base"] = "test_memoryless_learning"
    benchmark.pedantic(
        lambda: model.learn(3072, reset_num_timesteps=False, log_interval=10**9), rounds=8, warmup_rounds=1
    )


def test_a_policys_step(benchmark):
    """Has to be far below the 33 ms of a control step."""
    card, rng = Card(), np.random.default_rng(0)
    policy = Policy(card, {name: rng.normal(size=shape).astype(np.float32) for name, shape in card.shapes().items()})
    observation = rng.normal(size=35).astype(np.float32)
    benchmark(policy.act, observation, policy.fresh_memory())
