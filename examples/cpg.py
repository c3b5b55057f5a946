"""A plug-in for snakebench: a gait of coupled oscillators, a robot, a fluid, a metric and a sampler.

export SNAKEBENCH_PLUGINS=examples/cpg.py
snakebench list
"""

from typing import ClassVar, Literal

import numpy as np
import optuna
from pydantic import Field
from scipy.integrate import solve_ivp

import snakebench as sb


class Cpg(sb.Gait):
    """Central pattern generator: a chain of phase oscillators, one for each joint, coupled to its neighbours.

    theta_i' = 2 pi f + k sum_j sin(theta_j - theta_i - (i - j) psi),  r_i' = k (R_i - r_i),  a_i = r_i sin theta_i,
    It starts with equal phases and zero amplitude. R_i grows linearly towards the tail, as in a sea snake.
    """

    SPACE: ClassVar = {"amplitude": (0.1, 1.0), "frequency": (0.1, 1.5), "phase": (0.1, 1.3)}

    kind: Literal["cpg"] = "cpg"
    amplitude: float = Field(gt=0, description="target angle of the last joint R [rad]")
    frequency: float = Field(gt=0, description="frequency of the oscillators f [Hz]")
    phase: float = Field(description="final phase lag from joint to joint psi [rad]")
    coupling: float = Field(4.0, gt=0, description="coupling strength k [1/s]")

    @property
    def drives(self) -> Literal["angle"]:
        """The commands are target angles."""
        return "angle"

    def commands(self, times, n_joints):
        """Target angles [rad] at times [s], shape (n_times, n_joints)."""

        def rate(_, phases):
            error = np.sin(np.diff(phases) + self.phase)  # of the phase lag between neighbours
            coupling = np.concatenate([error, [0.0]]) - np.concatenate([[0.0], error])
            return 2 * np.pi * self.frequency + self.coupling * coupling

        span = (0.0, float(times[-1]) + 1e-9)
        phases = solve_ivp(rate, span, np.zeros(n_joints), t_eval=times, rtol=1e-8, atol=1e-8).y.T
        growth = 1 - np.exp(-self.coupling * np.asarray(times))[:, None]
        share = np.arange(1, n_joints + 1) / n_joints
        return growth * share * self.amplitude * np.sin(phases)


def mean_curvature(trajectory, window):
    """Mean absolute curvature of the body over the steady window [rad/m]."""
    inside = (trajectory.time >= window.start) & (trajectory.time <= window.end)
    return float(np.abs(trajectory.joint_angle[inside]).mean() / trajectory.robot.link_lengths.mean())


sb.GAITS["cpg"] = Cpg
sb.ROBOTS["short"] = sb.Robot.with_joints(4)
sb.FLUIDS["honey"] = sb.Fluid(kinematic_viscosity=7e-3, density=1420.0)
sb.METRICS["mean_curvature"] = mean_curvature
sb.SAMPLERS["halton"] = lambda seed, batch: optuna.samplers.QMCSampler(qmc_type="halton", scramble=True, seed=seed)
