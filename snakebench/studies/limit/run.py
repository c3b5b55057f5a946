"""The limit of the body: the fastest periodic gait at each power, in each fluid (ours)."""

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import product
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from snakebench.collocation.search import CONVERGED, SMOOTHINGS, Found, Point, Search, Task
from snakebench.collocation.sharpening import sharpen
from snakebench.collocation.solver import SMOOTHING, Goal, Optimum, cycle_of, solve
from snakebench.collocation.starts import periodic_gait
from snakebench.controllers import HeldTargets, PeriodicTargets
from snakebench.errors import NoOptimum
from snakebench.evaluation import Evaluation
from snakebench.execution import Case, Evaluator
from snakebench.names import CURRENCIES
from snakebench.scenario import Scenario
from snakebench.studies.limit.settings import HELD, LimitConfig
from snakebench.studies.limit.starts import starts
from snakebench.studies.protocol import Load, Outcome, Row, numerics

_SECONDS = 9.0  # that a solution takes, about
_SOLUTIONS = 7  # of a point, about
_SIMULATIONS = 2  # of a point, about
_TURNS = 6  # starting places in the period that are tried, so that the gait sets off straight
_PERIODS = 15  # that a replay swims, at least
_GAP = 0.01  # of speed at equal power between optimum and replay, beyond which a point is not published
_RETRIES = 2  # of a finer mesh that failed
_SHOWN = 10.0  # length of the swims that the page shows, at most [s]
_AT_BOUND = 1e-3  # how near to its bound a target is there [rad]
Replay = tuple[Row, Evaluation]  # labels of the waveform and the engine


class Swum(NamedTuple):
    """An optimum, its gait, and what became of it in the engines."""

    found: Found
    gait: PeriodicTargets
    replays: Sequence[Replay]
    gaps: Sequence[float]  # of speed at equal power, in PyBullet and in planar [1]; NaN if it failed

    @property
    def distance(self) -> float:
        """The larger of both gaps [1]; infinite if an engine failed."""
        return max(abs(gap) if math.isfinite(gap) else math.inf for gap in self.gaps)

    @property
    def agrees(self) -> bool:
        """Whether both engines confirm it."""
        return self.distance <= _GAP


def plan(config: LimitConfig) -> list[Load]:
    """Solutions and replays of all points; how many solutions a point takes is an estimate."""
    points = len(_goals(config))
    planar, verified = (_scenario(config, config.media()[0][0] or "water", engine) for engine in ("planar", "pybullet"))
    solving = points * _SOLUTIONS * _SECONDS
    return [
        Load("angle", planar, points * (_SIMULATIONS * (_TURNS + 2) + _SOLUTIONS), solving=solving),
        Load("angle", verified, points * _SIMULATIONS * 2),
    ]


def run(config: LimitConfig, evaluate: Evaluator) -> Outcome:
    """Search, replay what was found in both engines, and publish what agrees."""
    goals = _goals(config)
    robot = config.robot.model_dump(mode="json")

    def solve_all(tasks: Sequence[Task]) -> list[Optimum]:
        function = sharpen if all(task.smoothing for task in tasks) else solve
        asked = [
            (robot, list(goals[task.point]), list(task.mesh), task.cycle, task.smoothing or task.near) for task in tasks
        ]
        return [Optimum(*answer) for answer in evaluate.remembered(function, asked)]

    search = Search(goals, solve_all, 1 / config.control_rate)
    search.run(starts(config, goals, evaluate.results))
    simulated = _simulated(config, evaluate, search)
    if not simulated:
        raise _no_optimum(config, search)
    swum = {point: simulated[point] for point in goals if point in simulated}  # in the order of the settings
    published = {point: one for point, one in swum.items() if one.agrees}
    if not published:
        raise NoOptimum(f"{config.name}: no optimum holds in simulation: speeds differ by more than 1 % at equal power")
    tables = {
        "limit": pd.DataFrame(_limit(config, search, published)),
        "replays": pd.DataFrame(_replay_rows(config, swum)),
        "gaits": pd.DataFrame(_gaits(config, published)),
        "solutions": pd.DataFrame(_solutions(config, search)),
    }
    return Outcome(tables, dict(_shown(config, published)))


def _simulated(config: LimitConfig, evaluate: Evaluator, search: Search) -> dict[Point, Swum]:
    """Of each point the optimum that simulation confirms best; where none is confirmed, also on a finer mesh."""
    swum = _sharpest(config, evaluate, search, search.goals)
    doubtful = [point for point, one in swum.items() if not one.agrees]
    search.refine(doubtful)
    for _ in range(_RETRIES):
        search.retry(doubtful)
    again = _sharpest(config, evaluate, search, doubtful)
    return swum | {point: one for point, one in again.items() if one.distance < swum[point].distance}


