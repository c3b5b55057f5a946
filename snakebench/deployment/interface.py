"""What a robot must feed to an exported policy and what it gets: names, units, signs, scales and bounds."""

import json
from typing import Any

import numpy as np

from snakebench.errors import InvalidValue
from snakebench.observation import GROUPS, PREFERENCE, columns
from snakebench.policy import Policy

# Unit and meaning of each quantity of `snakebench.observation`.
MEANINGS = {
    "joint angle": ("rad", "q, heading of the link behind the joint minus that of the link in front of it"),
    "joint rate": ("rad/s", "dq/dt"),
    "joint torque": ("N m", "u, applied, from angle and rate now and the last action; 0 at the first step"),
    "head turning": ("rad/s", "angular velocity of the head, x forward, y left, z up; x and y are always 0"),
    "last action": ("rad", "the action of the step before, as it was returned; 0 at the first step"),
    "viscosity": ("log10 of m^2/s", "kinematic viscosity at the head"),
    "head velocity": ("m/s", "of the head's centre in the world frame; z is always 0"),
    "price of power": ("log10 of 1/W", "the preference: the higher, the slower and thriftier"),
}
SIGNS = (
    "Joint 1 is next to the head. Seen from above, headings grow counterclockwise, turning left:"
    " a positive joint angle swings all that is behind the joint to the robot's right."
)


def at_preference(policy: Policy, price: float) -> Policy:
    """The policy at a fixed price of power [1/W], which it then no longer observes.

    The price's part in the first layer becomes part of that layer's bias.

    Raises:
        InvalidValue: when the policy is not preference-conditioned, or was not trained at that price.
    """
    card, (quantity,) = policy.at(price).card, PREFERENCE
    others = tuple(name for name in card.feels if name not in ("preference", quantity.name))
    if not others:
        raise InvalidValue(f"preference = {price:g}: the policy observes nothing else")
    fixed = np.flatnonzero(~np.isin(columns(card.feels, card.joints), columns(others, card.joints)))
    first = next(iter(card.shapes())).removesuffix(".weight")
    weight, bias = policy.arrays[f"{first}.weight"], policy.arrays[f"{first}.bias"]
    share = weight[:, fixed].sum(1) * np.float32(quantity.scale * np.log10(price) + quantity.offset)
    arrays = {f"{first}.weight": np.delete(weight, fixed, axis=1), f"{first}.bias": bias + share}
    return Policy(card.but(feels=others, prices=None), policy.arrays | arrays)


def fields(policy: Policy) -> list[dict[str, Any]]:
    """Every number of an observation, in its order: it is `scale` times the value in `unit`, plus `offset`."""
    joints, found = policy.card.joints, []
    for quantity in (quantity for group in GROUPS.values() for quantity in group):
        unit, meaning = MEANINGS[quantity.name]
        parts = range(1, joints + 1) if quantity.width is None else "xyz"[: quantity.width]
        for part in parts:
            name = quantity.name if quantity.width == 1 else f"{quantity.name} {part}"
            scaling = {"scale": quantity.scale, "offset": quantity.offset}
            found.append({"name": name, "unit": unit, **scaling, "meaning": meaning})
    return [found[column] for column in columns(policy.card.feels, joints)]


def description(policy: Policy, preference: float | None) -> str:
    """All of this and the card as JSON, with the fixed preference [1/W] if there is one."""
    names = [f"target angle {joint + 1}" for joint in range(policy.card.joints)]
    content: dict[str, Any] = {
        "control_rate": policy.card.control_rate,
        "signs": SIGNS,
        "observation": fields(policy),
        "action": [{"name": name, "unit": "rad", "low": -1.0, "high": 1.0} for name in names],
        "preferences": policy.card.prices,
        "fixed_preference": preference,
        "card": policy.card.model_dump(mode="json"),
    }
    return json.dumps(content)
