"""Fourier study: CMA-ES tunes a free periodic waveform of target angles, per fluid: the open-loop bound (ours).

It maximises the return J, and 10 v - price P at several prices of power, which trace a front of speed and power. How
much of a learned policy's gain over the paper's gaits is the free waveform, and how much is feedback, is told by it.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import product
from typing import NamedTuple

import numpy as np
import pandas as pd
from cmaes import CMA

from snakebench.controllers import Fourier
from snakebench.errors import InvalidValue
from snakebench.evaluation import Evaluation, Scenario, simulate
from snakebench.execution import Case, Evaluator
from snakebench.studies.config import thinning
from snakebench.studies.fronts import front
from snakebench.studies.indicators import OBJECTIVES, SHAPE, assembled, front_tables
from snakebench.studies.planning import Load
from snakebench.studies.searches import FourierConfig
from snakebench.trajectory import Trajectory
from snakebench.value import FloatArray

_AMPLITUDE, _FREQUENCY, _PHASE = 0.4, 0.7, 0.8  # of the wave that searches start from [rad, Hz, rad]
_WORST = -1e9  # value of a gait that did not swim validly; finite, since CMA-ES ranks it


class Goal(NamedTuple):
    """What a search maximises with how many harmonics: the return J, or 10 v - price P."""

    harmonics: int
    price: float | None  # [1/W]; None for the return

    def value(self, evaluation: Evaluation) -> float:
        """How good a gait is [1]; very bad unless it swam validly and every number is defined.

        A power below zero, which a run that has not settled may show, is no valid one: a price would pay for it.
        """
        v, p, earned = evaluation.speed, evaluation.power, evaluation.episode_return
        if evaluation.status != "ok" or v is None or p is None or earned is None or p < 0:
            return _WORST
        return earned if self.price is None else 10 * v - self.price * p

    def columns(self) -> dict[str, object]:
        """The goal as cells of a table."""
        return {
            "harmonics": self.harmonics,
            "objective": "return" if self.price is None else "price",
            "price": self.price,
        }


def plan(config: FourierConfig) -> list[Load]:
    """What the study evaluates.

    Raises:
        InvalidValue: when a budget is too small for one generation.
    """
    searches = len(config.fluids) * len(config.seeds)
    goals = _goals(config)
    searched = searches * sum(_budget(config, goal) for goal in goals)
    counts = {"searched": searched + searches * len(goals)}
    return [
        Load("angle", scenario, counts.get(variant, searches * len(goals)))
        for variant, scenario in _variants(config, config.fluids[0]).items()
    ]


def run(config: FourierConfig, evaluate: Evaluator) -> tuple[dict[str, pd.DataFrame], dict[str, Trajectory]]:
    """Search for every goal, fluid and seed, and verify each optimum.

    The searches of a goal advance together, one generation of each at a time. The first starts from a travelling wave,
    a_i(t) = 0.4 rad sin(2 pi 0.7 Hz t + (N - i) 0.8 rad). All others start from what the same seed found in the same
    fluid: from the optimum at the price before, the cheapest price from that of J; and, with more harmonics, from the
    optimum of the same objective with fewer, when that is the better one. So no objective falls as harmonics are added.

    Returns:
        Tables and the runs that the report shows:

        - `growth`: the best value found so far, one row a generation; `evaluations` count those of the same objective
          with fewer harmonics as well, which the search continues;
        - `optima`: the best gait of every search, as searched and verified with a coarser and a finer step, with the
          objective's value as searched;
        - `gaits`: the Fourier coefficients of these gaits, one row a joint and harmonic;
        - `fronts`, `switching`, `indicators`: the front that these gaits make in each fluid at the finer step, whatever
          they were tuned to, the simple-sum of these, and what they are worth, as `front_tables`;
        - FLUID: the gait of the highest J swimming, 60 rows a second.

    Raises:
        InvalidValue: when no gait of a search swam validly.
    """
    found: dict[Goal, list[Search]] = {}
    growth: list[dict[str, object]] = []
    for goal in _goals(config):
        found[goal] = _searches(config, goal, found)
        growth += _advance(config, evaluate, found[goal])
    searches = [search for of_goal in found.values() for search in of_goal]
    optima = pd.DataFrame(_verified(config, evaluate, searches))
    fronts = assembled("fourier", _fronts(config, optima), config.fluids, config.robot.total_mass)
    tables = {
        "growth": pd.DataFrame(growth),
        "optima": optima,
        "gaits": pd.DataFrame(row for search in searches for row in _coefficients(search)),
        **front_tables(fronts, config.fluids, config.reference),
    }
    best = {fluid: _highest_return(searches, fluid) for fluid in config.fluids}
    every = thinning(config.verify_rate)
    return tables, {fluid: simulate(gait, config.verified(fluid)[0]).thinned(every) for fluid, gait in best.items()}


class Search:
    """One CMA-ES search: whole generations are asked for and told, after the gaits that it may start from.

    The variables are the logarithm of the base frequency, then for each harmonic the cosine and the sine amplitude of
    every joint [rad], bounded by -1 and 1.

    Args:
        config: the study's settings.
        goal: what is maximised.
        fluid: where.
        seed: of the study; each of its searches draws from a stream of its own.
        starts: points of the search space, evaluated first; the best of them is where the search starts.
        spent: evaluations that the objective took with fewer harmonics.

    Attributes:
        point: the best point found so far, shape (1 + harmonics * 2 * n_joints,).
        value: its value.
        evaluations: how many were told, with those `spent`.
    """

    def __init__(
        self, config: FourierConfig, goal: Goal, fluid: str, seed: int, starts: Sequence[FloatArray], spent: int
    ) -> None:
        self.goal, self.fluid, self.seed, self.evaluations = goal, fluid, seed, spent
        self.point, self.value = starts[0], -np.inf
        self._config, self._asked = config, list(starts)
        self._optimizer: CMA | None = None

    def about(self) -> dict[str, object]:
        """Which search this is, as cells of a table."""
        return {"fluid": self.fluid} | self.goal.columns() | {"seed": self.seed}

    def gait(self) -> Fourier:
        """The best gait found so far."""
        return _gait(self.point, self._config.robot.n_joints)

    def ask(self) -> list[Case]:
        """The next gaits to evaluate."""
        if self._optimizer:
            self._asked = [self._optimizer.ask() for _ in range(self._optimizer.population_size)]
        gaits = [_gait(point, self._config.robot.n_joints) for point in self._asked]
        scenario = self._config.scenario(self.fluid)
        return [Case(gait, scenario.but(duration=_duration(self._config, self.goal, gait))) for gait in gaits]

    def tell(self, evaluations: Sequence[Evaluation]) -> None:
        """Learn from the evaluations of the gaits last asked for."""
        told = [(point, self.goal.value(one)) for point, one in zip(self._asked, evaluations, strict=True)]
        self.evaluations += len(told)
        for point, value in told:
            if value > self.value:
                self.point, self.value = point, value
        if self._optimizer:
            self._optimizer.tell([(point, -value) for point, value in told])
        else:
            self._optimizer = self._started()

    def _started(self) -> CMA:
        config, goal = self._config, self.goal
        first = goal == _goals(config)[0]
        stream = np.random.SeedSequence([self.seed, goal.harmonics, _stage(config, goal)])
        return CMA(
            mean=self.point,
            sigma=config.step if first else config.continued_step,
            bounds=_bounds(config, goal.harmonics),
            seed=int(stream.generate_state(1)[0]),
            population_size=_population(config, goal),
        )


def _goals(config: FourierConfig) -> list[Goal]:
    """All goals, in an order in which each comes after those whose optima it starts from."""
    return [Goal(harmonics, price) for harmonics, price in product(config.harmonics, (None, *config.prices))]


def _stage(config: FourierConfig, goal: Goal) -> int:
    """How many objectives come before that of a goal, with as many harmonics."""
    return (None, *config.prices).index(goal.price)


def _duration(config: FourierConfig, goal: Goal, gait: Fourier) -> float:
    """How long a gait swims for a goal [s]: J is of a fixed time, speed and power are of gaits that have settled."""
    return config.duration if goal.price is None else config.settling(gait.frequency)


def _before(config: FourierConfig, goal: Goal) -> list[Goal]:
    """The goals whose optima a goal starts from."""
    objectives = (None, *config.prices)
    stage, more = _stage(config, goal), config.harmonics.index(goal.harmonics)
    cheaper = [Goal(goal.harmonics, objectives[stage - 1])] if stage else []
    fewer = [Goal(config.harmonics[more - 1], goal.price)] if more else []
    return cheaper + fewer


def _budget(config: FourierConfig, goal: Goal) -> int:
    """How many evaluations a search makes: its starts and whole generations, as many as the settings allow.

    Raises:
        InvalidValue: when there is no room for a generation.
    """
    name = "trials" if goal.price is None else "price_trials"
    each, starts, population = getattr(config, name), len(_before(config, goal)) or 1, _population(config, goal)
    generations = (each * goal.harmonics - starts) // population
    if generations < 1:
        needed = -(-(starts + population) // goal.harmonics)
        raise InvalidValue(f"{name} = {each}: at least {needed} are needed for a generation of {population} gaits")
    return starts + generations * population


def _population(config: FourierConfig, goal: Goal) -> int:
    return config.population or 4 + int(3 * np.log(1 + goal.harmonics * 2 * config.robot.n_joints))


def _bounds(config: FourierConfig, harmonics: int) -> FloatArray:
    amplitudes = np.tile([-1.0, 1.0], (harmonics * 2 * config.robot.n_joints, 1))
    return np.vstack([np.log(config.frequency), amplitudes])


def _searches(config: FourierConfig, goal: Goal, found: dict[Goal, list[Search]]) -> list[Search]:
    """A goal's searches, one for each fluid and seed; `found` are those of the goals before it, in the same order."""
    searches = []
    for place, (fluid, seed) in enumerate(product(config.fluids, config.seeds)):
        before = [found[earlier][place] for earlier in _before(config, goal)]
        starts = [_padded(config, search.point, goal.harmonics) for search in before]
        spent = sum(search.evaluations for search in before if search.goal.price == goal.price)
        searches.append(Search(config, goal, fluid, seed, starts or [_wave(config, goal.harmonics)], spent))
    return searches


