"""What the paper says of its own results, to be set beside ours; its simulator and the robot's diameter differ."""

from __future__ import annotations

from typing import NamedTuple

from snakebench.metrics import GRAVITY


class Claim(NamedTuple):
    """What the paper's learned policy does in a fluid (paper, table of the policies)."""

    speed: float  # [m/s]
    cost_of_transport: float

    def power(self, mass: float) -> float:
        """What these two mean for a robot of that mass [W]."""
        return self.speed * self.cost_of_transport * mass * GRAVITY


POLICY = {"water": Claim(0.51, 0.33), "oil1": Claim(0.23, 0.60), "oil2": Claim(0.14, 0.85)}
RETURNS = {"teacher": 170, "symmetric": 50}  # about, at the end of training (paper, figure of the learning curves)
POLICY_FREQUENCIES = "0.47 to 0.23 Hz"  # from water to oil2
