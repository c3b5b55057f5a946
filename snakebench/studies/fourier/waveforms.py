"""The search for a free periodic waveform: its goals, their order and budgets, and one CMA-ES search of them."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product
from typing import NamedTuple

import numpy as np
from cmaes import CMA

from snakebench.controllers import Fourier
from snakebench.errors import InvalidValue
from snakebench.evaluation import Evaluation
from snakebench.execution import Case
from snakebench.scenario import Scenario
from snakebench.studies.fourier.settings import FourierConfig
from snakebench.studies.swim_rows import Row
from snakebench.value import FloatArray

WORST = -1e9  # value of a gait that did not swim validly; finite, since CMA-ES ranks it
_AMPLITUDE, _FREQUENCY, _PHASE = 0.4, 0.7, 0.8  # of the wave that searches start from [rad, Hz, rad]


class Goal(NamedTuple):
    """What a search maximises with how many harmonics: the return J, or 10 v - price P; of several fluids the mean."""

    harmonics: int
    price: float | None  # [1/W]; None for the return

    def value(self, swims: Sequence[Evaluation]) -> float:
        """How good a gait is by its swims, one in each fluid [1]; very bad unless all are valid and wholly defined.

        A power below zero, which a run that has not settled may show, is no valid one: a price would pay for it.
        """
        values = []
        for swim in swims:
            v, p, earned = swim.speed, swim.power, swim.episode_return
            if swim.status != "ok" or v is None or p is None or earned is None or p < 0:
                return WORST
            values.append(earned if self.price is None else 10 * v - self.price * p)
        return sum(values) / len(values)


class Tuning:
    """One CMA-ES search by ask and tell: first the gaits that it starts from, then whole generations.

    It starts from the optima of `earlier` searches, or from the travelling wave a_i(t) = 0.4 rad sin(2 pi 0.7 Hz t +
    (N - i) 0.8 rad). The variables are the logarithm of the base frequency, then for each harmonic the cosine and the
    sine amplitude of every joint [rad], bounded by -1 and 1.

    Attributes:
        tuned_to: the name of the objective.
        fluids: in which every gait swims.
        value: of the best gait found so far.
        tried: how many gaits were evaluated, with those for the same objective with fewer harmonics.
    """

    def __init__(
        self, config: FourierConfig, goal: Goal, tuned_to: str, seed: int, earlier: Sequence[Tuning] = ()
    ) -> None:
        self.goal, self.tuned_to, self.seed, self.value = goal, tuned_to, seed, -np.inf
        self.fluids = config.objectives()[tuned_to]
        self.tried: int = sum(search.tried for search in earlier if search.goal.price == goal.price)
        self._config, self._n_joints = config, config.robot.n_joints
        size = 1 + goal.harmonics * 2 * self._n_joints
        starts = [search._point for search in earlier] or [_wave(config)]
        self._asked = [np.pad(start, (0, size - len(start))) for start in starts]
        self._point: FloatArray = self._asked[0]
        self._optimizer: CMA | None = None

    def labels(self) -> Row:
        """The cells of a table that identify the search."""
        objective = "return" if self.goal.price is None else "price"
        goal = {"harmonics": self.goal.harmonics, "objective": objective, "price": self.goal.price}
        return {"tuned_to": self.tuned_to, **goal, "seed": self.seed}

    def gait(self) -> Fourier:
        """The best gait found so far."""
        return _gait(self._point, self._n_joints)

    def case(self, gait: Fourier, scenario: Scenario) -> Case:
        """A swim: J is of a fixed time, speed and power are of gaits that have settled."""
        settled = self.goal.price is not None
        return Case(gait, scenario.but(duration=self._config.settling(gait)) if settled else scenario)

    def ask(self) -> list[Case]:
        """The next gaits to evaluate, each in all fluids."""
        if self._optimizer:
            self._asked = [self._optimizer.ask() for _ in range(self._optimizer.population_size)]
        scenarios = [self._config.variants(fluid)["searched"] for fluid in self.fluids]
        gaits = [_gait(point, self._n_joints) for point in self._asked]
        return [self.case(gait, scenario) for gait, scenario in product(gaits, scenarios)]

    def tell(self, evaluations: Sequence[Evaluation]) -> None:
        """Learn from the evaluations of the cases last asked for."""
        by_gait = zip(*[iter(evaluations)] * len(self.fluids), strict=True)
        values = [(point, self.goal.value(swims)) for point, swims in zip(self._asked, by_gait, strict=True)]
        self.tried += len(values)
        for point, value in values:
            if value > self.value:
                self._point, self.value = point, value
        if self._optimizer:
            self._optimizer.tell([(point, -value) for point, value in values])
        else:
            self._optimizer = self._started()

    def _started(self) -> CMA:
        config, goal = self._config, self.goal
        amplitudes = np.tile([-1.0, 1.0], (len(self._point) - 1, 1))
        stream = np.random.SeedSequence([self.seed, goal.harmonics, _stage(config, goal)])
        return CMA(
            mean=self._point,
            sigma=config.step if goal == goals(config)[0] else config.continued_step,
            bounds=np.vstack([np.log(config.frequency), amplitudes]),
            seed=int(stream.generate_state(1)[0]),
            population_size=_population(config, goal),
        )


def goals(config: FourierConfig) -> list[Goal]:
    """All goals, in an order in which each comes after those whose optima it starts from."""
    return [Goal(harmonics, price) for harmonics, price in product(config.harmonics, (None, *config.prices))]


def before(config: FourierConfig, goal: Goal) -> list[Goal]:
    """The goals whose optima a goal starts from, each search from those of its own seed; none for the first goal.

    These are the optimum at the price before, or that of J for the cheapest price; and, with more harmonics, the
    optimum of the same objective with fewer, so that no objective falls as harmonics are added.
    """
    stage, more = _stage(config, goal), config.harmonics.index(goal.harmonics)
    cheaper = [Goal(goal.harmonics, (None, *config.prices)[stage - 1])] if stage else []
    fewer = [Goal(config.harmonics[more - 1], goal.price)] if more else []
    return cheaper + fewer


def budget(config: FourierConfig, goal: Goal) -> tuple[int, int]:
    """Of a search, how many generations follow its starts, as many whole ones as the settings allow, and all its gaits.

    Raises:
        InvalidValue: when there is no room for a generation.
    """
    name = "trials" if goal.price is None else "price_trials"
    each, starts, population = getattr(config, name), len(before(config, goal)) or 1, _population(config, goal)
    generations = (each * goal.harmonics - starts) // population
    if generations < 1:
        needed = -(-(starts + population) // goal.harmonics)
        raise InvalidValue(f"{name} = {each}: at least {needed} are needed for a generation of {population} gaits")
    return generations, starts + population * generations


def _stage(config: FourierConfig, goal: Goal) -> int:
    """How many objectives come before that of a goal, with as many harmonics."""
    return (None, *config.prices).index(goal.price)


def _population(config: FourierConfig, goal: Goal) -> int:
    return config.population or 4 + int(3 * np.log(1 + goal.harmonics * 2 * config.robot.n_joints))


def _wave(config: FourierConfig) -> FloatArray:
    """The travelling wave as a point of the search space with one harmonic."""
    phase = np.arange(config.robot.n_joints - 1, -1, -1) * _PHASE
    frequency = np.clip(np.log(_FREQUENCY), *np.log(config.frequency))
    return np.hstack([frequency, _AMPLITUDE * np.sin(phase), _AMPLITUDE * np.cos(phase)])


def _gait(point: FloatArray, n_joints: int) -> Fourier:
    cosine, sine = point[1:].reshape(-1, 2, n_joints).transpose(1, 0, 2).tolist()
    return Fourier(frequency=float(np.exp(point[0])), cosine=tuple(map(tuple, cosine)), sine=tuple(map(tuple, sine)))