def _wave(config: FourierConfig, harmonics: int) -> FloatArray:
    """The travelling wave as a point of the search space."""
    n_joints = config.robot.n_joints
    phase = np.arange(n_joints - 1, -1, -1) * _PHASE
    frequency = np.clip(np.log(_FREQUENCY), *np.log(config.frequency))
    return _padded(config, np.hstack([frequency, _AMPLITUDE * np.sin(phase), _AMPLITUDE * np.cos(phase)]), harmonics)


def _padded(config: FourierConfig, point: FloatArray, harmonics: int) -> FloatArray:
    """The same gait among those with more harmonics."""
    return np.pad(point, (0, 1 + harmonics * 2 * config.robot.n_joints - len(point)))


def _gait(point: FloatArray, n_joints: int) -> Fourier:
    cosine, sine = point[1:].reshape(-1, 2, n_joints).transpose(1, 0, 2).tolist()
    return Fourier(frequency=float(np.exp(point[0])), cosine=tuple(map(tuple, cosine)), sine=tuple(map(tuple, sine)))


def _advance(config: FourierConfig, evaluate: Evaluator, searches: list[Search]) -> Iterator[dict[str, object]]:
    """Let searches of one goal advance together through their budget; large batches keep all workers busy."""
    goal = searches[0].goal
    starts = len(_before(config, goal)) or 1
    generations = (_budget(config, goal) - starts) // _population(config, goal)
    for _ in range(1 + generations):
        asked = [search.ask() for search in searches]
        evaluations = iter(evaluate([case for cases in asked for case in cases]))
        for search, cases in zip(searches, asked, strict=True):
            search.tell([next(evaluations) for _ in cases])
            yield search.about() | {"evaluations": search.evaluations, "best": search.value}
    for search in searches:
        if search.value == _WORST:
            raise InvalidValue(f"{config.name}: no gait swam validly in {search.fluid}")


