"""Intervals of means over seeds, and of comparisons between sides that both have seeds."""

from collections.abc import Sequence

import numpy as np
from scipy import stats

from snakebench.value import FloatArray


def confidence_interval(*samples: FloatArray) -> tuple[float, float] | None:
    """95 % interval of a mean, or of the sum of the means of independent samples; None without two values in any.

    Student's t of one sample; of several Welch's, with the degrees of freedom of Satterthwaite. A sample of one value
    counts as exact.
    """
    parts = [(float(np.var(sample, ddof=1)) / len(sample), len(sample) - 1) for sample in samples if len(sample) > 1]
    if not parts:
        return None
    center, variance = sum(float(np.mean(sample)) for sample in samples), sum(part for part, _ in parts)
    if variance == 0:
        return center, center
    freedom = variance**2 / sum(part**2 / degrees for part, degrees in parts)
    half = float(np.sqrt(variance) * stats.t.ppf(0.975, freedom))
    return center - half, center + half


def comparison_interval(values: Sequence[float], opponents: Sequence[float] = ()) -> tuple[float, float] | None:
    """95 % interval of the mean of a comparison of every seed of one side with every seed of the other.

    `values` are its means by the seeds of the one, `opponents` by those of the other; none if that has no seeds. Of
    differences it is Welch's interval.
    """
    other = np.asarray(opponents, float)
    return confidence_interval(np.asarray(values, float), *([other - other.mean()] if len(other) else []))
