"""How much perturbed swims keep of the unperturbed ones, and areas under the curves of sweeps."""

import numpy as np
import pandas as pd

from snakebench.names import CURRENCIES

SWIM = ["method", "tuned_to", "seed", "fluid"]
NOMINAL = "none"  # a sweep's perturbation where there is none
DEAD_JOINT = "dead_joint"
POWERS = tuple(CURRENCIES.values())
KEPT = ("speed", "power", "positive_power", "course")


def kept(swims: pd.DataFrame, sweeps: pd.DataFrame) -> pd.DataFrame:
    """Swims with their speed and powers as shares of the unperturbed swim's, and their course [rad].

    A run that is not valid has speed 0; its powers and course are not known. Without a valid unperturbed swim nothing
    is known.
    """
    nominal = sweeps[(sweeps["perturbation"] == NOMINAL) & (sweeps["status"] == "ok")].set_index(SWIM)
    joined = swims.join(nominal[["speed", *POWERS]].add_suffix("_nominal"), on=SWIM)
    valid = joined["status"] == "ok"
    return joined.assign(
        speed=joined["speed"].where(valid, 0.0) / joined["speed_nominal"],
        course=course(joined),
        **{power: joined[power].where(valid) / joined[f"{power}_nominal"] for power in POWERS},
    )


def course(swims: pd.DataFrame) -> pd.Series:
    """The angle between the mean velocity of the last cycles and the initial heading [rad]; NaN if it is not valid."""
    heading = (swims["speed"] / swims["path_speed"]).clip(-1, 1)
    return pd.Series(np.arccos(heading.where(swims["status"] == "ok").astype(float)), swims.index)


def areas(sweeps: pd.DataFrame) -> pd.DataFrame:
    """Of each sweep the area under what is kept, over the width of its range: the mean by the trapezoidal rule.

    Of dead joints, which are no range, the mean over the joints.
    """
    swept = kept(sweeps[sweeps["perturbation"] != NOMINAL], sweeps).dropna(subset="speed")
    rows = []
    for labels, part in swept.groupby([*SWIM, "perturbation"], sort=False):
        joints = part[(part["perturbation"] == DEAD_JOINT) & (part["value"] > 0)]
        means = joints[list(KEPT)].mean(skipna=False) if len(joints) else _area(part.set_index("value").sort_index())
        rows.append(dict(zip([*SWIM, "perturbation"], labels, strict=True)) | means.to_dict())
    return pd.DataFrame(rows, columns=[*SWIM, "perturbation", *KEPT])


def _area(part: pd.DataFrame) -> pd.Series:
    width = part.index[-1] - part.index[0]
    return pd.Series({name: np.trapezoid(part[name], part.index) / width for name in KEPT})
