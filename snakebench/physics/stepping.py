"""The compiled half of the planar engine: steps of time, for one robot after another of a batch.

Torque gaits step by the classical Runge-Kutta method of order four. Under the servo the joints are stiff (its damping
alone decays at some 800 1/s), so target angles step by the implicit midpoint rule, of order two: two solutions of
`accelerate` with its stiff terms anticipated by half a step. Work is integrated with the state, at the same points.
"""

import math
from typing import Any

import numpy as np
from numba import prange
from numpy.typing import NDArray

from snakebench.compilation import njit
from snakebench.physics.chain import CHAIN, SCRATCH, accelerate, spend
from snakebench.physics.joints import applied_torque, command_torque
from snakebench.physics.record import JOINT_RATE_MAX, V_MAX, record_of
from snakebench.physics.waveform import HELD, command_at
from snakebench.robot import MAX_LINKS
from snakebench.sources import code_digest
from snakebench.value import FloatArray

# A part p of a step, at first all of it, is halved up to _HALVINGS times while in half of it the angular speed of some
# link changes by more than _SWING / p [rad/s]: targets that jump are followed through the jump (ours).
_SWING = 0.4
_HALVINGS = 6

# A member of a batch: the chain, its state, and what commands it; its place and rate stand in arrays beside it.
MEMBER = np.dtype(
    [
        ("chain", CHAIN),
        ("alive", "?"),
        ("steps", "i8"),  # made since t = 0
        ("halvings", "i8"),  # of the last step
        ("energy", "f8", (4,)),  # as in Record [J]
        # A Waveform; its table stands in an array beside it.
        ("kind", "i8"),
        ("rate", "f8"),
        ("rows", "i8"),
        ("bound", "f8"),
        ("since", "i8"),  # the step at which it began
    ]
)
Members = NDArray[np.void]

# Room for a step.
WORK = np.dtype(
    [
        ("place", "f8", (MAX_LINKS + 2,)),
        ("rate", "f8", (MAX_LINKS + 2,)),
        ("place_gain", "f8", (MAX_LINKS + 2,)),
        ("rate_gain", "f8", (MAX_LINKS + 2,)),
        ("energy_gain", "f8", (4,)),
        ("command", "f8", (MAX_LINKS,)),
        ("scratch", SCRATCH),
        ("apart", "f8", (16,)),  # unused: keeps the rooms of two threads on separate cache lines
    ]
)


@njit(inline="always")
def _ask(member: Any, table: FloatArray, time: float, command: FloatArray) -> None:
    command_at(member.kind, member.rate, table, member.rows, member.bound, time, command[: table.shape[1]])