def _sharpest(config: LimitConfig, evaluate: Evaluator, search: Search, points: Iterable[Point]) -> dict[Point, Swum]:
    """The optima on the finest meshes, with less smoothing as long as that changes the speed and brings it nearer."""
    swum = _simulate(config, evaluate, search, {point: one for point in points if (one := search.finest(point))})
    changing = dict(swum)
    for smoothing in SMOOTHINGS:
        sharper = search.sharpen((one.found for one in changing.values()), smoothing)
        simulated = _simulate(config, evaluate, search, sharper)
        nearer = {point: one for point, one in simulated.items() if one.distance < swum[point].distance}
        changing = {
            point: one
            for point, one in nearer.items()
            if abs(one.found.optimum.speed / swum[point].found.optimum.speed - 1) >= CONVERGED
        }
        swum |= nearer
    return swum


def _simulate(
    config: LimitConfig, evaluate: Evaluator, search: Search, found: Mapping[Point, Found]
) -> dict[Point, Swum]:
    gaits = {point: periodic_gait(cycle_of(one.optimum.cycle)) for point, one in found.items()}
    gaits = _set_off(config, evaluate, gaits)
    replays = _replays(config, evaluate, gaits)
    return {
        point: Swum(one, gaits[point], replays[point], _gaps(search.goals[point], one.optimum, replays[point]))
        for point, one in found.items()
    }


def _no_optimum(config: LimitConfig, search: Search) -> NoOptimum:
    """The error of a study without any optimum, with the fastest motion that it found."""
    found = [one.optimum for of_point in search.found.values() for one in of_point]
    best = max((one for one in found if one.status != "failed"), key=lambda one: one.speed, default=None)
    reached = "no start swims"
    if best:
        reached = f"the fastest motion, {best.speed:.3g} m/s at {best.power:.3g} W, is none (status: {best.status})"
    return NoOptimum(
        f"{config.name}: no optimum after {len(found)} solutions: {reached}; other powers or bounds are needed"
    )


def _goals(config: LimitConfig) -> dict[Point, Goal]:
    axes = (
        enumerate(config.media()),
        enumerate(config.currencies),
        enumerate(config.bounds.values()),
        enumerate(config.powers),
    )
    return {
        Point(m, c, b, p): Goal(
            fluid.kinematic_viscosity,
            fluid.density,
            currency,
            power,
            bounds.target,
            bounds.joint_rate,
            bounds.held,
        )
        for (m, (name, fluid)), (c, currency), (b, bounds), (p, power) in product(*axes)
        if (b == 0 or bounds.held or name is not None) and power in (bounds.powers or config.powers)
    }


def _scenario(config: LimitConfig, fluid: Any, engine: str, period: float = 1.0) -> Scenario:
    rate = config.verify_rate if engine == "pybullet" else config.planar_rate
    duration = math.ceil(max(config.duration, _PERIODS * period))
    return Scenario(
        fluid=fluid,
        robot=config.robot,
        engine=engine,
        physics_rate=rate,
        control_rate=config.control_rate,
        duration=duration,
    )


