"""Evaluations leave nothing behind in the memory of the process that makes them."""

from __future__ import annotations

import gc
import random
import resource
from pathlib import Path

import numpy as np
import pytest

import snakebench as sb
from snakebench.policy import Card

WARM, MOST = 2_000, 6.0  # evaluations until all is loaded, and what may grow after [MB]


def resident() -> float:
    """Memory of this process [MB]."""
    gc.collect()
    return int(Path("/proc/self/statm").read_text().split()[1]) * resource.getpagesize() / 1e6


def controllers(rng: random.Random):
    """Gaits and policies, none like the one before."""
    card = Card(mlp=(8,), lstm=(4,))
    while True:
        numbers = {"frequency": rng.uniform(0.3, 2), "phase": rng.uniform(-2, 2)}
        yield sb.SinusoidalTorque(amplitude=rng.uniform(0.1, 5), **numbers)
        yield sb.SeaSnake(amplitude=rng.uniform(0.1, 1.5), **numbers)
        wave = tuple(tuple(rng.uniform(-1, 1) for _ in range(7)) for _ in range(2))
        yield sb.Fourier(frequency=numbers["frequency"], cosine=wave, sine=wave)
        shapes = card.shapes().items()
        noise = np.random.default_rng(rng.randrange(2**32))
        yield sb.Policy(card, {name: noise.normal(size=shape).astype(np.float32) for name, shape in shapes})


@pytest.mark.slow
@pytest.mark.skipif(not Path("/proc/self/statm").exists(), reason="only Linux tells the memory so")
def test_24_000_evaluations_in_one_process_do_not_grow_it():
    rng, fluids = random.Random(5), ("water", "oil1", "oil2")
    warm = 0.0
    for k, controller in zip(range(24_000), controllers(rng), strict=False):
        if k == WARM:
            warm = resident()
        engine = ("planar", "pybullet")[k // 4 % 2]
        scenario = sb.Scenario(
            engine=engine, fluid=sb.named_fluid(rng.choice(fluids)), duration=rng.choice((0.2, 0.2, 0.2, 0.5))
        )
        assert sb.evaluate(controller, scenario).status in {"ok", "diverged", "invalid"}
    grown = resident() - warm
    print(f"{grown:.1f} MB more than after {WARM} evaluations, {warm:.0f} MB")
    assert grown < MOST
