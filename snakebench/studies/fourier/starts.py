"""Gaits of the limit of the body as starts of searches: at a price of power, the gait for which a watt is worth it."""

from pathlib import Path

import numpy as np

from snakebench.collocation.front import gait_at, under_first_bounds
from snakebench.controllers import PeriodicTargets
from snakebench.studies.contenders import read_limit
from snakebench.studies.fourier.settings import FourierConfig
from snakebench.value import FloatArray

_SAMPLES = 512  # of a period
Starts = dict[tuple[str, str], dict[float, PeriodicTargets]]  # by fluid and currency: gaits by dv/dP [m/s/W]


def limit_starts(config: FourierConfig, results: Path) -> Starts:
    """The published gaits of the limit under its first bounds; none without a study of it.

    Raises:
        InvalidValue: when its results are not there, or of another robot.
    """
    starts: Starts = {}
    if not config.limit:
        return starts
    limit, gaits, settings = read_limit(config, results, config.limit)
    for _, row in under_first_bounds(limit, settings).iterrows():
        starts.setdefault((row["fluid"], row["currency"]), {})[row["multiplier"]] = gait_at(gaits, row)
    return starts


def start_at(gaits: dict[float, PeriodicTargets], price: float, harmonics: int) -> FloatArray:
    """The harmonics of the gait for which one more watt buys 10 v of `price`, as a point of a search.

    That is the logarithm of its frequency, then the cosine and sine amplitudes of each harmonic [rad].
    """
    gait = gaits[min(gaits, key=lambda worth: abs(np.log(max(worth, 1e-9) * 10 / price)))]
    times = np.arange(_SAMPLES) / _SAMPLES * gait.period
    spectrum = np.fft.rfft(gait.commands(times, len(gait.targets[0])), axis=0)[1 : harmonics + 1] * 2 / _SAMPLES
    amplitudes = np.stack([spectrum.real, -spectrum.imag], axis=1)
    return np.concatenate([[-np.log(gait.period)], np.clip(amplitudes, -1.0, 1.0).ravel()])
