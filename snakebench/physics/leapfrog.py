"""Bullet's step, read as what it is: a leapfrog, of second order where forces depend on velocity and torques jump.

Bullet changes the velocities, then moves the body by the new velocity times the step. So the poses before and after
step k give the velocity d_k in its middle, exactly. The impulse between two steps acts at the instant between them.
Half of it ends the step before, at the old command; the other half begins the step after, at the new command:

    v_k = d_k + g_k + h R torque(old command, (d_k + v_k) / 2)
    w_k = v_k + g_k + h R torque(new command, (v_k + w_k) / 2)

Here h is half a step, R the response of the velocities to the joints' torques (inverse mass matrix), and g_k what all
other forces add in half a step. Both equations are solved for the joints' own damping, so that a stiff servo is stable.
v_k is the velocity at the instant: fluid forces depend on it, and it is observed. w_k predicts d_{k+1}, and its error
corrects g: g_{k+1} = g_k + (d_{k+1} - w_k) / 2.

Two corrections act as forces on the links. Bullet takes inertial forces at d_k, not the mean of those at d_k and
d_{k+1}: half the difference, at w_k, is added. And what momentum the centre of mass has beyond the sum of the fluid's
impulses is taken back in the next step, spread over the links by mass. (All of it ours.)
"""

from typing import Any

from snakebench.compilation import njit
from snakebench.physics.algebra import factorise, solve
from snakebench.physics.joints import applied_torque, command_torque, slopes
from snakebench.physics.record import Record
from snakebench.robot import MAX_LINKS
from snakebench.value import FloatArray

_PASSES = 3  # of the equations for v and w, where a torque meets its limit on the way

# Velocities are those of head x, y, heading and joint angles.
LEAPFROG = [
    ("d", "f8", (MAX_LINKS + 2,)),  # in the middle of the last step
    ("v", "f8", (MAX_LINKS + 2,)),  # now
    ("w", "f8", (MAX_LINKS + 2,)),  # in the middle of the next step, predicted
    ("g", "f8", (MAX_LINKS + 2,)),  # gained in half a step by all but the joints' torques
    ("old_command_torque", "f8", (MAX_LINKS,)),  # in the half step that ends now [N m]
    ("old_torque", "f8", (MAX_LINKS,)),  # the same with the passive joints
    ("new_command_torque", "f8", (MAX_LINKS,)),  # in the half step that begins now [N m]
    ("new_torque", "f8", (MAX_LINKS,)),  # the same with the passive joints
    ("momentum", "f8", (2,)),  # that the fluid has given the robot [N s]
    ("excess", "f8", (2,)),  # that the centre of mass has beyond it [N s]
    # Room to work in.
    ("mass_matrix", "f8", (MAX_LINKS + 2, MAX_LINKS + 2)),
    ("factors", "f8", (MAX_LINKS, MAX_LINKS)),  # of that of heading and joints, with damping
    ("factored", "?"),
    ("damped", "f8", (MAX_LINKS,)),  # the damping in `factors` [N m s/rad]
    ("middle", "f8", (MAX_LINKS,)),  # joint rates in the middle of half a step [rad/s]
    ("gain", "f8", (MAX_LINKS + 2,)),  # of velocity in half a step by the joints' torques
    ("inertial", "f8", (MAX_LINKS, 2)),  # accelerations of links that Bullet lacks [m/s^2]
]


@njit(error_model="numpy")
def end_step(s: Any, now: Record, before: Record, command: FloatArray) -> None:
    """Find the velocities at the end of the step that led to the present pose, at the command it ends with."""
    n, step = s.n_joints + 3, s.dt
    for a in range(n):
        here, there = (now.head[a], before.head[a]) if a < 3 else (now.joint_angle[a - 3], before.joint_angle[a - 3])
        s.d[a] = (here - there) / step
        s.g[a] += (s.d[a] - s.w[a]) / 2
    _kick(s, now.joint_angle, command, s.d, s.v, s.old_command_torque, s.old_torque)
    for a in range(3):
        now.head_rate[a] = s.v[a]
    for j in range(s.n_joints):
        now.joint_rate[j] = s.v[3 + j]


@njit(error_model="numpy")
def begin_step(s: Any, now: Record, command: FloatArray) -> None:
    """Write what Bullet is given for the next step, which begins with a command, into `s.drive`."""
    _kick(s, now.joint_angle, command, s.v, s.w, s.new_command_torque, s.new_torque)
    for a in range(3):
        s.drive[a] = s.load[a]
    for j in range(s.n_joints):
        s.drive[3 + j] = s.load[3 + j] + (s.old_torque[j] + s.new_torque[j]) / 2
    _correct(s)


