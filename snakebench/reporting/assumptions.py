"""The assumption ledger: what the paper leaves open and what snakebench chose, printed in every report."""

from __future__ import annotations

from typing import NamedTuple

from snakebench.evaluation import Scenario
from snakebench.fluid import named_fluid
from snakebench.robot import Robot
from snakebench.trajectory import JOINT_RATE_MAX, V_MAX


class Assumption(NamedTuple):
    """One line of the ledger."""

    about: str
    choice: str
    reason: str


def assumptions(robot: Robot) -> list[Assumption]:
    """The ledger for results of a robot."""
    neutral = robot.neutral_diameter(named_fluid("water").density)
    scenario = Scenario.model_fields
    return [
        Assumption(
            "Diameter",
            f"{robot.diameter:g} m",
            f"From a press description of the robot. It floats neutrally in water at {neutral:.4f} m; both are shown.",
        ),
        Assumption("Cover mass", "in proportion to link length", "The paper gives only its total."),
        Assumption("Link inertia", "solid cylinder, centre of mass at mid-link", "The paper gives none."),
        Assumption("Density at 40 and 100 °C", "as at 15 °C", "Known at 15 °C only."),
        Assumption(
            "Density of other fluids",
            "linear in log10 of the viscosity through the three fluids at 15 °C, constant outside",
            "Only three densities are known.",
        ),
        Assumption(
            "Sign of the torque wave",
            "u_i = A sin(2πft − (i − 1)ψ)",
            "With joint 1 at the head only the minus sign swims head first for the phases that the paper reports.",
        ),
        Assumption(
            "Rates",
            f"physics {scenario['physics_rate'].default} Hz, control {scenario['control_rate'].default} Hz",
            "PyBullet is first order in its step: optima are computed at twice the rate too, the difference shown.",
        ),
        Assumption("Limits", "none on torque or joint angle", "The paper imposes none on its torque method."),
        Assumption("Actions of policies", "clipped to [−1, 1] rad", "The action space of the paper."),
        Assumption("Return", "J = Σ r Δt over 30 s from rest", "Without Δt the paper's returns would mean 0.01 m/s."),
        Assumption(
            "Reward's velocity and work",
            "means over a control step, work counted exactly",
            "Samples at the control rate can be exploited by a learner.",
        ),
        Assumption(
            "Divergence",
            f"centre of mass above {V_MAX:g} m/s or a joint above {JOINT_RATE_MAX:g} rad/s",
            "The paper names a threshold without its value.",
        ),
        Assumption(
            "Steady swimming",
            "three clear, even velocity peaks; speed and power within 2 % of the window before",
            "Otherwise whole gait periods at the end of the run, marked as not steady.",
        ),
    ]
