"""The search for the limit: several starts, neighbours in power and viscosity, finer meshes, less smoothing.

A point is a medium, a currency, bounds and a power. Every solution is counted, so that a page can say how many starts
of a point agree. The rounds depend on the settings only: what is remembered of an interrupted search is found again.
"""

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from itertools import pairwise
from typing import Any, NamedTuple

from snakebench.collocation.front import AGREE, FINER, REFINED, SHARPER
from snakebench.collocation.solver import SMOOTHING, Goal, Optimum, cycle_of, held_cycle, plain
from snakebench.collocation.starts import released
from snakebench.collocation.transcription import SHORTEST, Mesh
from snakebench.value import digest

BASE = Mesh(12)  # on which starts are compared
NEWS = 0.001  # by which a neighbour must have become faster to start a point once more [1]
CONVERGED = 0.005  # change of speed from mesh to mesh, or from smoothing to smoothing, at which it is fine enough [1]
SMOOTHINGS = (3e-4, 1e-4, 3e-5, 1e-5)  # of absolute values of velocities, after that of a solution [m/s]
_INTERVALS = 20  # of the states on a finer mesh, at least
_FEWER, _MOST = 8, 96  # knots of finer meshes
_MORE = 1.2  # times as many knots, at least, make a finer mesh; else there are more intervals between them
_LEVELS = 3  # of finer meshes, before starts from less power and before simulation ask for one more
_ROUNDS = 3  # of starts from neighbours; the last is for points without agreement
LINEAR = "linear targets"  # the kind of start of held targets


class Point(NamedTuple):
    """Where the limit is wanted, by places in the settings' lists."""

    medium: int
    currency: int
    bound: int
    power: int


class Task(NamedTuple):
    """One solution to be found: of a point, from a start of a kind, on a mesh."""

    point: Point
    kind: str
    cycle: Mapping[str, Any]
    near: bool
    mesh: Mesh = BASE
    smoothing: float | None = None  # less than that of a solution [m/s]


class Found(NamedTuple):
    """What came of a task."""

    task: Task
    optimum: Optimum


