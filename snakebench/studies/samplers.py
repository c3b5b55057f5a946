"""Samplers: Optuna's ways to choose gaits, by name, in searches that ask for a batch and then learn its values."""

import sqlite3
import warnings
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import closing, contextmanager
from functools import partial
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path

import optuna
from optuna.distributions import FloatDistribution
from optuna.samplers import BaseSampler, CmaEsSampler, GPSampler, RandomSampler, TPESampler
from optuna.storages import RDBStorage
from optuna.trial import FrozenTrial, Trial, TrialState

from snakebench.errors import InvalidValue, StoreError, missing
from snakebench.files import writable_file
from snakebench.registry import Registry, to_be_called
from snakebench.studies.search_settings import Space

StoredStudy = Callable[[Sequence[FrozenTrial]], None]  # adds finished trials to a study in a file
CHOOSING_SECONDS = {"gp": 7e-4}  # of a search, by the square of its gaits: 40 to 80 s to choose 300 [s]
_experimental = partial(warnings.catch_warnings, action="ignore", category=optuna.exceptions.ExperimentalWarning)
optuna.logging.set_verbosity(optuna.logging.WARNING)  # else it reports every study


def _gp(seed: int, _batch: int) -> BaseSampler:
    """Gaussian process; with more threads Optuna's many small sums take three times the processor's time."""
    import_module("torch").set_num_threads(1)
    with _experimental():
        return GPSampler(seed=seed, deterministic_objective=True)


# The sampler for a seed and a batch. A constant liar spreads a batch of TPE. A generation of CMA-ES is a batch:
# with Optuna's own 7, one gait in each batch of 8 would teach nothing.
_OPTUNAS: dict[str, Callable[[int, int], BaseSampler]] = {
    "tpe": lambda seed, _: TPESampler(seed=seed, constant_liar=True),
    "random": lambda seed, _: RandomSampler(seed=seed),
    "cmaes": lambda seed, batch: CmaEsSampler(seed=seed, popsize=max(batch, 4)),
    "gp": _gp,
}
SAMPLERS = Registry("sampler", _OPTUNAS, to_be_called)


class StoredStudies:
    """Optuna studies in a SQLite file, for dashboards: searches write their trials there, and never read them.

    Raises:
        InvalidValue: when the path is no plain one, or the file that is there is no storage of Optuna.
        StoreError: from all methods, when it cannot be written.
    """

    def __init__(self, path: Path) -> None:
        if "?" in str(path) or "sqlite:" in str(path):
            raise InvalidValue(f"optuna = {path}: the path of a file is needed, such as studies.db, no URL")
        self.path = writable_file(path)
        if not _is_storage(self.path):
            raise InvalidValue(f"optuna = {path}: what is there is no storage of Optuna, another path is needed")
        with _written(self.path):
            self._storage = RDBStorage(f"sqlite:///{self.path}")

    def begin(self, name: str, value: str, **attributes: object) -> StoredStudy:
        """Begin a study of a value in place of one of that name, if there is one."""
        with _written(self.path), _experimental():
            if name in optuna.get_all_study_names(self._storage):
                optuna.delete_study(study_name=name, storage=self._storage)
            study = optuna.create_study(study_name=name, storage=self._storage, direction="maximize")
            study.set_metric_names([value])
            for key, attribute in attributes.items():
                study.set_user_attr(key, attribute)

        def add(trials: Sequence[FrozenTrial]) -> None:
            with _written(self.path):
                for trial in trials:
                    trial.system_attrs = {}  # the sampler's own notes
                study.add_trials(trials)

        return add

    def close(self) -> None:
        """Free the file."""
        self._storage.remove_session()
        self._storage.engine.dispose()


class Search:
    """One search for the largest value; with the same seed all samplers begin with the same random batch."""

    def __init__(self, sampler: str, seed: int, batch: int, space: Space, stored: StoredStudy | None = None) -> None:
        self._study = optuna.create_study(direction="maximize", sampler=SAMPLERS[sampler](seed, batch))
        self._space = {name: FloatDistribution(*bounds) for name, bounds in space.items()}
        self._asked: list[Trial] = []
        self._stored = stored

    def ask(self, count: int) -> list[dict[str, float]]:
        """The parameters of the next `count` gaits."""
        self._asked = [self._study.ask(dict(self._space)) for _ in range(count)]
        return [trial.params for trial in self._asked]

    def tell(self, values: Sequence[float | None]) -> None:
        """What the gaits last asked for are worth, in their order; None for one that is worth nothing."""
        trials = [
            self._study.tell(trial, value, state=TrialState.FAIL if value is None else TrialState.COMPLETE)
            for trial, value in zip(self._asked, values, strict=True)
        ]
        if self._stored:
            self._stored(trials)


def check_samplers(names: Iterable[str]) -> None:
    """Make sure that these samplers can be used here: an error names the command that installs what is missing."""
    if "gp" in names and find_spec("torch") is None:
        raise missing("sampler gp", "torch", "gp")


def _is_storage(path: Path) -> bool:
    """Whether a file is missing or empty, or a database that Optuna has made: others must not get its tables."""
    try:
        with closing(sqlite3.connect(f"{path.as_uri()}?mode=ro", uri=True)) as database:
            tables = [name for (name,) in database.execute("SELECT name FROM sqlite_master")]
    except sqlite3.OperationalError:  # missing, locked or closed: Optuna makes it, or says so when it opens it
        return True
    except sqlite3.Error:
        return False
    return not tables or "version_info" in tables


@contextmanager
def _written(path: Path) -> Iterator[None]:
    try:
        yield
    except Exception as error:  # SQLite's, SQLAlchemy's, Alembic's or, of a version, Optuna's own
        reason = str(error.__cause__ or error).splitlines()[0]
        raise StoreError(f"cannot write Optuna's studies to {path}: {reason}") from error