def _variants(config: FourierConfig, fluid: str) -> dict[str, Scenario]:
    """Where an optimum is evaluated in a fluid."""
    fine, coarse = config.verified(fluid)
    return {"searched": config.scenario(fluid), "coarser step": coarse, "finer step": fine}


def _verified(config: FourierConfig, evaluate: Evaluator, searches: list[Search]) -> Iterator[dict[str, object]]:
    """The optimum of every search in every variant."""
    rows = [
        (search, variant, scenario.but(duration=_duration(config, search.goal, search.gait())))
        for search in searches
        for variant, scenario in _variants(config, search.fluid).items()
    ]
    evaluations = evaluate([Case(search.gait(), scenario) for search, _, scenario in rows])
    for (search, variant, scenario), evaluation in zip(rows, evaluations, strict=True):
        numerics = {"variant": variant, "engine": scenario.engine, "physics_rate": scenario.physics_rate}
        yield search.about() | {"value": search.value} | numerics | evaluation.model_dump()


def _fronts(config: FourierConfig, optima: pd.DataFrame) -> dict[str, pd.DataFrame]:
    """The front of each fluid among the verified optima, with what was searched beside them."""
    searched, fine = (
        optima[optima["variant"] == variant].reset_index(drop=True) for variant in ("searched", "finer step")
    )
    beside = fine.assign(**{f"{name}_searched": searched[name] for name in OBJECTIVES})
    which = ["harmonics", "objective", "price", "seed"]
    valid = beside[(fine["status"] == "ok") & (fine[OBJECTIVES] > 0).all(axis=1)]
    kept = valid[["fluid", *OBJECTIVES, *(f"{name}_searched" for name in OBJECTIVES), "steady", *SHAPE, *which]]
    found = {}
    for fluid in config.fluids:
        of_fluid = kept[kept["fluid"] == fluid].drop(columns="fluid")
        found[fluid] = of_fluid.iloc[front(of_fluid[OBJECTIVES].to_numpy())]
    return found


def _coefficients(search: Search) -> Iterator[dict[str, object]]:
    gait = search.gait()
    for harmonic, (cosines, sines) in enumerate(zip(gait.cosine, gait.sine, strict=True), start=1):
        for joint, (cosine, sine) in enumerate(zip(cosines, sines, strict=True), start=1):
            place = {"frequency": gait.frequency, "joint": joint, "harmonic": harmonic}
            yield search.about() | place | {"cosine": cosine, "sine": sine}


def _highest_return(searches: list[Search], fluid: str) -> Fourier:
    of_return = [search for search in searches if search.fluid == fluid and search.goal.price is None]
    return max(of_return, key=lambda search: search.value).gait()
