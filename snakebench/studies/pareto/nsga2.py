"""pymoo's NSGA-II by ask and tell: generations of parameters come out, their speed and power go in."""

from __future__ import annotations

from collections.abc import Iterator

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


class Evolution:
    """A seeded search by NSGA-II for fast and thrifty gaits.

    Args:
        bounds: lowest and highest value of each parameter, shape (2, n_parameters).
        population: how many gaits a generation has.
        generations: how many there are.
        seed: of the search.
    """

    def __init__(self, bounds: FloatArray, population: int, generations: int, seed: int) -> None:
        self._problem = Problem(n_var=bounds.shape[1], n_obj=2, xl=bounds[0], xu=bounds[1])
        self._algorithm = NSGA2(
            pop_size=population,
            sampling=LHS(),
            crossover=SBX(prob=0.9, eta=_SPREAD),
            mutation=PM(prob=0.9, eta=_SPREAD),
        )
        self._algorithm.setup(self._problem, termination=("n_gen", generations), seed=seed, verbose=False)

    def generations(self) -> Iterator[FloatArray]:
        """The parameters of each generation, shape (population, n_parameters); tell their points before the next."""
        while self._algorithm.has_next():
            self._asked = self._algorithm.ask()
            yield self._asked.get("X")

    def survivors(self) -> FloatArray:
        """The parameters of the population as it is now, shape (population, n_parameters)."""
        return self._algorithm.pop.get("X")

    def tell(self, points: FloatArray) -> None:
        """Speed and power of the generation, shape (population, 2); NaN for what may enter no front."""
        costs = np.nan_to_num(points * (-1, 1), nan=_WORST)
        Evaluator().eval(StaticProblem(self._problem, F=costs), self._asked)
        self._algorithm.tell(infills=self._asked)
