"""Direct collocation of half a period: the fastest gait at a power as a nonlinear program (ours).

The gait is mirrored after half its period: all angles have then changed their signs, so that it swims straight. States
are polynomials between the Radau points of each interval, target angles are linear between knots, or held from knot to
knot as a policy's are. The unknowns x are half the period, the targets, and angles, rates and gains of rates at every
point. What holds at a point is written with its local unknowns y = E x. Constraints are L x + F(y), power is a weighted
sum of p(y): derivatives are assembled from those of F and p at single points, which CasADi on its own would not find;
so a solution takes seconds.
"""

from functools import cached_property
from typing import Any, Literal, NamedTuple

import casadi as ca
import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from snakebench.collocation.equations import FluidSymbols, Motion, command_torques, imbalance
from snakebench.robot import Robot
from snakebench.value import FloatArray

Currency = Literal["net", "positive"]  # mean power P, or P+ of the joints that drive
DEGREE = 3  # of the polynomials
ANGLE, RATE, GAIN = 3.0, 60.0, 5000.0  # bounds of links' angles [rad], rates [rad/s] and their gains [rad/s^2]
SPEED = 3.0  # bound of the body's velocity [m/s]
SHORTEST = 1 / 30  # interval between knots: policies' control step [s]
LONGEST = 10.0  # half period [s]
PARAMETERS = ("viscosity", "density", "smoothing")  # of each point's functions


class Mesh(NamedTuple):
    """How half a period is divided."""

    knots: int  # of targets
    parts: int = 1  # intervals of the states between two knots

    @property
    def intervals(self) -> int:
        """Intervals of the states."""
        return self.knots * self.parts

    @property
    def places(self) -> FloatArray:
        """The start and the points, in shares of half a period, shape (1 + intervals * DEGREE,)."""
        points = (np.arange(self.intervals)[:, None] + ca.collocation_points(DEGREE, "radau")) / self.intervals
        return np.concatenate([[0.0], points.ravel()])


class Cycle(NamedTuple):
    """Half a period of a motion at the start and the points of a mesh."""

    half_period: float  # [s]
    targets: FloatArray  # at the knots [rad], shape (knots, n_joints)
    states: (
        FloatArray  # angles and rates of links [rad, rad/s], velocity of the body [m/s]: (1 + points, 2 n_links + 2)
    )
    gains: FloatArray  # of the rates and of the velocity [1/s of them], shape (points, n_links + 2)