def _set_off(
    config: LimitConfig, evaluate: Evaluator, gaits: Mapping[Point, PeriodicTargets]
) -> dict[Point, PeriodicTargets]:
    """The gaits, each begun at the place of its period from which its course is straightest along x."""
    media, turned = config.media(), dict[Point, list[PeriodicTargets]]()
    for point, gait in gaits.items():
        knots = len(gait.targets)
        turned[point] = [gait.started_at(knots * k // _TURNS) for k in range(_TURNS)]
    cases = []
    for point, of_point in turned.items():
        scenario = _scenario(config, media[point.medium][1], "planar", of_point[0].period)
        cases += [Case(next(iter(_swims(config, point, gait, scenario).values())), scenario) for gait in of_point]
    speeds = np.reshape(
        [(one.speed if one.status == "ok" else None) or -np.inf for one in evaluate(cases)], (-1, _TURNS)
    )
    return {point: of_point[int(k)] for (point, of_point), k in zip(turned.items(), speeds.argmax(axis=1), strict=True)}


def _swims(
    config: LimitConfig, point: Point, gait: PeriodicTargets, scenario: Scenario
) -> dict[str, PeriodicTargets | HeldTargets]:
    """How a gait swims, the optimum's own way first: its waveform, and held targets, if they may be so large."""
    bounds = list(config.bounds.values())[point.bound]
    if bounds.held:
        return {"held": gait.stepped(config.control_rate, scenario.duration)}
    if bounds.target > HELD:
        return {"continuous": gait}
    return {"continuous": gait, "held": gait.held(config.control_rate, scenario.duration)}


def _replays(
    config: LimitConfig, evaluate: Evaluator, gaits: Mapping[Point, PeriodicTargets]
) -> dict[Point, list[Replay]]:
    """Every gait in both engines, PyBullet first, as a waveform and with held targets."""
    media, replays, cases = config.media(), dict[Point, list[Replay]](), list[tuple[Point, Row, Case]]()
    for (point, gait), engine in product(gaits.items(), ("pybullet", "planar")):
        scenario = _scenario(config, media[point.medium][1], engine, gait.period)
        for waveform, controller in _swims(config, point, gait, scenario).items():
            cases.append((point, {"waveform": waveform, **numerics(scenario)}, Case(controller, scenario)))
    for (point, labels, _), swim in zip(cases, evaluate([case for _, _, case in cases]), strict=True):
        replays.setdefault(point, []).append((labels, swim))
    return replays


def _limit(config: LimitConfig, search: Search, published: Mapping[Point, Swum]) -> Iterator[Row]:
    for point, (found, _, replays, (gap, planar_gap)) in published.items():
        optimum, cycle, goal, mesh = found.optimum, found.optimum.cycle, search.goals[point], found.task.mesh
        agreeing, starts = search.agreeing(point)
        yield {
            **_point(config, point),
            "optimal_speed": optimum.speed,
            "optimal_power": optimum.power,
            "multiplier": optimum.multiplier,
            "residual": optimum.residual,
            "frequency": 0.5 / cycle["half_period"],
            "at_bound": float((np.abs(cycle["targets"]) > goal.bound - _AT_BOUND).mean()),
            "knots": mesh.knots,
            "intervals": mesh.intervals,
            "smoothing": found.task.smoothing or SMOOTHING[-1],
            "starts": starts,
            "agreeing": agreeing,
            "change": search.change(point, mesh),
            "gap": gap,
            "planar_gap": planar_gap,
            **replays[0][1].row(),
        }


def _replay_rows(config: LimitConfig, swum: Mapping[Point, Swum]) -> Iterator[Row]:
    for point, one in swum.items():
        place = _point(config, point)
        for labels, swim in one.replays:
            yield {**place, **labels, "published": one.agrees, **swim.row()}


def _gaps(goal: Goal, optimum: Optimum, replays: Sequence[Replay]) -> list[float]:
    """The `_gap` of the replays of the optimum's own waveform, in PyBullet and in planar."""
    own = "held" if goal.held else "continuous"
    return [_gap(goal, optimum, swim) for labels, swim in replays if labels["waveform"] == own]


def _gap(goal: Goal, optimum: Optimum, swim: Evaluation) -> float:
    """How much faster a replay is than the optimum, at the optimum's power by its multiplier [1]; NaN if it failed."""
    power: float | None = getattr(swim, CURRENCIES[goal.currency])
    if swim.status != "ok" or swim.speed is None or power is None:
        return math.nan
    return (swim.speed + optimum.multiplier * (optimum.power - power)) / optimum.speed - 1


def _point(config: LimitConfig, point: Point) -> Row:
    """The cells of a table that identify a point."""
    name, fluid = config.media()[point.medium]
    label, bounds = list(config.bounds.items())[point.bound]
    return {
        "fluid": name,
        "viscosity": fluid.kinematic_viscosity,
        "density": fluid.density,
        "currency": config.currencies[point.currency],
        "bounds": label,
        "bound": bounds.target,
        "speed_limit": bounds.joint_rate,
        "allowed": config.powers[point.power],
    }


def _gaits(config: LimitConfig, published: Mapping[Point, Swum]) -> Iterator[Row]:
    for point, one in published.items():
        place = _point(config, point)
        for knot, targets in enumerate(one.gait.targets):
            joints = {f"joint_{j + 1}": round(target, 6) for j, target in enumerate(targets)}
            yield place | {"knot": knot, "period": one.gait.period} | joints


def _solutions(config: LimitConfig, search: Search) -> Iterator[Row]:
    for point, found in search.found.items():
        place = _point(config, point)
        for task, optimum in found:
            mesh = {"knots": task.mesh.knots, "intervals": task.mesh.intervals}
            smoothing = {"smoothing": task.smoothing or SMOOTHING[-1]}
            came = {"start": task.kind, "status": optimum.status, **mesh, "iterations": optimum.iterations}
            speeds = {"optimal_speed": optimum.speed, "optimal_power": optimum.power, "residual": optimum.residual}
            yield place | came | smoothing | speeds


def _shown(config: LimitConfig, published: Mapping[Point, Swum]) -> Iterator[tuple[str, Case]]:
    """The fastest gaits in the named fluids under the first bounds, at one power."""
    power, media = config.powers.index(config.shown), config.media()
    for point, one in published.items():
        name, fluid = media[point.medium]
        if name is not None and point.bound == 0 and point.power == power:
            scenario = _scenario(config, fluid, "pybullet").but(duration=min(config.duration, _SHOWN))
            yield f"{name}-{config.currencies[point.currency]}", Case(one.gait, scenario)
