"""The assumption ledger: what the paper leaves open and what snakebench chose, printed in every report."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from snakebench.fluid import named_fluid
from snakebench.physics.record import JOINT_RATE_MAX, V_MAX
from snakebench.robot import Robot
from snakebench.scenario import Scenario


class Assumption(NamedTuple):
    """One line of the ledger."""

    about: str
    choice: str
    reason: str


def ledger(config: Mapping[str, Any]) -> list[Assumption]:
    """The assumptions of a study, by its configuration as in its manifest."""
    return _LEDGERS.get(config["method"], assumptions_of)(config)


def assumptions_of(config: Mapping[str, Any]) -> list[Assumption]:
    """The ledger for the results of a search with this configuration, as in its manifest."""
    gait = config.get("gait")  # the only one that a study of fronts has
    found = config.get("found", {})  # what a comparison is of: an empty name leaves a kind out
    return [
        *_of_robot(Robot(**config["robot"])),
        *_OF_FLUIDS,
        *([_TORQUE_WAVE] if gait in (None, "sinusoidal-torque") and found.get("sinusoids", True) else []),
        *([_ACTIONS] if gait is None and found.get("policies", True) else []),
        *_of_swims(config["physics_rate"], config["verify_rate"], config["duration"]),
    ]


def learned_viscosities(config: Mapping[str, Any]) -> str:
    """The range of kinematic viscosities that policies learn in, as in the manifest of their study."""
    ends = config["training"].get("randomisation", {}).get("viscosities", (1e-7, 1e-2))
    return " to ".join(np.format_float_scientific(end, trim="-", exp_digits=1) for end in ends) + " m²/s"


def assumptions_of_learning(config: Mapping[str, Any]) -> list[Assumption]:
    """The ledger for a study that learns policies, as in its manifest."""
    return [
        *assumptions_of({**config, "physics_rate": config["verify_rate"] // 2}),
        Assumption(
            "Viscosity of an episode",
            f"log-uniform from {learned_viscosities(config)}, unless a policy's settings say otherwise",
            "The paper has 1e-7 to 1e-2 m²/s and says that it is randomized.",
        ),
        Assumption(
            "Scale of observations",
            "joint rate × 0.1, torque × 0.2, head turning × 0.2, 0.4 (log10 ν + 4.5), 0.75 (log10 λ + 1), others in SI"
            " units",
            "The paper does not say; with ν itself a network sees next to nothing below 1e-4 m²/s.",
        ),
        Assumption(
            "Head velocity",
            "in the world frame",
            "In the body's frame a teacher cannot know its course: a prototype turned and swam backwards.",
        ),
        Assumption(
            "Order of the network",
            "MLP, then LSTM",
            "As in the paper's text; the library it names does LSTM, then MLP.",
        ),
        Assumption(
            "Weight w_1",
            "10 throughout unless a study file says otherwise",
            "The paper's curriculum on it is not needed here; every return reported has w_1 = 10.",
        ),
        Assumption(
            "PPO beyond the paper's table",
            "96 steps of 64 environments per update unless a study file says otherwise, learning rate adapted to a KL"
            " divergence of 0.01, no entropy bonus, first standard deviation 0.5 rad, value loss × 1, gradients up to"
            " norm 1",
            "Not stated. The library that the paper names has a habit of 24 steps, through which gradients reach too"
            " little of the past for a policy that must remember; the rest is near its habits.",
        ),
        Assumption(
            "Distillation",
            "the teacher drives at first and hands over; several steps of Adam per rollout of 200 steps",
            "The paper's literal setting is run as well, where the study has it. The paper's table says 400 iterations,"
            " its text 600.",
        ),
    ]


def assumptions_of_preference(config: Mapping[str, Any]) -> list[Assumption]:
    """The ledger for a study of policies with a dial, as in its manifest."""
    return [
        *assumptions_of_learning(config),
        Assumption(
            "Reward under a preference",
            "the paper's, with 16 √v in place of 10 v and the price of power λ in place of w_5",
            "The paper has one point, no front. With speed itself pilots stood still in the oils where power was dear:"
            " the small terms take all that slow gaits earn.",
        ),
        Assumption(
            "Price of power",
            "log-uniform, its upper end grown over the first part of a training, after the first episodes",
            "Dear power from the start taught a pilot, with speed itself in the reward, to stand still.",
        ),
    ]


def assumptions_of_comparison(config: Mapping[str, Any]) -> list[Assumption]:
    """The ledger for a study that compares what others found, as in its manifest."""
    coarser = config.get("coarser") or min(config["rates"])
    return [
        *assumptions_of({**config, "physics_rate": coarser}),
        Assumption(
            "Best gaits",
            f"of a front the fastest that takes less than {config['reference'][1]:g} W; of sea snakes and of free"
            " waveforms that of the highest return; for each fluid, and for all by the mean over them",
            "What the studies that found them asked for.",
        ),
        *_OF_METHOD[config["method"]],
    ]


def _of_robot(robot: Robot) -> list[Assumption]:
    neutral = robot.neutral_diameter(named_fluid("water").density)
    limits = {"torque": (robot.torque_limit, "N m"), "joint angle": (robot.angle_limit, "rad")}
    limits |= {"no-load speed": (robot.speed_limit, "rad/s")}
    limited = [f"{what} {limit:g} {unit}" for what, (limit, unit) in limits.items() if limit is not None]
    papers = robot.but(diameter=Robot().diameter, torque_limit=None, speed_limit=None, angle_limit=None) == Robot()
    known = (
        "The paper gives none; a press description of the robot says 0.1 m. This robot floats neutrally in water at"
        f" {neutral:.4f} m; the sea-snake study swims both."
    )
    return [
        Assumption(
            "Diameter",
            f"{robot.diameter:g} m",
            known if papers else f"Not the paper's robot. This one floats neutrally in water at {neutral:.4f} m.",
        ),
        Assumption("Cover mass", "in proportion to link length", "The paper gives only its total."),
        Assumption("Link inertia", "solid cylinder, centre of mass at mid-link", "The paper gives none."),
        Assumption(
            "Limits",
            ", ".join(limited) or "none on torque or joint angle",
            "The paper imposes none on its torque method.",
        ),
    ]


_OF_FLUIDS = (
    Assumption("Density at 40 and 100 °C", "as at 15 °C", "Known at 15 °C only."),
    Assumption(
        "Density of other fluids",
        "linear in log10 of the viscosity through the three fluids at 15 °C, constant outside",
        "Only three densities are known.",
    ),
)
_TORQUE_WAVE = Assumption(
    "Sign of the torque wave",
    "u_i = A sin(2πft − (i − 1)ψ)",
    "With joint 1 at the head only the minus sign swims head first for the phases that the paper reports.",
)
_ACTIONS = Assumption("Actions of policies", "clipped to [−1, 1] rad", "The action space of the paper.")


def _of_swims(physics_rate: int, verify_rate: int, duration: float) -> list[Assumption]:
    """What is measured, with the rates [Hz] and the duration [s] of the runs."""
    control_rate = Scenario.model_fields["control_rate"].default
    return [
        Assumption(
            "Rates",
            f"physics {physics_rate} Hz, verified at {verify_rate} Hz; control {control_rate} Hz",
            "The difference between the two rates is shown beside the figures; the error that remains is at most about"
            " as large.",
        ),
        Assumption(
            "Return", f"J = Σ r Δt over {duration:g} s from rest", "Without Δt the paper's returns would mean 0.01 m/s."
        ),
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


_OF_METHOD = {
    "cross": [
        Assumption(
            "Replayed waveform",
            "command torque of the last two gait periods, linear between samples at the physics rate",
            "The paper records two cycles; how it samples and repeats them is not said.",
        ),
    ],
    "adaptation": [
        Assumption(
            "Recovery",
            "from a change to the first gait period from which on the speed, as a mean over a period, stays within 5 %"
            " of its own steady value for 5 s; a period counts from its beginning",
            "Ours. A mean over whole periods does not beat with the gait.",
        ),
        Assumption(
            "Ideal without delay",
            "at every moment the steady speed and power at the present viscosity, linear in log10 ν between those"
            " measured; ideal switching: of the fastest of the gaits of a kind that are tuned to a fluid",
            "Ours. It is what is left when a change costs nothing.",
        ),
    ],
    "sensitivity": [
        Assumption(
            "Other robots",
            "of the same length and mass; head and tail stay, the middle is cut into equal links",
            "The paper names the number of joints as future work.",
        ),
        Assumption(
            "Fronts of the robots",
            "from a coarser grid than the Pareto study's, the default robot's as well",
            "Fronts compare that are searched for alike.",
        ),
    ],
}

_LEDGERS = {
    "teacher_student": assumptions_of_learning,
    "learned_front": assumptions_of_preference,
    **dict.fromkeys(_OF_METHOD, assumptions_of_comparison),
}
