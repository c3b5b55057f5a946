"""Seconds of a solution of the limit, from the optimum of a neighbouring power, in both currencies and two fluids.

pytest benchmarks/test_limit.py
"""

import pytest

import snakebench as sb
from snakebench.collocation.solver import Goal, Optimum, plain, solve
from snakebench.collocation.starts import steady_cycle
from snakebench.collocation.transcription import Mesh

ROBOT = sb.Robot()
WAVE = sb.SeaSnake(amplitude=1.2, frequency=0.9, phase=0.5)
ITSELF = ROBOT.model_dump(mode="json")


def goal(fluid, currency, power):
    return list(Goal(fluid.kinematic_viscosity, fluid.density, currency, power, 1.0))


@pytest.mark.parametrize("name", ["water", "oil2"])
@pytest.mark.parametrize("mesh", [Mesh(12), Mesh(16, 2)], ids=["coarse", "fine"])
@pytest.mark.parametrize("currency", ["net", "positive"])
def test_a_solution_from_a_neighbouring_power(benchmark, currency, mesh, name):
    fluid = sb.named_fluid(name)
    cycle = plain(steady_cycle(WAVE, ROBOT, fluid, mesh, 1.0))
    before = Optimum(*solve(ITSELF, goal(fluid, currency, 10.0), list(mesh), cycle, False))
    arguments = (ITSELF, goal(fluid, currency, 9.0), list(mesh), before.cycle, True)
    found = Optimum(*benchmark.pedantic(solve, arguments, rounds=3, warmup_rounds=0))
    benchmark.extra_info["iterations"] = found.iterations
    assert found.found
