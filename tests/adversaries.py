"""Commands that no gait would ask for, made to break an engine or a bound."""

from __future__ import annotations

import numpy as np

from snakebench.controllers import HeldTargets


def targets(kind: str, seconds: float, joints: int = 7) -> HeldTargets:
    """Adversarial target angles at 30 Hz."""
    rng, n = np.random.default_rng(1), round(30 * seconds)
    wave = {
        "random": rng.uniform(-1, 1, (n, joints)),
        "bang-bang": rng.choice([-1.0, 1.0], (n, joints)),
        "alternating": np.where(np.add.outer(np.arange(n), np.arange(joints)) % 2, 1.0, -1.0),
    }[kind]
    return HeldTargets(rate=30, targets=tuple(map(tuple, wave.tolist())))
