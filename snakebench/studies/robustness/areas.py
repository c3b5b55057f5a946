"""How much perturbed swims keep of the unperturbed ones, and areas under the curves of sweeps."""

import numpy as np
import pandas as pd

SWIM = ["method", "tuned_to", "seed", "fluid"]
NOMINAL = "none"  # a sweep's perturbation where there is none
KEPT = ("speed", "power", "course")


def kept(swims: pd.DataFrame, sweeps: pd.DataFrame) -> pd.DataFrame:
    """Swims with their speed and power as shares of the unperturbed swim's, and their course [rad].

    The course is the angle between the mean velocity and the initial heading. A run that is not valid has speed 0; its
    power and course are not known. Without a valid unperturbed swim nothing is known.
    """
    nominal = sweeps[(sweeps["perturbation"] == NOMINAL) & (sweeps["status"] == "ok")].set_index(SWIM)
    joined = swims.join(nominal[["speed", "power"]].add_suffix("_nominal"), on=SWIM)
    valid = joined["status"] == "ok"
    heading = (joined["speed"] / joined["path_speed"]).clip(-1, 1)
    return joined.assign(
        speed=joined["speed"].where(valid, 0.0) / joined["speed_nominal"],
        power=joined["power"].where(valid) / joined["power_nominal"],
        course=np.arccos(heading.where(valid).astype(float)),
    )


def areas(sweeps: pd.DataFrame) -> pd.DataFrame:
    """Of each sweep the area under what is kept, over the width of its range: the mean by the trapezoidal rule."""
    swept = kept(sweeps[sweeps["perturbation"] != NOMINAL], sweeps).dropna(subset="speed")
    rows = []
    for labels, part in swept.groupby([*SWIM, "perturbation"], sort=False):
        part = part.sort_values("value")
        width = part["value"].iloc[-1] - part["value"].iloc[0]
        means = {name: np.trapezoid(part[name], part["value"]) / width for name in KEPT}
        rows.append(dict(zip([*SWIM, "perturbation"], labels, strict=True)) | means)
    return pd.DataFrame(rows, columns=[*SWIM, "perturbation", *KEPT])
