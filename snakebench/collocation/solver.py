"""One solution of the program of a gait: IPOPT, from a start to an optimum, or a word why there is none."""

import math
from collections.abc import Mapping, Sequence
from functools import lru_cache
from typing import Any, NamedTuple

import casadi as ca
import numpy as np

from snakebench.collocation.transcription import Currency, Cycle, Mesh, Transcription
from snakebench.robot import Robot
from snakebench.sources import code_digest
from snakebench.value import FloatArray

CODE = code_digest(
    "collocation.equations", "collocation.solver", "collocation.transcription"
)  # of what `solve` computes
SMOOTHING = (1e-2, 1e-3)  # of absolute values of velocities, one solution after the other [m/s]
_COARSE = 3e-2  # the same of a first solution from far away [m/s]
_ITERATIONS = 300
_OBJECTIVE = 50.0  # value of the objective at the start: of the speed itself, slow gaits count as optimal too soon
_SLOWEST = 0.01  # speed of a start in that scale, at least [m/s]
_FEWEST, _MOST = 2, 64  # knots of held targets
_FEASIBLE = 1e-5  # largest violation of a constraint of what counts as a motion
_SETTINGS = {
    "print_time": False,
    "ipopt.sb": "yes",
    "ipopt.print_level": 0,
    "ipopt.max_iter": _ITERATIONS,
    "ipopt.tol": 1e-5,
    "ipopt.acceptable_tol": 1e-4,
    "ipopt.acceptable_iter": 10,
}
# From far away the barrier adapts; near an optimum, as of a neighbouring power, it begins low and falls soon: as low as
# the smoothing, in their units.
_FAR = {"ipopt.mu_strategy": "adaptive"}
_PUSHES = ("bound_push", "bound_frac", "slack_bound_push", "slack_bound_frac")
_NEAR = {"ipopt.mu_strategy": "monotone", "ipopt.barrier_tol_factor": 30.0}
_NEAR |= {f"ipopt.{name}": 1e-4 for name in _PUSHES}


class Goal(NamedTuple):
    """What is to be fast, and what bounds it; plain values."""

    viscosity: float  # kinematic [m^2/s]
    density: float  # [kg/m^3]
    currency: Currency
    power: float  # largest mean power [W]
    bound: float  # of targets [rad]
    joint_rate: float | None = None  # bound of joints' rates [rad/s]
    held: bool = False  # whether targets are held from knot to knot; the period is then that of the start


class Optimum(NamedTuple):
    """Where a solution ended; plain values, so that it can be remembered."""

    status: str  # "optimal", "feasible": a motion, but not yet the fastest, or "failed"
    speed: float  # mean [m/s]
    power: float  # mean, in the goal's currency [W]
    multiplier: float  # dv/dP [m/s/W]
    residual: float  # of the optimality conditions (KKT), as IPOPT scales it
    iterations: int
    cycle: Mapping[str, Any]  # of the motion: a `Cycle` as lists

    @property
    def found(self) -> bool:
        """Whether it is an optimum."""
        return self.status == "optimal"


def solve(
    robot: Mapping[str, Any], goal: Sequence[Any], mesh: Sequence[int], start: Mapping[str, Any], near: bool
) -> Any:
    """The `Optimum` of a goal on a mesh from the cycle `start`; all arguments are plain values.

    `near` says that the start is the optimum of a neighbouring problem; from elsewhere the smoothing begins wider.
    """
    problem = Robot(**robot), Goal(*goal), Mesh(*mesh)
    if not near:
        start = _solved(*problem, start, _COARSE, near=False).cycle
    wide, narrow = SMOOTHING
    first = _solved(*problem, start, wide, near=True)
    second = _solved(*problem, first.cycle, narrow, near=True)
    return second._replace(iterations=first.iterations + second.iterations)


