"""What a study costs beside its simulations: fronts, the evaluation cache, and a replay of what is cached.

pytest benchmarks/test_studies.py
"""

from __future__ import annotations

import numpy as np
import pytest

import snakebench as sb
from snakebench.execution import Case, Evaluator, evaluation_key
from snakebench.store import EvaluationCache
from snakebench.studies.fronts import front, simple_sum
from snakebench.studies.indicators import hypervolume
from snakebench.workers import open_workers

HERE = sb.Scenario(engine="planar", physics_rate=90)


def staircase(n: int, seed: int) -> np.ndarray:
    """A front of n points, in random order."""
    random = np.random.default_rng(seed)
    points = np.column_stack([np.sort(random.random(n)) ** 0.5, 30 * np.sort(random.random(n))])
    return random.permutation(points)


@pytest.mark.parametrize(
    "points", [staircase(100_000, 0), np.random.default_rng(0).random((100_000, 2))], ids=["front", "cloud"]
)
def test_front_and_hypervolume_of_100_000_points(benchmark, points):
    benchmark(lambda: hypervolume(points[front(points)], (0.0, 30.0)))


def test_simple_sum_of_three_fronts_of_300_points(benchmark):
    fronts = [staircase(300, seed) for seed in range(3)]
    benchmark(simple_sum, fronts)


@pytest.fixture
def cached(tmp_path):
    """A cache that knows how 2000 gaits swim, and the cases."""
    evaluation = sb.evaluate(sb.SinusoidalTorque(amplitude=1.0, frequency=0.5, phase=0.8), HERE)
    gaits = [sb.SinusoidalTorque(amplitude=a, frequency=0.5, phase=0.8) for a in np.linspace(0.1, 4, 2000)]
    cases = [Case(gait, HERE) for gait in gaits]
    with EvaluationCache(tmp_path) as cache:
        for case in cases:
            cache.put(evaluation_key(*case), evaluation.model_dump_json())
        yield cache, cases


def test_look_up_in_the_cache(benchmark, cached):
    cache, cases = cached
    key = evaluation_key(*cases[0])
    benchmark(cache.get, key)


def test_replay_of_2000_cached_evaluations(benchmark, cached):
    cache, cases = cached
    with open_workers(1) as workers:
        evaluate = Evaluator(cache, workers)
        benchmark(evaluate, cases)
    assert evaluate.computed == 0
