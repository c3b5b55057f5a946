"""How near other gaits and policies come to the limit at equal power, from the published results beside it."""

from collections.abc import Iterator

import numpy as np
import pandas as pd

from snakebench.collocation.front import front_speeds
from snakebench.errors import StoreError
from snakebench.names import CURRENCIES
from snakebench.report.equal_power import front_line, speeds_within
from snakebench.studies.published import Published, published
from snakebench.studies.published_fronts import points_of, points_without_fronts, same_settings
from snakebench.studies.seed_fronts import of_each_seed

_STUDIES = ("sea_snake_front", "pareto", "fourier", "learned_front", "imitation", "gain_schedule")
_POINTS = ("sea_snake", "teacher_student")
ALLOWED_POWERS = (0.3, 1.0, 3.0, 5.0, 10.0, 15.0)  # at which fronts are compared [W]


def rivals(study: Published) -> pd.DataFrame:
    """Every published point in a fluid of the limit: columns method, fluid, seed, speed, both powers and `is_front`.

    `is_front` says whether the points of a method and seed are a front.
    """
    fronts = points_of(map(of_each_seed, _beside(study, _STUDIES)))
    marks = points_without_fronts(_beside(study, _POINTS))
    table = pd.concat([fronts.assign(is_front=True), marks.assign(is_front=False)], ignore_index=True)
    table = table.rename(columns={"front": "fluid"}).drop(columns="currency").drop_duplicates()
    numbers = dict.fromkeys(("speed", *CURRENCIES.values()), float)
    return table[table["fluid"].isin(study.config["fluids"])].astype(numbers | {"is_front": bool})


def _beside(study: Published, names: tuple[str, ...]) -> Iterator[Published]:
    """The comparable results of other studies: of the same profile, else the published ones."""
    for name in names:
        found = study.beside(name)
        if found is None:
            try:
                found = published(study.directory.parent / name)
            except StoreError:
                continue
        if same_settings(study, found):
            yield found


def shares(limit: pd.DataFrame, points: pd.DataFrame) -> pd.DataFrame:
    """Each point's speed as a share of the limit at its own power, in both currencies: columns currency and share [1].

    Points outside the limit's range of power are left out.
    """
    parts = [points.iloc[:0].assign(currency="", share=np.nan)]
    for (fluid, known), front in limit.groupby(["fluid", "currency"], sort=False):
        currency = str(known)
        own = points[(points["fluid"] == fluid) & (points[CURRENCIES[currency]] > 0)]
        best = front_speeds(front, own[CURRENCIES[currency]].to_numpy(float), currency)
        parts.append(own.assign(currency=currency, share=own["speed"] / best).dropna(subset="share"))
    return pd.concat(parts, ignore_index=True).astype({"is_front": bool})


def shares_at(limit: pd.DataFrame, points: pd.DataFrame) -> pd.DataFrame:
    """The share of the limit that each method's front reaches at equal powers, by seed: columns allowed and share.

    A point that is no front counts at its own power, `allowed` is empty then.
    """
    own = shares(limit, points[~points["is_front"]]).assign(allowed=np.nan)
    rows = [own]
    for (fluid, currency), front in limit.groupby(["fluid", "currency"], sort=False):
        known = points[points["is_front"] & (points["fluid"] == fluid)]
        speeds = front_speeds(front, np.array(ALLOWED_POWERS), str(currency))
        best = {power: speed for power, speed in zip(ALLOWED_POWERS, speeds, strict=True) if np.isfinite(speed)}
        for (method, seed), part in known.groupby(["method", "seed"], sort=False):
            line = front_line(part, str(currency))
            there = [power for power in best if line.index[0] <= power <= line.index[-1]]
            speeds = speeds_within(part, np.array(there), str(currency))
            labels = {"method": method, "seed": seed, "fluid": fluid, "currency": currency, "is_front": True}
            rows.append(
                pd.DataFrame(
                    [labels | {"allowed": p, "share": v / best[p]} for p, v in zip(there, speeds, strict=True)]
                )
            )
    return pd.concat([part for part in rows if len(part)] or rows[:1], ignore_index=True)


def best_of_all(reached: pd.DataFrame) -> pd.DataFrame:
    """The highest share that any front of `shares_at` reaches at each power."""
    at = ["fluid", "currency", "allowed"]
    best = reached[reached["is_front"]].groupby(at, sort=False)["share"].max().reset_index()
    return best.assign(method="best of all", seed=0, is_front=True)