class Transcription:
    """The program of a robot on a mesh for one currency.

    `limited` joints have a bound on their rates. Targets that are `held` stay as they are from knot to knot.
    """

    def __init__(
        self, robot: Robot, mesh: Mesh, currency: Currency, *, limited: bool = False, held: bool = False
    ) -> None:
        n = robot.n_links
        self.robot, self.mesh, self.currency = robot, mesh, currency
        self.points, self.joints, self.states, self.gains = mesh.intervals * DEGREE, n - 1, 2 * n + 2, n + 2
        self.shares = n - 1 if currency == "positive" else 0  # local unknowns that bound each joint's positive power
        self.limited, self.held = limited, held
        self.first = 1 + mesh.knots * self.joints + self.states  # where the first point's unknowns begin
        self.stride = self.states + self.gains + self.shares
        self.size = self.first + self.points * self.stride

    @cached_property
    def local(self) -> tuple[Any, Any, Any]:
        """F and p of a point, their first derivatives, and the second one of their sum with weights, as functions."""
        n = self.robot.n_links
        widths = {"half": 1, "angle": n, "rate": n + 2, "gain": n + 2, "target": n - 1, "share": self.shares}
        y, fluid = ca.SX.sym("y", sum(widths.values())), ca.SX.sym("fluid", len(PARAMETERS))
        ends = np.cumsum([0, *widths.values()])
        half, angle, rate, gain, target, share = (y[a:b] for a, b in zip(ends, ends[1:], strict=False))
        motion, step = Motion(angle, rate, gain, target), half / self.mesh.intervals
        u_in, turn = command_torques(self.robot, motion)
        rows = [-step * rate[:n], -step * gain, imbalance(self.robot, motion, FluidSymbols(*ca.vertsplit(fluid)))]
        rows += [share - u_in * turn] if self.shares else []
        rows += [turn] if self.limited else []
        rows += [u_in, u_in + self.robot.torque_fall * turn] if self.robot.torque_limit else []
        f, p = ca.vertcat(*rows), ca.sum1(share if self.shares else u_in * turn)
        weights, weight = ca.SX.sym("weights", f.shape[0]), ca.SX.sym("weight")
        second, _ = ca.hessian(ca.dot(weights, f) + weight * p, y)
        options = {"cse": True}
        return (
            ca.Function("value", [y, fluid], [f, p], options),
            ca.Function("first", [y, fluid], [ca.jacobian(f, y), ca.jacobian(p, y)], options),
            ca.Function("second", [y, fluid, weights, weight], [second], options),
        )

    @cached_property
    def weights(self) -> FloatArray:
        """Share of each point in a mean over half a period, shape (points,)."""
        _, _, quadrature = ca.collocation_coeff(ca.collocation_points(DEGREE, "radau"))
        return np.tile(np.array(quadrature).ravel(), self.mesh.intervals) / self.mesh.intervals

    @cached_property
    def rows(self) -> int:
        """Number of constraints at each point."""
        return int(self.local[0].size1_out(0))

    @cached_property
    def expansion(self) -> Any:
        """E: the local unknowns y of all points, one after another, from x."""
        m = self.local[0].size1_in(0)
        e = sparse.lil_matrix((self.points * m, self.size))
        before, shares = self._between_knots
        for k in range(self.points):
            row, own = k * m, self.first + k * self.stride
            e[row, 0] = 1.0
            for i in range(self.states + self.gains):
                e[row + 1 + i, own + i] = 1.0
            for j in range(self.joints):
                at, share = row + 1 + self.states + self.gains + j, shares[k]
                e[at, 1 + before[k] * self.joints + j] = 1 - share
                mirrored = before[k] + 1 == self.mesh.knots
                e[at, 1 + (0 if mirrored else before[k] + 1) * self.joints + j] += -share if mirrored else share
            for j in range(self.shares):
                e[row + 1 + self.states + self.gains + self.joints + j, own + self.states + self.gains + j] = 1.0
        return _casadi(e)

    @cached_property
    def _between_knots(self) -> tuple[NDArray[np.int64], FloatArray]:
        """The knot before each point, and the share of the next one in its targets; each of shape (points,)."""
        place = self.mesh.places[1:] * self.mesh.knots
        before = np.minimum(np.floor(place - 1e-9).astype(np.int64), self.mesh.knots - 1)
        return before, np.zeros(self.points) if self.held else place - before

    @cached_property
    def linear(self) -> Any:
        """L: derivatives of the polynomials at all points, and the states' mirror image after half a period."""
        c, _, _ = ca.collocation_coeff(ca.collocation_points(DEGREE, "radau"))
        c = np.array(c)  # (DEGREE + 1, DEGREE)
        rows = sparse.lil_matrix((self.points * self.rows + self.states, self.size))
        for k in range(self.points):
            interval, point = divmod(k, DEGREE)
            for j in range(DEGREE + 1):
                at = self._state_at(interval * DEGREE + j)
                for i in range(self.states):
                    rows[k * self.rows + i, at + i] = c[j, point]
        mirrored = np.ones(self.states)
        mirrored[-2] = -1.0  # the velocity along x stays
        for i in range(self.states):
            rows[self.points * self.rows + i, self._state_at(self.points) + i] = 1.0
            rows[self.points * self.rows + i, self._state_at(0) + i] += mirrored[i]
        return _casadi(rows)

    def _state_at(self, k: int) -> int:
        """Where the states of the start, 0, or of a point, from 1, begin in x."""
        return self.first - self.states if k == 0 else self.first + (k - 1) * self.stride

    @cached_property
    def program(self) -> tuple[dict[str, Any], dict[str, Any]]:
        """What `casadi.nlpsol` takes: the program, of -v times its last parameter, and its derivatives."""
        value, first, second = (function.map(self.points) for function in self.local)
        x, p = ca.MX.sym("x", self.size), ca.MX.sym("p", len(PARAMETERS) + 1)
        m, w, e = self.local[0].size1_in(0), ca.DM(self.weights).T, self.expansion
        y, fluid = ca.reshape(e @ x, m, self.points), ca.repmat(p[:-1], 1, self.points)
        f, power = value(y, fluid)
        g = ca.vertcat(self.linear @ x + ca.vertcat(ca.vec(f), ca.DM.zeros(self.states, 1)), ca.dot(power, w))
        f_y, p_y = first(y, fluid)
        slopes = ca.vertcat(ca.diagcat(*ca.horzsplit(f_y, m)) @ e, ca.DM(self.states, self.size))
        spending = (ca.vec(p_y).T * ca.vec(ca.repmat(w, m, 1)).T) @ e
        lam_f, lam_g = ca.MX.sym("lam_f"), ca.MX.sym("lam_g", g.shape[0])
        of_points = ca.reshape(lam_g[: self.points * self.rows], self.rows, self.points)
        bend = ca.diagcat(*ca.horzsplit(second(y, fluid, of_points, lam_g[-1] * w), m))
        return {"x": x, "p": p, "f": -p[-1] * ca.dot(self.speeds, x), "g": g}, {
            "jac_g": ca.Function(
                "jac_g", [x, p], [g, ca.vertcat(self.linear + slopes, spending)], ["x", "p"], ["g", "jac_g_x"]
            ),
            "hess_lag": ca.Function(
                "hess_lag",
                [x, p, lam_f, lam_g],
                [ca.triu(e.T @ bend @ e)],
                ["x", "p", "lam_f", "lam_g"],
                ["triu_hess_gamma_x_x"],
            ),
        }

    @cached_property
    def speeds(self) -> FloatArray:
        """The row whose product with x is the mean speed."""
        row = np.zeros(self.size)
        row[self.first + self.states - 2 :: self.stride][: self.points] = self.weights
        return row

    def speed(self, x: FloatArray) -> float:
        """The mean speed [m/s] of unknowns x."""
        return float(self.speeds @ x)

    def bounds(
        self, bound: float, power: float, joint_rate: float = np.inf, half_period: float | None = None
    ) -> dict[str, FloatArray]:
        """Bounds of x and g: targets within ± `bound` [rad], mean `power` [W], joints' rates [rad/s].

        Half a period [s], if given, is fixed.
        """
        n = self.robot.n_links
        states = np.concatenate([np.full(n, ANGLE), np.full(n, RATE), [SPEED, SPEED]])
        point = np.concatenate([states, np.full(self.gains, GAIN), np.full(self.shares, np.inf)])
        targets = np.full(self.mesh.knots * self.joints, bound)
        upper = np.concatenate([[LONGEST], targets, states, np.tile(point, self.points)])
        lower = -upper
        lower[0], upper[0] = (half_period, half_period) if half_period else (self.mesh.knots * SHORTEST, LONGEST)
        lower[self.first :].reshape(self.points, self.stride)[:, self.states + self.gains :] = 0.0
        low, high = self._row_bounds(joint_rate)
        ends = np.zeros(self.states)
        return {
            "lbx": lower,
            "ubx": upper,
            "lbg": np.concatenate([np.tile(low, self.points), ends, [-np.inf]]),
            "ubg": np.concatenate([np.tile(high, self.points), ends, [power]]),
        }

    def _row_bounds(self, joint_rate: float) -> tuple[FloatArray, FloatArray]:
        """Bounds of the rows of F, in the order of `local`."""
        parts = [(0.0, 0.0)] * (self.states + self.gains)
        if self.shares:
            parts += [(0.0, np.inf)] * self.joints
        if self.limited:
            parts += [(-joint_rate, joint_rate)] * self.joints
        if most := self.robot.torque_limit:
            parts += [(-most, most)] * (2 * self.joints)
        low, high = np.transpose(parts)
        return low, high

    def pack(self, cycle: Cycle) -> FloatArray:
        """The unknowns x of a cycle on this mesh."""
        shares = self._driving(cycle) if self.shares else np.zeros((self.points, 0))
        points = np.hstack([cycle.states[1:], cycle.gains, shares])
        return np.concatenate([[cycle.half_period], cycle.targets.ravel(), cycle.states[0], points.ravel()])

    def _driving(self, cycle: Cycle) -> FloatArray:
        """The positive part of each joint's power at every point [W], shape (points, n_joints)."""
        n, rows = self.robot.n_links, np.vstack([cycle.targets, -cycle.targets[:1]])
        place = np.add(*self._between_knots)
        targets = np.stack([np.interp(place, np.arange(len(rows)), column) for column in rows.T], axis=1)
        angle, turn = np.diff(cycle.states[1:, :n]), np.diff(cycle.states[1:, n : 2 * n])
        u_in = self.robot.proportional_gain * (targets - angle) - self.robot.derivative_gain * turn
        return np.maximum(u_in * turn, 0.0)

    def unpack(self, x: FloatArray) -> Cycle:
        """The cycle that unknowns x describe."""
        targets = x[1 : self.first - self.states].reshape(self.mesh.knots, self.joints)
        points = x[self.first :].reshape(self.points, self.stride)
        states = np.vstack([x[self.first - self.states : self.first], points[:, : self.states]])
        return Cycle(float(x[0]), targets, states, points[:, self.states : self.states + self.gains])


def _casadi(matrix: Any) -> Any:
    """A SciPy matrix as one of CasADi."""
    columns = sparse.csc_matrix(matrix)
    columns.sort_indices()
    pattern = ca.Sparsity(*columns.shape, columns.indptr.tolist(), columns.indices.tolist())
    return ca.DM(pattern, columns.data)
