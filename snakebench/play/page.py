"""The page in which the robot swims live: its data, from published results. Physics and controls are beside it."""

import base64
import zlib
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

from snakebench.deployment.interface import fields
from snakebench.engines import PHYSICS_RATES
from snakebench.errors import InvalidValue
from snakebench.fluid import FLUIDS, PAPERS
from snakebench.observation import columns
from snakebench.physics import hydrodynamics
from snakebench.physics.chain import CHAIN, describe_chain
from snakebench.play.gaits import families, limit_speeds, of_usual_robot
from snakebench.policy import Policy
from snakebench.publication import snapshot
from snakebench.reward import PUBLISHED_PRICE
from snakebench.robot import Robot
from snakebench.site import rendered
from snakebench.studies.config import study_path, study_settings

CONTROL_RATE = 30  # of policies [Hz]
PRICES = np.geomspace(0.01, 3.0, 26)  # of power, as the preference-conditioned student was trained [1/W]
_POLICIES = (  # label, study and name; of its seeds the first counts
    ("preference-conditioned student", "learned_front", "student"),
    ("student", "teacher_student", "student"),
    ("robust student", "robust", "robust_student"),
)
_SCRIPTS = ("hydrodynamics.js", "chain.js", "swimmer.js", "policy.js", "controllers.js", "lane.js", "play.js")
_FORCE = ("C_A", "C_F", "C_MU", "C_NU", "P_1", "P_2", "P_3", "C_1", "C_2", "EULER_GAMMA", "LAMB_REYNOLDS")
_LINKS = ("length", "mass", "inertia", "front", "rear", "lever", "drag_multiple")
_JOINTS = ("diameter", "proportional_gain", "derivative_gain", "stiffness", "damping")


def play_page(results: Path, say: Callable[[str], object] = lambda _: None) -> str:
    """The page, of the gaits and policies that are published in a directory of results.

    `say` is called with a line for each study whose results cannot be used.

    Raises:
        InvalidValue: when there is neither a gait nor a policy.
    """
    with snapshot(results) as taken:
        for problem in taken.problems.values():
            say(f"left out: {problem}")
        gaits, policies = list(families(taken.copy, PRICES)), list(_policies(taken.copy))
        limits = _limits(taken.copy)
    labels = [one["label"] for one in policies + gaits]
    if not labels:
        raise InvalidValue(f"{results} holds no gaits and no policies: give --results of a clone of the repository")
    page = {"policies": policies, "families": gaits, "limits": limits, "prices": PRICES.tolist()} | _physics()
    preferred = {"A": ("student", labels[0]), "B": ("sinusoid", labels[-1])}
    chosen = {lane: name if name in labels else other for lane, (name, other) in preferred.items()}
    content = {
        "play": page,
        "labels": labels,
        "chosen": chosen,
        "scripts": _SCRIPTS,
        "published_price": PUBLISHED_PRICE,
    }
    return rendered("play/page.html", content)


def _physics() -> dict[str, Any]:
    """The robot, the fluids and the constants of the force law, and how often it steps and acts."""
    chain, robot, rate = np.zeros(1, CHAIN)[0], Robot(), PHYSICS_RATES["planar"]
    describe_chain(chain, robot, "angle")
    media = [{"name": name, "viscosity": FLUIDS[name].kinematic_viscosity} for name in PAPERS]
    ranges = study_settings(study_path("robustness"), "full")["ranges"]
    return {
        "robot": {name: chain[name][: robot.n_links].tolist() for name in _LINKS}
        | {name: float(chain[name]) for name in _JOINTS},
        "force": {name: getattr(hydrodynamics, name) for name in _FORCE},
        "media": media,
        "densities": [[float(np.log10(FLUIDS[name].kinematic_viscosity)), FLUIDS[name].density] for name in PAPERS],
        "noise": {name: ranges[f"{name}_noise"][1] for name in ("angle", "rate", "gyro")},
        "rate": rate,
        "every": rate // CONTROL_RATE,
    }


def _limits(results: Path) -> dict[str, Any]:
    """The limit over the logarithms of viscosity and power, the named fluids among them; null where it is unknown."""
    named = [FLUIDS[name].kinematic_viscosity for name in PAPERS]
    viscosities, powers = np.sort([*np.geomspace(1e-7, 1e-2, 51), *named]), np.geomspace(0.3, 25.0, 65)
    speeds = limit_speeds(results, viscosities, powers).round(5).tolist()
    known: list[list[float | None]] = [[None if np.isnan(speed) else speed for speed in row] for row in speeds]
    return {"viscosities": np.log10(viscosities).tolist(), "powers": np.log10(powers).tolist(), "speeds": known}


def _policies(results: Path) -> Iterator[dict[str, Any]]:
    """The first policy of each kind, of studies of the page's robot."""
    for label, study, name in _POLICIES:
        for path in sorted((results / study / "policies").glob(f"{name}-*.safetensors"))[:1]:
            if of_usual_robot(results / study) and (policy := Policy.load(path)).card.control_rate == CONTROL_RATE:
                yield {"label": label, "about": f"Policy {path.stem} of the study {study}."} | packed(policy)


def packed(policy: Policy) -> dict[str, Any]:
    """A policy for policy.js: what it observes, its layers, and all its numbers as text.

    Numbers are rounded to 19 significant bits, so that three policies fit into a page: actions change by some 1e-6 rad.
    The first bytes of all 32-bit floats come first, then the second bytes, and so on: they compress better so.
    """
    bits = np.concatenate([array.ravel() for array in policy.arrays.values()]).astype("<f4").view("<u4")
    rounded = (bits + np.uint32(16)) & np.uint32(0xFFFFFFE0)
    planes = rounded.view(np.uint8).reshape(-1, 4).T.tobytes()
    observed = fields(policy)
    card = {
        "mlp": policy.card.mlp,
        "lstm": policy.card.lstm,
        "arrays": [[name, array.shape] for name, array in policy.arrays.items()],
        "columns": columns(policy.card.feels, policy.card.joints).tolist(),
        "scale": [field["scale"] for field in observed],
        "offset": [field["offset"] for field in observed],
    }
    return {"card": card, "numbers": base64.b64encode(zlib.compress(planes, 9)).decode()}
