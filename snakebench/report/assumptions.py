"""The assumption ledger: what the paper leaves open and what snakebench chose, printed in every report."""

import tomllib
from collections.abc import Collection, Mapping
from importlib.resources import files
from typing import Any

import numpy as np

from snakebench.fluid import named_fluid
from snakebench.physics.record import JOINT_RATE_MAX, V_MAX
from snakebench.robot import Robot
from snakebench.scenario import Scenario

_TEXTS: dict[str, dict[str, Any]] = tomllib.loads((files(__package__) / "assumptions.toml").read_text(encoding="utf-8"))
_ONE_RATE = ("limit", "robustness")  # methods of studies whose swims have no coarser step beside


def ledger(config: Mapping[str, Any]) -> dict[str, dict[str, str]]:
    """The title, choice and reason of each assumption of a study, by its configuration as in its manifest."""
    gait = config.get("gait")  # the only one that a study of fronts has
    studies = config.get("contenders", {})  # of a comparison: an empty name leaves a kind out
    robot, values, swims = Robot(**config["robot"]), _values(config), "verify_rate" in config
    of_paper = robot.but(diameter=Robot().diameter, torque_limit=None, speed_limit=None, angle_limit=None) == Robot()
    rewarded = any("demonstrations" not in policy for policy in _trained(config))
    subjects = {
        config["method"]: True,
        "reward": rewarded,
        "reward under a preference": rewarded and config["method"] == "learned_front",
        "paper's robot" if of_paper else "other robot": True,
        "networks": any("estimator" not in policy for policy in _trained(config)),
        "swims": swims,
        "two rates": swims and config["method"] not in _ONE_RATE,
        "one rate": swims and config["method"] in _ONE_RATE,
        "sinusoids": gait in (None, "sinusoidal-torque") and studies.get("sinusoids", True),
        "policies": swims and gait is None and studies.get("policies", True),
    }
    return {
        id: {name: text[name].format(**values) for name in ("title", "choice", "reason")}
        for id, text in _TEXTS.items()
        if "of" not in text or any(subjects.get(subject) for subject in text["of"])
    }


def learned_viscosities(config: Mapping[str, Any]) -> str:
    """The range of kinematic viscosities that policies learn in, as in the manifest of their study."""
    ends = config.get("training", {}).get("randomisation", {}).get("viscosities", (1e-7, 1e-2))
    return " to ".join(np.format_float_scientific(end, trim="-", exp_digits=1) for end in ends) + " m²/s"


def _trained(config: Mapping[str, Any]) -> Collection[Mapping[str, Any]]:
    """The settings of the policies that a study trains."""
    if config["method"] not in ("teacher_student", "learned_front"):
        return ()
    return [own for name, own in config["policies"].items() if name in (config.get("only") or config["policies"])]


def _values(config: Mapping[str, Any]) -> dict[str, Any]:
    robot = Robot(**config["robot"])
    limits = {"torque": (robot.torque_limit, "N m"), "joint angle": (robot.angle_limit, "rad")}
    limits |= {"no-load speed": (robot.speed_limit, "rad/s")}
    limited = [f"{name} {limit:g} {unit}" for name, (limit, unit) in limits.items() if limit is not None]
    usual = Scenario.model_fields["control_rate"].default
    rates = {policy.get("control_rate", usual) for policy in _trained(config)} or {usual}
    verify_rate = config.get("verify_rate", 0)
    coarser = min(config.get("rates", [verify_rate // 2]))
    return {
        "diameter": robot.diameter,
        "neutral": robot.neutral_diameter(named_fluid("water").density),
        "limits": ", ".join(limited) or "none on torque or joint angle",
        "physics_rate": config.get("physics_rate", coarser),
        "verify_rate": verify_rate,
        "control_rate": ", ".join(map(str, sorted(rates))),
        "duration": config["duration"],
        "v_max": V_MAX,
        "joint_rate_max": JOINT_RATE_MAX,
        "viscosities": learned_viscosities(config),
        "most_power": config.get("reference", (0.0, 0.0))[1],
    }
