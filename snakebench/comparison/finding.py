"""What a judge of a claim returns, and the conditions that rules are made of."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from snakebench.comparison.results import Measurement, Results

Numbers = dict[str, Measurement]  # by place


class Finding(NamedTuple):
    """What a judge found: numbers by label and place, with their digits, and whether each part of the rule holds."""

    measured: Mapping[str, tuple[Mapping[str, Measurement], int]]
    holds: Sequence[bool]


Judge = Callable[[Results, Mapping[str, Any]], Finding]


def above(measurement: Measurement, bound: float) -> bool:
    """Whether a mean is above a bound with its whole interval."""
    return (measurement.interval or (measurement.mean,))[0] > bound


def below(measurement: Measurement, bound: float) -> bool:
    """Whether a mean is below a bound with its whole interval."""
    return (measurement.interval or (measurement.mean,))[-1] < bound


def rising(measurements: Sequence[Measurement]) -> bool:
    """Whether values rise from each measurement to the next, for every seed."""
    return bool((np.diff([one.values for one in measurements], axis=0) > 0).all())
