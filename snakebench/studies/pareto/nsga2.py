"""A search for the front of speed against power by pymoo's NSGA-II."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from pymoo.algorithms.moo.nsga2 import NSGA2
from pymoo.core.evaluator import Evaluator
from pymoo.core.problem import Problem
from pymoo.operators.crossover.sbx import SBX
from pymoo.operators.mutation.pm import PM
from pymoo.operators.sampling.lhs import LHS
from pymoo.problems.static import StaticProblem

from snakebench.value import FloatArray

# Fronts of gaits come in branches that no small step connects: children are spread wider than by pymoo's own 15 and 20.
_SPREAD = 5
_WORST = 1e6  # cost of what may enter no front; far beyond any other


def evolved(
    evaluate: Callable[[FloatArray], FloatArray], bounds: FloatArray, population: int, generations: int, seed: int
) -> FloatArray:
    """Search by NSGA-II for fast and thrifty gaits.

    Args:
        evaluate: gives speed and power of the gaits of a generation, shape (population, 2), from their parameters,
            shape (population, n_parameters); NaN for what may enter no front.
        bounds: lowest and highest value of each parameter, shape (2, n_parameters).
        population: how many gaits a generation has.
        generations: how many there are.
        seed: of the search.

    Returns:
        The parameters of the last population, shape (population, n_parameters).
    """
    problem = Problem(n_var=bounds.shape[1], n_obj=2, xl=bounds[0], xu=bounds[1])
    crossover, mutation = SBX(prob=0.9, eta=_SPREAD), PM(prob=0.9, eta=_SPREAD)
    algorithm = NSGA2(pop_size=population, sampling=LHS(), crossover=crossover, mutation=mutation)
    algorithm.setup(problem, termination=("n_gen", generations), seed=seed, verbose=False)
    while algorithm.has_next():
        asked = algorithm.ask()
        costs = np.nan_to_num(evaluate(asked.get("X")) * (-1, 1), nan=_WORST)
        Evaluator().eval(StaticProblem(problem, F=costs), asked)
        algorithm.tell(infills=asked)
    parameters: FloatArray = algorithm.pop.get("X")
    return parameters
