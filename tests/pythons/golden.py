"""Writes what two gaits reach in each engine, to the last bit; Python 3.11 wrote golden.json:

    python tests/pythons/golden.py > tests/pythons/golden.json

Write it again after a change of the physics, with the versions of constraints.txt. On another kind of processor the
last bits may be others, as libraries choose their instructions by it: write it there by Python 3.11 first.
"""

from __future__ import annotations

import hashlib
import json

import snakebench as sb

GAITS = (
    sb.SeaSnake(amplitude=0.9, frequency=0.6, phase=0.7),
    sb.SinusoidalTorque(amplitude=3.5, frequency=0.7, phase=0.84),
)


def swims() -> dict[str, list[str]]:
    """Of each swim speed [m/s] and power [W], in hex, and a digest of where its links were."""
    found = {}
    for engine in ("planar", "pybullet"):
        for gait in GAITS:
            swim = sb.simulate(gait, fluid="oil1", engine=engine, duration=4.0)
            reached = sb.measure(swim)
            where = hashlib.sha256(swim.head.tobytes() + swim.joint_angle.tobytes()).hexdigest()
            found[f"{gait.kind} in {engine}"] = [reached.speed.hex(), reached.power.hex(), where]
    return found


if __name__ == "__main__":
    print(json.dumps(swims(), indent=2))