class Search:
    """All solutions so far, and the next ones.

    Args:
        goals: what is wanted at each point.
        solve_all: solves tasks and answers in their order.
        step: control step of held targets [s].
    """

    def __init__(
        self, goals: Mapping[Point, Goal], solve_all: Callable[[Sequence[Task]], Sequence[Optimum]], step: float
    ) -> None:
        self.goals, self._solve_all, self._step = goals, solve_all, step
        self._held = [point for point, goal in goals.items() if goal.held]
        self._free = [point for point, goal in goals.items() if not goal.held]
        self.found: dict[Point, list[Found]] = {point: [] for point in goals}
        self._started: set[tuple[Point, Mesh, bool, float | None, str]] = set()
        self._used: dict[tuple[Point, Point], float] = {}  # speed of a neighbour when it last started a point
        self._powers = sorted({point.power for point in goals})
        self._media = sorted({point.medium for point in goals})

    def run(self, starts: Mapping[Point, Mapping[str, Mapping[str, Any]]]) -> None:
        """Solve everything, from the starts of some points: cycles by their names."""
        self._solve(Task(point, name, cycle, near=False) for point, of in starts.items() for name, cycle in of.items())
        for round in range(_ROUNDS):
            self._from_neighbours([point for point in self._free if round < _ROUNDS - 1 or self.agreeing(point)[0] < 2])
        self.refine(self._free)
        self._hold()
        self._widen()
        self._take_less_power()
        for _ in range(_LEVELS - 1):
            self.refine([point for point in self._free if not self._converged(point)])
        self.refine(self._take_less_power())
        self._widen()

    def _from_neighbours(self, points: Sequence[Point]) -> None:
        """Start points from their neighbours in power, viscosity and bounds, in both directions."""
        self._sweep(points, "power", self._powers[::-1], "power above")
        self._sweep(points, "power", self._powers, "power below")
        self._sweep(points, "medium", self._media, "thinner fluid")
        self._sweep(points, "medium", self._media[::-1], "thicker fluid")
        for bound in sorted({point.bound for point in points} - {0}):
            self._sweep(points, "bound", [0, bound], "first bounds")
            self._sweep(points, "bound", [bound, 0], "other bounds")

    def _hold(self) -> None:
        """Start held targets from the optima of linear ones; where that fails, from the neighbours in power."""
        tasks = []
        for point in self._held:
            first = point._replace(bound=0)
            if linear := self.finest(first) or self.best(first):
                cycle, mesh = held_cycle(cycle_of(linear.optimum.cycle), self._step)
                tasks.append(Task(point, LINEAR, plain(cycle), near=True, mesh=mesh))
        self._solve(tasks)
        for kind, places in (("power above", self._powers[::-1]), ("power below", self._powers)):
            self._sweep([point for point in self._held if not self.best(point)], "power", places, kind)

    def _widen(self) -> None:
        """Start points from faster ones of narrower bounds, and neighbours of points that became faster so."""
        bounds = sorted({point.bound for point in self.goals})
        starts = list[tuple[Point, Mapping[str, Any]]]()
        for point, narrower in ((point, point._replace(bound=bound)) for point in self._free for bound in bounds):
            one = self.finest(narrower) if _contains(self.goals, point, narrower) else None
            if one and 0 < (1 + NEWS) * self._speed(point) < one.optimum.speed:
                cycle = one.optimum.cycle
                starts.append((point, plain(released(cycle_of(cycle))) if self.goals[narrower].held else cycle))
        improved = self._improved(starts)
        for _ in range(_ROUNDS):
            faster = [(point, self.finest(point)) for point in improved]
            improved = self._improved(
                (beside, one.optimum.cycle) for point, one in faster if one for beside in self._beside(point)
            )

    def _take_less_power(self) -> list[Point]:
        """Start points from faster gaits that take no more than their power; returns those that became faster."""
        improved = []
        for power in self._powers:
            starts = list[tuple[Point, Mapping[str, Any]]]()
            for point in (point for point in self._free if point.power == power):
                others = [self.finest(point._replace(power=other)) for other in self._powers if other != power]
                allowed = [one for one in others if one and one.optimum.power <= self.goals[point].power]
                fastest = max(allowed, key=lambda one: one.optimum.speed, default=None)
                if fastest and fastest.optimum.speed > self._speed(point):
                    starts.append((point, fastest.optimum.cycle))
            improved += self._improved(starts)
        return improved

    def _improved(self, starts: Iterable[tuple[Point, Mapping[str, Any]]]) -> list[Point]:
        """Start points from cycles, each on its last mesh; returns those that became faster."""
        on = [(point, cycle, one.task.mesh) for point, cycle in starts if (one := self.finest(point))]
        before = {point: self._speed(point) for point, _, _ in on}
        self._solve(Task(point, FINER, cycle, near=True, mesh=mesh) for point, cycle, mesh in on)
        return [point for point, speed in before.items() if self._speed(point) > (1 + NEWS) * speed]

    def _beside(self, point: Point) -> list[Point]:
        """The neighbours of a point in power and viscosity."""
        asides = [(axis, step) for axis in ("power", "medium") for step in (-1, 1)]
        places = [point._replace(**{axis: getattr(point, axis) + step}) for axis, step in asides]
        return [place for place in places if place in self.goals]

    def _speed(self, point: Point) -> float:
        """The speed of the last optimum of a point [m/s]; 0 without one."""
        last = self.finest(point)
        return last.optimum.speed if last else 0.0

    def best(self, point: Point) -> Found | None:
        """The fastest optimum of a point before refinements; None if none is an optimum."""
        return max(self._starts(point), key=lambda one: one.optimum.speed, default=None)

    def _starts(self, point: Point) -> list[Found]:
        """The optima of a point before refinements."""
        return [one for one in self.found.get(point, ()) if one.optimum.found and one.task.kind not in REFINED]

    def agreeing(self, point: Point) -> tuple[int, int]:
        """How many starts of a point end within `AGREE` of the fastest, and how many there were.

        They are those before refinements; but where a later start is faster than their refinement by more than that,
        only those that are as fast on its mesh agree.
        """
        speeds = [one.optimum.speed for one in self._starts(point)]
        on = dict[Mesh, list[float]]()  # speeds of the refinement, and of later starts
        for one in self.found[point]:
            if one.task.kind == FINER and one.optimum.found:
                on.setdefault(one.task.mesh, []).append(one.optimum.speed)
        later = [refined for refined in on.values() if (1 - AGREE) * max(refined) > refined[0]]
        tried = len(speeds) + sum(len(refined) - 1 for refined in on.values())
        decisive = later[-1] if later else speeds
        return sum(speed >= (1 - AGREE) * max(decisive) for speed in decisive), tried

    def _converged(self, point: Point) -> bool:
        """Whether the last finer mesh changed the speed of a point little enough."""
        last = self.finest(point)
        return bool(last and self.change(point, last.task.mesh) < CONVERGED)

    def change(self, point: Point, mesh: Mesh) -> float:
        """How much the step to a finer mesh changed the speed of a point [1]; NaN without one."""
        speeds = {one.task.mesh: one.optimum.speed for one in (self.best(point), *self._of_refinements(point)) if one}
        return next(
            (abs(speeds[mesh] / speeds[before] - 1) for before, after in pairwise(speeds) if after == mesh), math.nan
        )

    def _solve(self, tasks: Iterable[Task]) -> None:
        """Solve those tasks whose starts are new, so that each counts once."""
        new = {(task.point, task.mesh, task.near, task.smoothing, digest(task.cycle)): task for task in tasks}
        new = {key: task for key, task in new.items() if key not in self._started}
        self._started |= new.keys()
        for task, optimum in zip(new.values(), self._solve_all(list(new.values())), strict=True):
            self.found[task.point].append(Found(task, optimum))

    def _sweep(self, points: Sequence[Point], axis: str, places: Sequence[int], kind: str) -> None:
        """Start each of the points from its neighbour along an axis, one after another."""
        for k, place in enumerate(places):
            pairs = [
                (point, self._best_among(point._replace(**{axis: before}) for before in reversed(places[:k])))
                for point in points
                if getattr(point, axis) == place
            ]
            new = [(point, one) for point, one in pairs if one and self._is_news(point, one)]
            self._solve(Task(point, kind, one.optimum.cycle, near=True, mesh=one.task.mesh) for point, one in new)

    def _is_news(self, point: Point, neighbour: Found) -> bool:
        """Whether a neighbour never started the point, or has become faster since."""
        pair, speed = (point, neighbour.task.point), neighbour.optimum.speed
        news = speed > (1 + NEWS) * self._used.get(pair, 0.0)
        if news:
            self._used[pair] = speed
        return news

    def _best_among(self, neighbours: Iterable[Point]) -> Found | None:
        """The best of the first of these points that is sought."""
        return next((self.best(point) for point in neighbours if point in self.goals), None)

    def refine(self, points: Iterable[Point]) -> None:
        """Solve points once more from their last optimum, on a finer mesh than that of the last solution."""
        tasks = []
        for point in points:
            meshes = [one.task.mesh for one in self.found[point] if one.task.kind == FINER]
            if last := self.finest(point) or self.best(point):
                before = meshes[-1] if meshes else last.task.mesh
                mesh = finer(before, last.optimum.cycle["half_period"])
                if self.goals[point].held:  # knots are control steps: only the motion can be finer
                    mesh = Mesh(before.knots, before.parts + 1)
                tasks.append(Task(point, FINER, last.optimum.cycle, near=True, mesh=mesh))
        self._solve(tasks)

    def retry(self, points: Iterable[Point]) -> None:
        """Solve finer meshes that failed once more, without more smoothing at first.

        That is from the optimum before, or from the motion that was reached, if it is one.
        """
        lasts = (self.found[point][-1] for point in points)
        failed = [one for one in lasts if one.task.kind == FINER and not one.optimum.found]
        starts = [one.optimum.cycle if one.optimum.status == "feasible" else one.task.cycle for one in failed]
        self._solve(
            one.task._replace(cycle=start, smoothing=SMOOTHING[-1]) for one, start in zip(failed, starts, strict=True)
        )

    def sharpen(self, found: Iterable[Found], smoothing: float) -> dict[Point, Found]:
        """Solve again from optima with less smoothing, on their meshes; returns what are optima."""
        starts = {one.task.point: one for one in found}
        self._solve(
            Task(point, SHARPER, one.optimum.cycle, near=True, mesh=one.task.mesh, smoothing=smoothing)
            for point, one in starts.items()
        )
        ends = {point: self.found[point][-1] for point in starts}
        return {point: one for point, one in ends.items() if one.task.smoothing == smoothing and one.optimum.found}

    def finest(self, point: Point) -> Found | None:
        """The fastest optimum on the last mesh, or the best with held targets; None without one."""
        refined = self._of_refinements(point)
        return refined[-1] if refined else self.best(point) if point in self._held else None

    def _of_refinements(self, point: Point) -> list[Found]:
        """On each finer mesh the fastest optimum of a point, in the order of refinements."""
        fastest = dict[Mesh, Found]()
        for one in self.found.get(point, ()):
            mesh = one.task.mesh
            if one.task.kind == FINER and one.optimum.found:
                fastest[mesh] = max(fastest.get(mesh, one), one, key=lambda one: one.optimum.speed)
        return list(fastest.values())


def _contains(goals: Mapping[Point, Goal], point: Point, other: Point) -> bool:
    """Whether every gait of another point is within the bounds of a point, of the same fluid, currency and power."""
    if other not in goals or other == point:
        return False
    wide, narrow = goals[point], goals[other]
    rates = (goal.joint_rate or math.inf for goal in (narrow, wide))
    return narrow.bound <= wide.bound and next(rates) <= next(rates) and not wide.held


def finer(mesh: Mesh, half_period: float) -> Mesh:
    """The next mesh: twice the knots, as far as half a period has room for them, a control step apart; else more parts.

    Where the base mesh meets that bound it asks for fewer knots.
    """
    room = half_period / SHORTEST
    if mesh == BASE and room < 1.005 * mesh.knots:
        return _with_intervals(_FEWER)
    knots = min(2 * mesh.knots, int(room), _MOST)
    if knots < _MORE * mesh.knots:
        return Mesh(mesh.knots, max(mesh.parts + 1, _with_intervals(mesh.knots).parts))
    return _with_intervals(knots)


def _with_intervals(knots: int) -> Mesh:
    return Mesh(knots, -(-_INTERVALS // knots))