@njit(error_model="numpy")
def _runge_kutta(
    member: Any, table: FloatArray, physics_rate: float, place: FloatArray, rate: FloatArray, w: Any
) -> None:
    """One step of order four."""
    dt, chain, s = 1 / physics_rate, member.chain, w.scratch
    w.place_gain[:], w.rate_gain[:], w.energy_gain[:] = 0.0, 0.0, 0.0
    for stage in range(4):
        share = 0.5 * ((stage + 1) // 2)  # 0, 1/2, 1/2, 1
        asked = 0.5 if member.kind == HELD else share
        if stage == 0:
            for i in range(len(place)):
                w.place[i], w.rate[i] = place[i], rate[i]
        else:
            for i in range(len(place)):
                w.place[i] = place[i] + share * dt * w.rate[i]
                w.rate[i] = rate[i] + share * dt * s.acceleration[i]
        if stage != 2 and (stage == 0 or member.kind != HELD):
            _ask(member, table, (member.steps - member.since + asked) / physics_rate, w.command)
        time = (member.steps + share) / physics_rate
        accelerate(chain, time, w.place, w.rate, w.place, w.rate, 0.0, w.command, s)
        spend(chain, w.place, w.rate, w.command, s)
        weight = dt / 6 if stage in (0, 3) else dt / 3
        for i in range(len(place)):
            w.place_gain[i] += weight * w.rate[i]
            w.rate_gain[i] += weight * s.acceleration[i]
        for i in range(4):
            w.energy_gain[i] += weight * s.power[i]
    for i in range(len(place)):
        place[i] += w.place_gain[i]
        rate[i] += w.rate_gain[i]
    for i in range(4):
        member.energy[i] += w.energy_gain[i]


@njit(error_model="numpy")
def _midpoint(member: Any, table: FloatArray, physics_rate: float, place: FloatArray, rate: FloatArray, w: Any) -> None:
    """One step of order two, in as many equal or unequal parts as the joints' accelerations ask for."""
    chain, s, done = member.chain, w.scratch, 0.0
    while done < 1.0:
        part = 0.5**member.halvings
        half = 0.5 * part / physics_rate
        _ask(member, table, (member.steps - member.since + done + part / 2) / physics_rate, w.command)
        time = (member.steps + done + part / 2) / physics_rate
        accelerate(chain, time, place, rate, place, rate, half, w.command, s)
        swing = 0.0
        for i in range(2, len(place)):
            swing = max(swing, abs(s.acceleration[i]) * half * part)
        if swing > _SWING and member.halvings < _HALVINGS:
            member.halvings += 1
            continue
        for i in range(len(place)):
            w.rate[i] = rate[i] + half * s.acceleration[i]
            w.place[i] = place[i] + half * w.rate[i]
        accelerate(chain, time, w.place, w.rate, place, rate, half, w.command, s)
        for i in range(len(place)):
            w.rate[i] = rate[i] + half * s.acceleration[i]
            place[i] += 2 * half * w.rate[i]
            rate[i] += 2 * half * s.acceleration[i]
            w.place[i] = place[i] - half * w.rate[i]
        spend(chain, w.place, w.rate, w.command, s)
        for i in range(4):
            member.energy[i] += 2 * half * s.power[i]
        done += part
        if member.halvings > 0 and 8 * swing < _SWING and done % (2 * part) == 0.0:
            member.halvings -= 1


@njit(error_model="numpy")
def _observe(member: Any, place: FloatArray, rate: FloatArray, command: FloatArray, row: FloatArray) -> None:
    """Write the present into a row of a record."""
    chain = member.chain
    n = chain.n_joints
    now = record_of(row, n)
    x, y, v_x, v_y = place[0], place[1], rate[0], rate[1]
    for i in range(n + 1):
        lever, cos, sin = chain.lever[i], math.cos(place[2 + i]), math.sin(place[2 + i])
        x, y = x + lever * cos, y + lever * sin
        v_x, v_y = v_x - lever * rate[2 + i] * sin, v_y + lever * rate[2 + i] * cos
    now.head[0], now.head[1], now.head[2] = x, y, place[2]
    now.head_rate[0], now.head_rate[1], now.head_rate[2] = v_x, v_y, rate[2]
    for j in range(n):
        angle, turn = place[3 + j] - place[2 + j], rate[3 + j] - rate[2 + j]
        u_in = command_torque(chain, command[j], angle, turn)
        now.joint_angle[j], now.joint_rate[j], now.command[j] = angle, turn, command[j]
        now.command_torque[j], now.torque[j] = u_in, applied_torque(chain, u_in, angle, turn)
    for a in range(2):
        now.center[a], now.center_rate[a] = place[a], rate[a]
    now.energy[:] = member.energy


@njit(error_model="numpy")
def _within_bounds(rate: FloatArray) -> bool:
    """Whether the state, and so its rate, is finite and not too fast."""
    for i in range(2, len(rate) - 1):
        if not abs(rate[i + 1] - rate[i]) <= JOINT_RATE_MAX:
            return False
    return math.hypot(rate[0], rate[1]) <= V_MAX


@njit(error_model="numpy")
def _swim(
    member: Any,
    table: FloatArray,
    physics_rate: float,
    n_steps: int,
    place: FloatArray,
    rate: FloatArray,
    rows: FloatArray,
    w: Any,
) -> None:
    """Make steps and write as many rows as there are, the first before them, the others equally spaced in them.

    A member that diverged makes no more steps; its rows repeat its last state.
    """
    every = n_steps // (len(rows) - 1)
    member.since = member.steps
    _ask(member, table, (member.steps - member.since) / physics_rate, w.command)
    _observe(member, place, rate, w.command, rows[0])
    for k in range(1, n_steps + 1):
        if member.alive:
            if member.chain.servo:
                _midpoint(member, table, physics_rate, place, rate, w)
            else:
                _runge_kutta(member, table, physics_rate, place, rate, w)
            member.steps += 1
            member.alive = _within_bounds(rate)
        if k % every == 0:
            if k < n_steps or member.kind != HELD:
                _ask(member, table, (member.steps - member.since) / physics_rate, w.command)
            _observe(member, place, rate, w.command, rows[k // every])


def _entry(key: str, *, parallel: bool) -> Any:
    """The compiled function that Python calls; numba keeps it on disk under a key that includes `key`."""

    @njit(cache=True, nogil=True, parallel=parallel)
    def swim(
        members: Members,
        tables: FloatArray,
        physics_rate: float,
        n_steps: int,
        places: FloatArray,
        rates: FloatArray,
        rows: FloatArray,
        work: NDArray[np.void],
    ) -> None:
        key  # noqa: B018
        for t in prange(len(work)):
            for b in range(t * len(members) // len(work), (t + 1) * len(members) // len(work)):
                _swim(members[b], tables[b], physics_rate, n_steps, places[b], rates[b], rows[b], work[t])

    return swim


# One thread needs no pool of threads, whose idle ones would wait busily beside a learner; more share out the members,
# as many as there is room to work in.
_CODE = code_digest("physics.stepping")
swim_in_turn, swim_side_by_side = _entry(_CODE, parallel=False), _entry(f"{_CODE} parallel", parallel=True)
