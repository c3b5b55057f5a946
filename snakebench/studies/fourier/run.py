"""Fourier study: CMA-ES tunes a free periodic waveform of target angles, per fluid and for all: the open-loop bound.

It maximises the return J, and 10 v less a price of power, P or P+, at many prices, which trace a front of speed against
each of both (ours).
It separates what a learned policy gains by the free waveform, by feedback, and by knowing the fluid.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import chain, product
from typing import NamedTuple

import numpy as np
import pandas as pd
from cmaes import CMA

from snakebench.controllers import Fourier
from snakebench.errors import InvalidValue
from snakebench.evaluation import Evaluation
from snakebench.execution import Case, Evaluator
from snakebench.names import CURRENCIES, FINE
from snakebench.scenario import Scenario
from snakebench.studies import fronts
from snakebench.studies.columns import WAVEFORM
from snakebench.studies.fourier.settings import FourierConfig
from snakebench.studies.fourier.starts import Starts, limit_starts, start_at
from snakebench.studies.protocol import Load, Outcome, Row, Swim, numerics, swim_rows
from snakebench.value import FloatArray

_OBJECTIVES = {"net": "price", "positive": "positive price"}  # of searches at a price of power, by its currency
_WORST = -1e9  # value of a gait that did not swim validly; finite, since CMA-ES ranks it
_STEP = 0.1  # first standard deviation of a search, of its amplitudes [rad] and of ln f
_CONTINUED_STEP = 0.05  # of one that starts at another search's optimum
_AMPLITUDE, _FREQUENCY, _PHASE = 0.4, 0.7, 0.8  # of the wave that searches start from [rad, Hz, rad]


def plan(config: FourierConfig) -> list[Load]:
    """What the study evaluates, if every budget is enough for a generation."""
    swims, gaits = len(config.seeds) * sum(map(len, config.objectives().values())), 0
    for goal, earlier in _goals(config).items():
        starts = _starts(config, goal, earlier)
        gaits += starts + _population(config, goal) * _generations(config, goal, starts)
    variants = config.variants(config.fluids[0])
    optima = [Load("angle", scenario, swims * len(_goals(config))) for scenario in variants.values()]
    return [Load("angle", variants["searched"], swims * gaits), *optima]


def run(config: FourierConfig, evaluate: Evaluator) -> Outcome:
    """Search for every goal in each fluid, and in all of several at once, with every seed; and verify each optimum."""
    searches, growth = _searched(config, evaluate)
    optima = pd.DataFrame(swim_rows(evaluate, _verified(config, searches)))
    points = fronts.fronts_of(config, {"fourier": fronts.beside_searched(optima, "searched")}, list(WAVEFORM))
    tables = {
        "growth": pd.DataFrame(growth),
        "optima": optima,
        "gaits": pd.DataFrame(row for search in searches for row in _coefficients(search)),
        **fronts.front_tables(config, points),
    }
    return Outcome(tables, dict(_shown(config, searches)))


def _searched(config: FourierConfig, evaluate: Evaluator) -> tuple[list[Tuning], list[Row]]:
    """All searches, done, and the table `growth`; each starts from the earlier ones of the same objective and seed."""
    by_goal, limit = dict[Goal, list[Tuning]](), limit_starts(config, evaluate.results)
    growth: list[Row] = []
    for goal, earlier in _goals(config).items():
        by_goal[goal] = [
            Tuning(config, goal, tuned_to, seed, [by_goal[other][place] for other in earlier], limit)
            for place, (tuned_to, seed) in enumerate(product(config.objectives(), config.seeds))
        ]
        growth += _advance(evaluate, by_goal[goal], 1 + _generations(config, goal, _starts(config, goal, earlier)))
        for search in by_goal[goal]:
            if search.value == _WORST:
                raise InvalidValue(
                    f"{config.name}: no gait swam validly in {' and '.join(search.fluids)}: other fluids, other bounds"
                    " of the frequency, more trials or a longer duration are needed"
                )
    return list(chain.from_iterable(by_goal.values())), growth


def _advance(evaluate: Evaluator, searches: list[Tuning], times: int) -> Iterator[Row]:
    """Let searches of one goal advance together; large batches keep all workers busy."""
    for _ in range(times):
        asked = [search.ask() for search in searches]
        evaluations = iter(evaluate([case for cases in asked for case in cases]))
        for search, cases in zip(searches, asked, strict=True):
            search.tell([next(evaluations) for _ in cases])
            yield search.labels() | {"gaits": search.tried, "best": search.value}


def _verified(config: FourierConfig, searches: list[Tuning]) -> Iterator[Swim]:
    """The optimum of every search in each of its fluids and every variant."""
    for search in searches:
        for fluid in search.fluids:
            for variant, scenario in config.variants(fluid).items():
                labels = search.labels() | {"value": search.value, "fluid": fluid, "variant": variant}
                yield labels | numerics(scenario), search.case(search.gait(), scenario)


def _coefficients(search: Tuning) -> Iterator[Row]:
    gait = search.gait()
    for harmonic, (cosines, sines) in enumerate(zip(gait.cosine, gait.sine, strict=True), start=1):
        for joint, (cosine, sine) in enumerate(zip(cosines, sines, strict=True), start=1):
            place = {"frequency": gait.frequency, "joint": joint, "harmonic": harmonic}
            yield search.labels() | place | {"cosine": cosine, "sine": sine}


def _shown(config: FourierConfig, searches: list[Tuning]) -> Iterator[tuple[str, Case]]:
    """The gait of the highest return of each objective in its fluids, by name."""
    for tuned_to, fluids in config.objectives().items():
        of_return = [search for search in searches if search.tuned_to == tuned_to and search.goal.price is None]
        best = max(of_return, key=lambda search: search.value)
        for fluid in fluids:
            name = fluid if tuned_to == fluid else f"{tuned_to}-{fluid}"
            yield name, best.case(best.gait(), config.variants(fluid)[FINE])


class Goal(NamedTuple):
    """What a search maximises with how many harmonics: the return J, or 10 v less a price times P or P+.

    Of several fluids it is the mean.
    """

    harmonics: int
    price: float | None  # [1/W]; None for the return
    stage: int = 0  # how many objectives come before it, with as many harmonics
    currency: str = "net"  # of the power that has the price

    @property
    def objective(self) -> str:
        """Its name in tables; with the price it identifies what is maximised."""
        return "return" if self.price is None else _OBJECTIVES[self.currency]

    def value(self, swims: Sequence[Evaluation]) -> float:
        """How good a gait is by its swims, one in each fluid [1]; very bad unless all are valid and wholly defined."""
        values = []
        for swim in swims:
            v, p, earned = swim.speed, swim.power, swim.episode_return
            # A power below zero, which a run that has not settled may show, is no valid one: a price would pay for it.
            if swim.status != "ok" or v is None or p is None or earned is None or p < 0:
                return _WORST
            paid = getattr(swim, CURRENCIES[self.currency])
            values.append(earned if self.price is None else 10 * v - self.price * paid)
        return sum(values) / len(values)


class Tuning:
    """One CMA-ES search by ask and tell: first the gaits that it starts from, then whole generations.

    It starts from the optima of `earlier` searches, or from the travelling wave a_i(t) = 0.4 rad sin(2 pi 0.7 Hz t +
    (N - i) 0.8 rad); at a price also from a gait of the `limit`. The variables are the logarithm of the base frequency,
    then for each harmonic the cosine and the sine amplitude of every joint [rad], bounded by -1 and 1.
    """

    def __init__(
        self,
        config: FourierConfig,
        goal: Goal,
        tuned_to: str,
        seed: int,
        earlier: Sequence[Tuning] = (),
        limit: Starts | None = None,
    ) -> None:
        self.goal, self.tuned_to, self.seed, self.value = goal, tuned_to, seed, -np.inf
        self.fluids = config.objectives()[tuned_to]
        # How many gaits were evaluated, with those for the same objective with fewer harmonics.
        self.tried: int = sum(search.tried for search in earlier if search.goal[1:] == goal[1:])
        self._config, self._n_joints = config, config.robot.n_joints
        size = 1 + goal.harmonics * 2 * self._n_joints
        starts = [search._point for search in earlier] or [_wave(config)]
        if goal.price and (gaits := (limit or {}).get((tuned_to, goal.currency))):
            start = start_at(gaits, goal.price, goal.harmonics)
            starts.append(np.append(np.clip(start[0], *np.log(config.frequency)), start[1:]))
        self._asked = [np.pad(start, (0, size - len(start))) for start in starts]
        self._point: FloatArray = self._asked[0]
        self._step = _CONTINUED_STEP if earlier else _STEP
        self._optimizer: CMA | None = None

    def labels(self) -> Row:
        """The cells of a table that identify the search."""
        goal = {"harmonics": self.goal.harmonics, "objective": self.goal.objective, "price": self.goal.price}
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
        stream = np.random.SeedSequence([self.seed, goal.harmonics, goal.stage])
        return CMA(
            mean=self._point,
            sigma=self._step,
            bounds=np.vstack([np.log(config.frequency), amplitudes]),
            seed=int(stream.generate_state(1)[0]),
            population_size=_population(config, goal),
        )


def _goals(config: FourierConfig) -> dict[Goal, list[Goal]]:
    """All goals, each after those whose optima its searches start from, which are listed; the first has none.

    These are the optimum at the price before in the same currency, or that of J for the cheapest price; and, with more
    harmonics, the optimum of the same objective with fewer, so that no objective falls as harmonics are added.
    """
    before: dict[Goal, list[Goal]] = {}
    fewer: list[Goal] = []
    for harmonics in config.harmonics:
        goals, cheaper = [Goal(harmonics, None)], list[list[Goal]]([[]])
        for currency, (place, price) in product(config.currencies, enumerate(config.prices)):
            cheaper.append([goals[-1 if place else 0]])
            goals.append(Goal(harmonics, price, len(goals), currency))
        before |= {goal: cheaper[goal.stage] + fewer[goal.stage : goal.stage + 1] for goal in goals}
        fewer = goals
    return before


def _starts(config: FourierConfig, goal: Goal, earlier: Sequence[Goal]) -> int:
    """How many gaits a search starts from, at most."""
    return (len(earlier) or 1) + bool(config.limit and goal.price)


def _generations(config: FourierConfig, goal: Goal, starts: int) -> int:
    name = "trials" if goal.price is None else "price_trials"
    each, population = getattr(config, name), _population(config, goal)
    generations = (each * goal.harmonics - starts) // population
    if generations < 1:
        needed = -(-(starts + population) // goal.harmonics)
        raise InvalidValue(f"{name} = {each}: at least {needed} are needed for a generation of {population} gaits")
    return int(generations)


def _population(config: FourierConfig, goal: Goal) -> int:
    return config.population or 4 + int(3 * np.log(1 + goal.harmonics * 2 * config.robot.n_joints))


def _wave(config: FourierConfig) -> FloatArray:
    phase = np.arange(config.robot.n_joints - 1, -1, -1) * _PHASE
    frequency = np.clip(np.log(_FREQUENCY), *np.log(config.frequency))
    return np.hstack([frequency, _AMPLITUDE * np.sin(phase), _AMPLITUDE * np.cos(phase)])


def _gait(point: FloatArray, n_joints: int) -> Fourier:
    cosine, sine = point[1:].reshape(-1, 2, n_joints).transpose(1, 0, 2).tolist()
    return Fourier(frequency=float(np.exp(point[0])), cosine=tuple(map(tuple, cosine)), sine=tuple(map(tuple, sine)))
