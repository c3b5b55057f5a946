"""A policy as a C header: its numbers, and the code of one control step, which is in `inference.h`."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from snakebench.deployment.interface import fields
from snakebench.policy import Policy

_CODE = Path(__file__).with_name("inference.h")


def c_header(policy: Policy, description: str) -> str:
    """The header, with a description as its first comment."""
    units = dict(zip([f"lstm.{k}" for k in range(len(policy.card.lstm))], policy.card.lstm, strict=True))
    names = [name.removesuffix(".weight") for name in policy.arrays if name.endswith(".weight")]
    layers, widest = list[str](), max(max(policy.arrays[f"{name}.weight"].shape) for name in names)
    for name in names:
        label, (rows, inputs) = name.replace(".", "_"), policy.arrays[f"{name}.weight"].shape
        layers.append(f"{{{units.get(name, 0)}, {inputs}, {rows}, snake_{label}_weight, snake_{label}_bias}}")
    arrays = [_array(name.replace(".", "_"), array.T) for name, array in policy.arrays.items()]
    observed = fields(policy)
    sizes = {
        "INPUTS": len(observed),
        "JOINTS": policy.card.joints,
        "CONTROL_RATE": policy.card.control_rate,
        "UNITS": max(sum(policy.card.lstm), 1),  # C has no empty arrays
        "WIDEST": widest,
        "LAYERS": ", ".join(layers),
        **dict(zip(("PRICE_LEAST", "PRICE_MOST"), map(_number, policy.card.prices or ()), strict=False)),
    }
    scales = (_array(part, np.array([field[part] for field in observed], np.float32)) for part in ("scale", "offset"))
    head = ["#ifndef SNAKE_POLICY_H", "#define SNAKE_POLICY_H", *(f"#define SNAKE_{k} {v}" for k, v in sizes.items())]
    return "\n".join([_comment(description), *head, *scales, *arrays, _CODE.read_text(encoding="utf-8")])


def _comment(description: str) -> str:
    """JSON as a comment in C; its texts may come from anywhere and cannot end the comment."""
    text = description.replace("*", r"\u002a").replace('{"name"', '\n  {"name"')
    return f"/* A policy for a swimming snake robot, by snakebench:\n{text}\n*/"


def _number(number: float) -> str:
    return f"{number:.8e}f"


def _array(name: str, numbers: NDArray[np.float32]) -> str:
    """An array of constants; nine digits are a 32-bit float exactly."""
    flat = list(map(_number, numbers.ravel().tolist()))
    lines = ",\n".join(", ".join(flat[k : k + 8]) for k in range(0, len(flat), 8))
    return f"static const float snake_{name}[] = {{\n{lines}}};"
