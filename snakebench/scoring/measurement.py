"""What is measured of a swim that is scored; swims are remembered by the code of this module."""

from typing import Any

import numpy as np

from snakebench import metrics
from snakebench.evaluation import measure
from snakebench.scenario import Scenario
from snakebench.trajectory import Trajectory

_SPRINT = 4.0  # most P+ before what is measured, as a multiple of that in it


def scored_swim(swim: Trajectory, scenario: Scenario, start: float) -> dict[str, Any]:
    """What is measured of a swim from `start` [s] on, for `Evaluator.measured`; validity is that of an evaluation.

    Means over so long a time leave little to gain by swimming otherwise at its ends. A swim is invalid if it took much
    more power before: it would glide on what it does not pay for.
    """
    status = measure(swim, scenario.control_rate).status
    if status == "diverged":
        return {"status": status}
    first, seconds = round(start * swim.rate), scenario.duration - start
    (dx, dy), positive = ((total[-1] - total[first]) / seconds for total in (swim.center[:, :2], swim.positive_work))
    power = metrics.power(swim, metrics.Window(start, float(swim.time[-1]), steady=False))
    course = float(np.degrees(np.arctan2(dy, dx)))
    glides = swim.positive_work[first] > _SPRINT * positive * start
    status = status if power > 0 and not glides else "invalid"
    means = {"speed": float(dx), "power": power, "positive_power": float(positive), "course": course}
    places = [] if start else np.round(swim.center[:: round(swim.rate), 0], 3).tolist()
    return {"status": status, **means, "places": places}
