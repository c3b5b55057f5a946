"""Samplers: Optuna's ways to choose gaits, by name; each is asked for a batch, then told what its gaits are worth."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterable, Mapping, Sequence
from importlib import import_module
from importlib.util import find_spec

import optuna
from optuna.distributions import FloatDistribution
from optuna.samplers import BaseSampler, CmaEsSampler, GPSampler, RandomSampler, TPESampler
from optuna.trial import Trial, TrialState

from snakebench.errors import InvalidValue
from snakebench.registry import Registry

_SECONDS_PER_SQUARE = {"gp": 7e-4}  # of a search's gaits: 40 to 80 s to choose 300 [s]


def _tpe(seed: int, _batch: int) -> BaseSampler:
    """Tree-structured Parzen estimator; gaits of a batch are spread by a constant liar."""
    return TPESampler(seed=seed, constant_liar=True)


def _random(seed: int, _batch: int) -> BaseSampler:
    """Independent random gaits."""
    return RandomSampler(seed=seed)


def _cmaes(seed: int, batch: int) -> BaseSampler:
    """CMA-ES, a generation a batch: with Optuna's own 7, one gait in each batch of 8 would teach nothing."""
    return CmaEsSampler(seed=seed, popsize=max(batch, 4))


def _gp(seed: int, _batch: int) -> BaseSampler:
    """Gaussian process; with more threads Optuna's many small sums take three times the processor's time."""
    import_module("torch").set_num_threads(1)
    with warnings.catch_warnings(action="ignore", category=optuna.exceptions.ExperimentalWarning):
        return GPSampler(seed=seed, deterministic_objective=True)


# Name: the sampler for a seed and a batch.
SAMPLERS: Registry[Callable[[int, int], BaseSampler]] = Registry(
    "sampler", {"tpe": _tpe, "random": _random, "cmaes": _cmaes, "gp": _gp}
)


class Search:
    """One search for the largest value; neither workers nor interruptions change its course.

    Args:
        sampler: its name.
        seed: of its random numbers; with the same seed all samplers begin with the same random batch.
        batch: how many gaits are asked for at once.
        space: bounds of each parameter.
    """

    def __init__(self, sampler: str, seed: int, batch: int, space: Mapping[str, tuple[float, float]]) -> None:
        optuna.logging.set_verbosity(optuna.logging.WARNING)
        self._study = optuna.create_study(direction="maximize", sampler=SAMPLERS[sampler](seed, batch))
        self._space = {name: FloatDistribution(*bounds) for name, bounds in space.items()}
        self._asked: list[Trial] = []

    def ask(self, count: int) -> list[dict[str, float]]:
        """The parameters of the next `count` gaits."""
        self._asked = [self._study.ask(dict(self._space)) for _ in range(count)]
        return [trial.params for trial in self._asked]

    def tell(self, values: Sequence[float | None]) -> None:
        """What the gaits last asked for are worth, in their order; None for one that is worth nothing."""
        for trial, value in zip(self._asked, values, strict=True):
            self._study.tell(trial, value, state=TrialState.FAIL if value is None else TrialState.COMPLETE)


def check_samplers(names: Iterable[str]) -> None:
    """Make sure that these samplers can be used here.

    Raises:
        InvalidValue: when a package is missing, with the command that installs it.
    """
    if "gp" in names and find_spec("torch") is None:
        raise InvalidValue('sampler gp needs the package torch: pip install "snakebench[gp]", or compare others')


def choosing_seconds(sampler: str, gaits: int) -> float:
    """About how long a sampler takes to choose so many gaits, one search after the other in one process [s]."""
    return _SECONDS_PER_SQUARE.get(sampler, 0.0) * gaits**2
