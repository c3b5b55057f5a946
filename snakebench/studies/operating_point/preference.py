"""The preference at which a policy takes the power of the paper's policy, by root finding in the planar engine."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize.elementwise import find_root

from snakebench.execution import Case, Evaluator
from snakebench.policy import Policy
from snakebench.scenario import Scenario
from snakebench.value import FloatArray

ROUNDS = 12  # evaluations at most: both ends of the range, and steps of Chandrupatla's method
_TOO_MUCH = 1e4  # stands for the power of a swim that diverged [W]


@dataclass(frozen=True, kw_only=True)
class Search:
    """A policy that is to take a mean command power P in a scenario."""

    policy: Policy
    scenario: Scenario
    power: float  # [W]
    prices: tuple[float, float]  # of power, that the policy was trained in [1/W]

    def price(self, log_price: float) -> float:
        """A price by its logarithm [1/W]; rounding at the ends does not leave the range."""
        return float(np.clip(np.exp(log_price), *self.prices))


@dataclass(frozen=True, kw_only=True)
class Solution:
    """What a search found."""

    price: float  # of power [1/W]
    match: str  # "solved", or on which side of the power the nearest of the policy's powers is: "below" or "above"
    searches: int  # evaluations


def solve(searches: Sequence[Search], evaluate: Evaluator, tolerance: float) -> list[Solution]:
    """The price of power of each search, at which P is within a relative tolerance, or as near as the policy gets.

    All searches advance together, so that workers share each round's evaluations.
    """
    targets = np.array([search.power for search in searches])
    low, high = np.log([search.prices for search in searches]).T

    def excess(log_prices: FloatArray, lanes: NDArray[np.int_]) -> FloatArray:
        """P over the power asked for, less 1, of some of the searches at a price each."""
        tried = [(searches[lane], float(log)) for log, lane in zip(log_prices, lanes, strict=True)]
        answers = evaluate([Case(search.policy.at(search.price(log)), search.scenario) for search, log in tried])
        powers = [_TOO_MUCH if answer.power is None else answer.power for answer in answers]
        return np.array(powers) / targets[lanes] - 1

    lanes = np.arange(len(searches))
    found = find_root(excess, (low, high), args=(lanes,), tolerances={"fatol": tolerance}, maxiter=ROUNDS - 2)
    ends, excesses = np.array(found.bracket), np.array(found.f_bracket)
    nearest, at = np.abs(excesses).argmin(axis=0), lanes
    logs = np.where(np.isnan(found.x), ends[nearest, at], found.x)
    left = np.where(np.isnan(found.x), excesses[nearest, at], found.f_x)
    matches = np.where(np.abs(left) <= tolerance, "solved", np.where(left > 0, "above", "below"))
    return [
        Solution(price=search.price(float(log)), match=str(match), searches=int(count))
        for search, log, match, count in zip(searches, logs, matches, found.nfev, strict=True)
    ]
