"""Comparisons at equal mean power: what adaptation adds to the best single gait, which swims the same in all fluids."""

from typing import Any

import numpy as np
import pandas as pd

from snakebench.collocation.ideal import at_power, envelope
from snakebench.names import ADAPTIVE, CURRENCIES, FINE
from snakebench.value import FloatArray

CONTENDER = ["method", "tuned_to", "seed", "gait"]  # what identifies a swimmer; only one of many gaits has a number


def single_gaits(swims: pd.DataFrame) -> pd.DataFrame:
    """The valid swims of single gaits: fixed gaits that swim through all fluids of a course."""
    return swims[(swims["tuned_to"] != ADAPTIVE) & (swims["status"] == "ok")]


def single_curve(singles: pd.DataFrame, column: str) -> FloatArray:
    """Mean power [W] and distance [m] of the best single gaits on a course, shape (n, 2), concave and linear between.

    This favours the single gaits: none of those between two of them is better, unless the front is bent inwards.
    """
    return envelope(singles[column].to_numpy(float), singles["distance"].to_numpy(float))


def compared(tables: dict[str, pd.DataFrame]) -> pd.DataFrame:
    """The swims of the courses at the finer step, each beside what it is judged by.

    `recovery` is the longest of the course [s], infinite if there is none after some change, or if no steady speed is
    known that it could be a return to; `loss` is the sum [m].
    Per currency, `single_CURRENCY` is the distance of the best single gait at the swimmer's mean power [m], and
    `single_METHOD_CURRENCY` that of the best of a method; `at_CURRENCY` is the power at which they are compared, that
    of the fastest single gait where the swimmer needs more [W]; `gain_CURRENCY` is the gain over the best of all, and
    `of_limit_CURRENCY` the share of the distance of the limit's ideal switching.
    """
    courses = tables["courses"]
    fine = courses[courses["variant"] == FINE]
    by_swim = tables["recoveries"].groupby(["course", *CONTENDER], dropna=False)
    after = by_swim.agg(
        changes=("seconds", "size"),
        recovery=("seconds", lambda seconds: seconds.fillna(np.inf).max()),
        loss=("loss", lambda x: x.sum(skipna=False)),
    )
    fine = fine.merge(after.astype(float).reset_index(), "left", ["course", *CONTENDER])
    valid = fine["status"] == "ok"  # others never recover, and cover no distance that counts
    missed = fine["changes"].fillna(0) < fine.groupby("course")["changes"].transform("max")
    fine = fine.assign(
        recovery=fine["recovery"].where(valid & ~missed, np.inf),
        loss=fine["loss"].where(~missed),
        distance=fine["distance"].where(valid),
    ).drop(columns="changes")
    parts = [_beside_singles(part) for _, part in fine.groupby("course", sort=False)]
    return pd.concat(parts) if parts else fine


def _beside_singles(swims: pd.DataFrame) -> pd.DataFrame:
    """The swims of a course beside the best single gaits and the limit at equal mean power."""
    singles, columns = single_gaits(swims), dict[str, Any]()
    for currency, column in CURRENCIES.items():
        power = swims[column].to_numpy(float)
        curve = single_curve(singles, column)
        best = at_power(curve, power)
        for method, part in singles.groupby("method", sort=False):
            columns[f"single_{method}_{currency}"] = at_power(single_curve(part, column), power)
        columns |= {
            f"single_{currency}": best,
            f"at_{currency}": np.minimum(power, curve[-1, 0]) if len(curve) else np.nan,
            f"gain_{currency}": swims["distance"] / best - 1,
            f"of_limit_{currency}": swims["distance"] / swims[f"ideal_{currency}"],
        }
    return swims.assign(**columns)


def nearest_below(singles: pd.DataFrame, power: float) -> pd.DataFrame:
    """Of each method the single gait whose mean power on a course is nearest below a power [W], or its least."""
    ordered = singles.sort_values("power", kind="stable")
    below = ordered[ordered["power"] <= power].drop_duplicates("method", keep="last")
    others = ordered[~ordered["method"].isin(below["method"])].drop_duplicates("method")
    return pd.concat([below, others]).sort_index()


def controls(swims: pd.DataFrame, policy: str) -> pd.DataFrame:
    """The single gait of each method that is nearest below the mean power of a policy, on each course."""
    found = [swims[:0]]
    for _, part in swims.groupby("course", sort=False):
        power = part.loc[part["method"] == policy, "power"].mean()
        found.append(nearest_below(single_gaits(part), power))
    return pd.concat(found)
