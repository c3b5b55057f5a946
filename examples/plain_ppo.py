"""Train Stable-Baselines3's PPO without changes on the swimming snake, and evaluate it like every other policy.

    python examples/plain_ppo.py --steps 40000

Training uses the planar engine, with a random fluid in each episode. The evaluation uses PyBullet at the published
rate: 30 s from rest in water, oil1 and oil2. The published sea-snake gait for all three fluids is evaluated as well.
"""

from __future__ import annotations

import argparse
import time
from pathlib import Path

import gymnasium
import pandas as pd
import torch
from stable_baselines3 import PPO
from stable_baselines3.common.env_util import make_vec_env

import snakebench as sb

FEELS = ["sensors", "privileged"]  # a policy without memory needs privileged information
OPTIMA = Path(__file__).parents[1] / "results" / "sea_snake" / "optima.csv"


def swim_environment() -> gymnasium.Env:
    """The training environment."""
    return gymnasium.make("snakebench.envs:snakebench/Swim-v0", engine="planar", physics_rate=90, feels=FEELS)


def trained_model(steps: int, seed: int, log: str | None) -> PPO:
    """PPO trained for a number of control steps."""
    torch.set_num_threads(1)  # faster than several for a small network
    environments = make_vec_env(swim_environment, n_envs=4, seed=seed)
    model = PPO(
        "MlpPolicy", environments, n_steps=min(512, -(-steps // 4)), seed=seed, device="cpu", tensorboard_log=log
    )
    return model.learn(steps)


def best_sea_snake() -> sb.SeaSnake | None:
    """The best gait for all fluids in the committed results; None if these are missing."""
    if not OPTIMA.exists():
        return None
    rows = pd.read_csv(OPTIMA).query("objective == 'mean' and variant == 'finer step'")
    mean = rows.groupby(["amplitude", "frequency", "phase"])["return"].mean()
    amplitude, frequency, phase = mean.idxmax()
    return sb.SeaSnake(amplitude=amplitude, frequency=frequency, phase=phase)


def print_scores(name: str, controller: sb.Predictor | sb.SeaSnake) -> None:
    """Print one line for each fluid, evaluated like the published results."""
    for fluid in ("water", "oil1", "oil2"):
        run = sb.evaluate(controller, fluid=fluid, physics_rate=960)
        numbers = (run.speed, run.power, run.positive_power, run.cost_of_transport, run.episode_return)
        cells = "  ".join("undefined".rjust(9) if number is None else f"{number:9.3f}" for number in numbers)
        print(f"{name:10}  {fluid:6}  {run.status:8}  {cells}")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--steps", type=int, default=40_000, help="control steps of training")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--log", help="folder for TensorBoard")
    arguments = parser.parse_args()
    started = time.monotonic()
    model = trained_model(arguments.steps, arguments.seed, arguments.log)
    print(f"trained for {model.num_timesteps} control steps in {time.monotonic() - started:.0f} s\n")
    print(
        f"{'':10}  {'fluid':6}  {'status':8}  {'v [m/s]':>9}  {'P [W]':>9}  {'P+ [W]':>9}  {'CoT':>9}  {'return J':>9}"
    )
    print_scores("plain PPO", sb.Predictor(model, FEELS))
    if gait := best_sea_snake():
        print_scores("sea snake", gait)
