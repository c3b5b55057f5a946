"""Errors of the validation study: against the planar limit, between the engines' limits, and their orders."""

from __future__ import annotations

import numpy as np
import pandas as pd

from snakebench.report.table import MEASURED, POWERS

SWIM = ["gait", "fluid"]
ATTACK = ["adversary", "fluid"]
NUMERICS = ["engine", "physics_rate"]
AGREED = ("speed", *POWERS)  # figures of which the engines' limits are compared


def errors(runs: pd.DataFrame, reference: pd.DataFrame) -> pd.DataFrame:
    """The relative error of each run against the reference of its gait and fluid: columns of `MEASURED`."""
    limit = reference.loc[pd.MultiIndex.from_frame(runs[SWIM]), list(MEASURED)].set_axis(runs.index)
    return runs[[*SWIM, "drives", *NUMERICS, "energy_gap"]].join((runs[list(MEASURED)] / limit - 1).abs())


def limits(runs: pd.DataFrame, reference: pd.DataFrame) -> pd.DataFrame:
    """PyBullet's limit over planar's, less one: Richardson's extrapolation of its two finest rates, second order."""
    bullet = runs[runs["engine"] == "pybullet"]
    slow, fast = sorted(bullet["physics_rate"].unique())[-2:]
    coarse, fine = (bullet[bullet["physics_rate"] == rate].set_index(SWIM)[list(AGREED)] for rate in (slow, fast))
    limit = (fine + slow**2 / (fast**2 - slow**2) * (fine - coarse)).dropna(how="all")
    return limit / reference.loc[limit.index, list(AGREED)] - 1


def observed_orders(order: pd.DataFrame) -> pd.DataFrame:
    """Order between each rate and the next finer one: log of the errors' ratio over log of the rates' ratio."""
    rows = order.sort_values("physics_rate", kind="stable")
    finer = rows.groupby(["gait", "engine"])[["physics_rate", "error"]].shift(-1)
    observed = np.log(rows["error"] / finer["error"]) / np.log(finer["physics_rate"] / rows["physics_rate"])
    return rows.assign(finer=finer["physics_rate"], observed=observed).dropna(subset="observed")


def finest(adversaries: pd.DataFrame) -> pd.DataFrame:
    """Those of the planar engine at its finest rate, by adversary and fluid."""
    planar = adversaries[adversaries["engine"] == "planar"]
    return planar[planar["physics_rate"] == planar["physics_rate"].max()].set_index(ATTACK)


def against_finest(adversaries: pd.DataFrame) -> pd.DataFrame:
    """Relative errors of powers, and distance [m] of the centre of mass at the end, from planar at its finest rate."""
    limit = finest(adversaries).loc[pd.MultiIndex.from_frame(adversaries[ATTACK])]
    away = [adversaries[name].to_numpy() - limit[name].to_numpy() for name in ("end_x", "end_y")]
    errors = {f"{name}_off": (adversaries[name] / limit[name].to_numpy() - 1).abs() for name in POWERS}
    return adversaries.assign(**errors, displaced=np.hypot(*away))
