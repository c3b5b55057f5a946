"""Vector rewards (v, -P): the best of twenty travelling waves for several prices of a joule.

    python examples/mo_swim.py --steps 9000

Each wave swims one episode in oil1. Its vector return is the distance [m] and the negative work [J]. The higher the
price of a joule, the less work the best wave does. The best wave is always on the Pareto front.
"""

from __future__ import annotations

import argparse
from itertools import product

import gymnasium
import numpy as np

PRICES = (0.001, 0.01, 0.1)  # price of a joule [m/J]


def wave(amplitude: float, frequency: float, step: int) -> np.ndarray:
    """Target angles of the seven joints [rad] at a control step."""
    return amplitude * np.sin(2 * np.pi * frequency * step / 30 - 0.7 * np.arange(7))


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--steps", type=int, default=9000, help="total number of control steps, at least one per wave")
    arguments = parser.parse_args()
    waves = list(product((0.2, 0.4, 0.6, 0.8, 1.0), (0.3, 0.6, 0.9, 1.2)))
    seconds = max(arguments.steps // len(waves), 1) / 30
    environment = gymnasium.make(
        "snakebench.envs:snakebench/MO-Swim-v0",
        engine="planar",
        fluid="oil1",
        duration=seconds,
        max_episode_steps=-1,
    )
    returns = np.zeros((len(waves), 2))
    for k, (amplitude, frequency) in enumerate(waves):
        environment.reset()
        over, step = False, 0
        while not over:
            _, reward, terminated, truncated, _ = environment.step(wave(amplitude, frequency, step))
            returns[k] += reward
            over, step = terminated or truncated, step + 1
    better = (returns[:, None] <= returns).all(axis=2) & (returns[:, None] < returns).any(axis=2)
    front = ~better.any(axis=1)
    print(f"{len(waves)} waves, {seconds:.1f} s each in oil1; {front.sum()} are on the front")
    for price in PRICES:
        best = int(np.argmax(returns @ [1.0, price]))
        amplitude, frequency = waves[best]
        distance, work = returns[best] * [1, -1]
        print(f"at {price:5} m/J: {amplitude} rad at {frequency} Hz, {distance:.3f} m for {work:.2f} J")
