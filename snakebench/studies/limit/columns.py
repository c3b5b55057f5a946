"""The tables of the study of the limit."""

from snakebench.tables import EVALUATION, Columns

# A point: where the limit is wanted. `allowed` is the largest mean power in its currency.
POINT: Columns = {
    "fluid": str | None,
    "viscosity": float,
    "density": float,
    "currency": str,
    "bounds": str,
    "bound": float,
    "speed_limit": float | None,
    "allowed": float,
}
# Its optimum, before any replay. `change` is of speed, by the last refinement of the mesh; `gap` is of speed,
# of the replay in PyBullet at equal power.
OPTIMUM: Columns = {
    **dict.fromkeys(("optimal_speed", "optimal_power", "multiplier", "residual", "frequency", "at_bound"), float),
    **dict.fromkeys(("knots", "intervals"), int),
    "smoothing": float,  # of absolute values of velocities in the force law [m/s]
    **dict.fromkeys(("starts", "agreeing"), int),
    "change": float | None,
    "gap": float | None,
    "planar_gap": float | None,
}
TABLES: dict[str, Columns] = {
    "limit": POINT | OPTIMUM | EVALUATION,  # published points, with the replay of the waveform in PyBullet
    "replays": POINT | {"waveform": str, "engine": str, "physics_rate": int, "published": bool} | EVALUATION,
    "gaits": POINT | {"knot": int, "period": float},  # and joint_1, joint_2, …: target angles [rad]
    "solutions": POINT
    | {"start": str, "status": str, "knots": int, "intervals": int, "smoothing": float, "iterations": int}
    | dict.fromkeys(("optimal_speed", "optimal_power", "residual"), float),
}
