"""What is measured of a swim that is scored; swims are remembered by the code of this module."""

from typing import Any

import numpy as np

from snakebench import metrics
from snakebench.evaluation import measure
from snakebench.scenario import Scenario
from snakebench.trajectory import Trajectory


def scored_swim(swim: Trajectory, scenario: Scenario, start: float) -> dict[str, Any]:
    """What is measured of a swim from `start` [s] on, for `Evaluator.measured`; validity is that of an evaluation.

    Means over so long a time leave nothing to gain by swimming otherwise before it, or at its ends.
    """
    status = measure(swim, scenario.control_rate).status
    if status == "diverged":
        return {"status": status}
    first, seconds = round(start * swim.rate), scenario.duration - start
    (dx, dy), positive = ((total[-1] - total[first]) / seconds for total in (swim.center[:, :2], swim.positive_work))
    power = metrics.power(swim, metrics.Window(start, float(swim.time[-1]), steady=False))
    course = float(np.degrees(np.arctan2(dy, dx)))
    status = status if power > 0 else "invalid"
    means = {"speed": float(dx), "power": power, "positive_power": float(positive), "course": course}
    places = [] if start else np.round(swim.center[:: round(swim.rate), 0], 3).tolist()
    return {"status": status, **means, "places": places}