def _solved(robot: Robot, goal: Goal, mesh: Mesh, start: Mapping[str, Any], smoothing: float, *, near: bool) -> Optimum:
    limited, barrier = goal.joint_rate is not None, smoothing if near else None
    program, run = _solver(robot, mesh, goal.currency, limited, goal.held, barrier)
    rate = np.inf if goal.joint_rate is None else goal.joint_rate
    bounds = program.bounds(goal.bound, goal.power, rate, start["half_period"] if goal.held else None)
    x = np.clip(program.pack(on_mesh(cycle_of(start), mesh)), bounds["lbx"], bounds["ubx"])
    scale = _OBJECTIVE / max(program.speed(x), _SLOWEST)
    solution = run(x0=x, p=[goal.viscosity, goal.density, smoothing, scale], **bounds)
    stats, g = run.stats(), np.array(solution["g"]).ravel()
    broken = max(np.max(g - bounds["ubg"]), np.max(bounds["lbg"] - g))
    status = "optimal" if stats["success"] else "feasible" if broken <= _FEASIBLE else "failed"
    last = {name: float(values[-1]) for name, values in stats["iterations"].items() if name in ("inf_pr", "inf_du")}
    return Optimum(
        status if np.isfinite(g).all() else "failed",
        -float(solution["f"]) / scale,
        float(g[-1]),
        float(np.array(solution["lam_g"]).ravel()[-1]) / scale,
        max(last.values()),
        int(stats["iter_count"]),
        plain(program.unpack(np.array(solution["x"]).ravel())),
    )


@lru_cache(maxsize=24)
def _solver(
    robot: Robot, mesh: Mesh, currency: Currency, limited: bool, held: bool, barrier: float | None
) -> tuple[Transcription, Any]:
    """The program and its solver, whose barrier begins at a value or, from far away, adapts."""
    program = _transcription(robot, mesh, currency, limited, held)
    problem, derivatives = program.program
    settings = _SETTINGS | (_FAR if barrier is None else _NEAR | {"ipopt.mu_init": barrier})
    return program, ca.nlpsol("limit", "ipopt", problem, settings | derivatives)


@lru_cache(maxsize=8)
def _transcription(robot: Robot, mesh: Mesh, currency: Currency, limited: bool, held: bool) -> Transcription:
    return Transcription(robot, mesh, currency, limited=limited, held=held)


def plain(cycle: Cycle) -> dict[str, Any]:
    """A cycle as lists and numbers."""
    return {name: value.tolist() if isinstance(value, np.ndarray) else value for name, value in cycle._asdict().items()}


def cycle_of(values: Mapping[str, Any]) -> Cycle:
    """The cycle that `plain` made lists of."""
    return Cycle(values["half_period"], *(np.array(values[name], float) for name in Cycle._fields[1:]))


def held_cycle(cycle: Cycle, step: float) -> tuple[Cycle, Mesh]:
    """A start for held targets: a cycle whose targets stay for whole control steps of `step` seconds, and its mesh.

    Half a period becomes whole control steps, of which a knot lasts several where there would be more than 64 knots.
    """
    steps = max(round(cycle.half_period / step), _FEWEST)
    each = math.ceil(steps / _MOST)
    knots = round(steps / each)
    mesh = Mesh(knots, 2 if 2 * knots <= _MOST else 1)
    middles = (np.arange(mesh.knots) + 0.5) / mesh.knots * len(cycle.targets)
    whole = np.vstack([cycle.targets, -cycle.targets[:1]])
    targets = np.stack([np.interp(middles, np.arange(len(whole)), column) for column in whole.T], axis=1)
    moved = on_mesh(cycle, mesh)
    return moved._replace(half_period=mesh.knots * each * step, targets=targets), mesh


def on_mesh(cycle: Cycle, mesh: Mesh) -> Cycle:
    """A cycle on another mesh, linear between its points; its mesh is told by its numbers of knots and points."""
    knots, points = len(cycle.targets), len(cycle.gains)
    own = Mesh(knots, points // (knots * (len(mesh.places) - 1) // mesh.intervals))
    if own == mesh:
        return cycle

    def moved(rows: FloatArray, places: FloatArray, to: FloatArray) -> FloatArray:
        return np.stack([np.interp(to, places, column) for column in rows.T], axis=1)

    whole = np.vstack([cycle.targets, -cycle.targets[:1]])
    return Cycle(
        cycle.half_period,
        moved(whole, np.arange(knots + 1) / knots, np.arange(mesh.knots) / mesh.knots),
        moved(cycle.states, own.places, mesh.places),
        moved(cycle.gains, own.places[1:], mesh.places[1:]),
    )
