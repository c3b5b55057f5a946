"""How fast this machine learns."""

from functools import cache, partial

import torch
from stable_baselines3.common.logger import Logger

from snakebench.learning.settings import Training
from snakebench.learning.training import ppo
from snakebench.progress import timed


@cache
def step_seconds() -> float:
    """How long a control step of recurrent PPO takes, with nothing beside it [s]: in the second of two rollouts."""
    training, threads = Training(steps=1), torch.get_num_threads()
    torch.set_num_threads(1)  # as a worker
    try:
        model = ppo(training, 0)
        model.set_logger(Logger(None, []))
        steps = training.members * training.rollout
        learned = partial(model.learn, steps, log_interval=None, reset_num_timesteps=False)
        seconds = [timed(learned) for _ in range(2)]  # the first one loads and compiles
    finally:
        torch.set_num_threads(threads)
    return seconds[-1] / steps