@njit(error_model="numpy")
def balance(s: Any, now: Record, before: Record) -> None:
    """Compare what the centre of mass has gained in the last step with what the fluid's forces gave, and go on."""
    for a in range(2):
        s.excess[a] = (now.center[a] - before.center[a]) / s.dt * s.total_mass - s.momentum[a]
        s.momentum[a] += s.dt * s.load[a]


@njit(error_model="numpy")
def _kick(
    s: Any,
    angle: FloatArray,
    command: FloatArray,
    start: FloatArray,
    end: FloatArray,
    in_torque: FloatArray,
    torque: FloatArray,
) -> None:
    """Go from `start` to the velocities `end` in half a step; write the joints' torques in the middle of it.

    The law of the joints is linearised where they start, and again where that finds another slope in the middle.
    """
    n, h = s.n_joints, s.dt / 2
    for j in range(n):
        s.middle[j] = start[3 + j]
    for attempt in range(_PASSES + 1):
        for j in range(n):
            in_torque[j] = command_torque(s, command[j], angle[j], s.middle[j])
            torque[j] = applied_torque(s, in_torque[j], angle[j], s.middle[j])
            _, slope = slopes(s, in_torque[j], angle[j], s.middle[j])
            s.factored = s.factored and slope == s.damped[j]
            s.damped[j] = slope
        if attempt == _PASSES or (s.factored and attempt > 0):
            break
        if not s.factored:
            _factorise(s, h)
        s.gain[2] = 0.0
        for j in range(n):
            behind = s.middle[j] - start[3 + j] - s.g[3 + j] / 2
            s.gain[3 + j] = h * (torque[j] + s.damped[j] * behind)
        solve(s.factors, s.gain[2:], n + 1, 1)
        for j in range(n):
            s.middle[j] = start[3 + j] + (s.g[3 + j] + s.gain[3 + j]) / 2
    for a in range(2):  # inner torques leave the centre of mass where it is
        s.gain[a] = 0.0
        for c in range(2, n + 3):
            s.gain[a] -= s.mass_matrix[c, a] / s.total_mass * s.gain[c]
    for a in range(n + 3):
        end[a] = start[a] + s.g[a] + s.gain[a]


@njit(error_model="numpy")
def _factorise(s: Any, h: float) -> None:
    """Factorise the mass matrix of heading and joints about the centre of mass, damping over half of `h` added."""
    n, matrix = s.n_joints + 1, s.mass_matrix
    for i in range(n):
        x, y = matrix[2 + i, 0] / s.total_mass, matrix[2 + i, 1] / s.total_mass
        for j in range(i + 1):
            s.factors[i, j] = matrix[2 + i, 2 + j] - x * matrix[2 + j, 0] - y * matrix[2 + j, 1]
    for j in range(s.n_joints):
        s.factors[1 + j, 1 + j] += h / 2 * s.damped[j]
    factorise(s.factors, n)
    s.factored = True


@njit(error_model="numpy")
def _correct(s: Any) -> None:
    """Add the inertial forces that Bullet lacks, and those that take excess momentum back, to `s.drive`."""
    n, place, inertial = s.n_joints, s.place, s.inertial
    back_x, back_y = s.excess[0] / (s.dt * s.total_mass), s.excess[1] / (s.dt * s.total_mass)
    turn, ahead = s.d[2], s.w[2]
    behind = s.length[0] / 4 * (ahead * ahead - turn * turn)  # towards the joint behind, half the difference of the two
    inertial[0, 0], inertial[0, 1] = back_x, back_y
    for i in range(1, n + 1):
        turn += s.d[2 + i]
        ahead += s.w[2 + i]
        front, behind = behind, s.length[i] / 4 * (ahead * ahead - turn * turn)
        inertial[i, 0] = inertial[i - 1, 0] + front * place[i - 1, 3] + behind * place[i, 3]
        inertial[i, 1] = inertial[i - 1, 1] + front * place[i - 1, 4] + behind * place[i, 4]
    force_x = force_y = moment = 0.0
    for i in range(n, -1, -1):
        arm_x, arm_y = s.length[i] / 2 * place[i, 3], s.length[i] / 2 * place[i, 4]
        moment -= arm_x * force_y - arm_y * force_x
        force_x -= s.mass[i] * inertial[i, 0]
        force_y -= s.mass[i] * inertial[i, 1]
        if i > 0:
            moment -= arm_x * force_y - arm_y * force_x
            s.drive[2 + i] += moment
    s.drive[0] += force_x
    s.drive[1] += force_y
    s.drive[2] += moment
