"""What the paper says of its own results, to be set beside ours; its simulator and the robot's diameter differ."""

from collections.abc import Collection
from typing import NamedTuple

import pandas as pd

from snakebench.controllers import SinusoidalTorque
from snakebench.metrics import GRAVITY

NAME = "paper's policy"  # of a method in tables and figures


class Figures(NamedTuple):
    """What the paper's learned policy does in a fluid (paper, table of the policies)."""

    speed: float  # [m/s]
    cost_of_transport: float

    def power(self, mass: float) -> float:
        """What these two mean for a robot of that mass [W]."""
        return self.speed * self.cost_of_transport * mass * GRAVITY


# The torque of the policy's gait of one fluid replayed in another, by the fluid and by the gait's own (paper, table of
# the cross-environment evaluation).
CROSS = {
    "water": {"water": Figures(0.51, 0.33), "oil1": Figures(0.22, 0.39), "oil2": Figures(0.15, 0.42)},
    "oil1": {"water": Figures(0.12, 0.87), "oil1": Figures(0.23, 0.60), "oil2": Figures(0.09, 0.73)},
    "oil2": {"water": Figures(0.06, 1.62), "oil1": Figures(0.06, 1.38), "oil2": Figures(0.14, 0.85)},
}
POLICY = {fluid: gaits[fluid] for fluid, gaits in CROSS.items()}
RETURNS = {"teacher": 170, "symmetric": 50}  # about, at the end of training (paper, figure of the learning curves)
ENDS = ("water", "oil2")  # between which the paper tells trends
TREND = {  # of the policy, at these ends (paper, trends over viscosity)
    "swim_frequency": (0.47, 0.23),  # [Hz]
    "tail_amplitude": (0.154, 0.246),  # [m]
}
# The fixed gait, and its tail amplitude [m] (paper, trends over viscosity): half or full peak-to-peak, of the tip or of
# a link, is not said.
SINUSOID = SinusoidalTorque(amplitude=3.5, frequency=0.70, phase=0.84)
SINUSOID_TAIL = dict(zip(ENDS, (0.447, 0.249), strict=True))


def replays(fluids: Collection[str]) -> pd.DataFrame:
    """The replays as rows of a table: columns method, loop, gait_of, fluid, speed and cost_of_transport."""
    return pd.DataFrame(
        {"method": NAME, "loop": "open", "gait_of": gait, "fluid": fluid} | figures._asdict()
        for fluid, gaits in CROSS.items()
        for gait, figures in gaits.items()
        if {fluid, gait} <= set(fluids)
    )
