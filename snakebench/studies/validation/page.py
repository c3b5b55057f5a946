"""The page of the validation study: errors of both engines, their orders, and the energy that does not close."""

from typing import Any

import numpy as np
import pandas as pd

from snakebench.report import table
from snakebench.report.accuracy import bounds_held
from snakebench.report.bench import DRIVES, percent
from snakebench.report.table import LABELS, MEASURED, POWERS, Table, digits3, first, summary, under_labels
from snakebench.studies.published import Published
from snakebench.studies.validation import figures

_SWIM = ["gait", "fluid"]
_ATTACK = ["adversary", "fluid"]
_NUMERICS = ["engine", "physics_rate"]
_AGREED = ["speed", *POWERS]  # figures of which the engines' limits are compared
_SHORT = {name: LABELS[name].split()[0] for name in MEASURED}


def page(study: Published) -> dict[str, Any]:
    """What the page shows."""
    runs, order, adversaries, costs = study.tables.values()
    is_reference = (runs["engine"] == "planar") & (runs["physics_rate"] == study.config["reference_rate"])
    reference, compared = runs[is_reference].set_index(_SWIM), runs[~is_reference]
    wrong = errors(compared, reference).merge(costs)
    apart, orders, attacks = limits(runs, reference), observed_orders(order), against_finest(adversaries)
    observed = [(how, lambda part, how=how: f"{part['observed'].agg(how):.2f}") for how in ("median", "min", "max")]
    return {
        "findings": {"errors": wrong, "limits": apart.reset_index(), "orders": orders, "attacks": attacks},
        "errors": _error_table(wrong),
        "agreement": _agreement(reference, apart),
        "bounds": bounds_held(compared, reference, _SWIM),
        "attacked": bounds_held(adversaries, _finest(adversaries), _ATTACK),
        "orders": _by_engine(orders, [("to [Hz]", first("finer", ".0f")), *observed]),
        "attacks": _attack_table(attacks),
        "work_precision": figures.work_precision(wrong),
        "order_figure": figures.order(order),
        "energy": figures.energy(runs, adversaries),
        **table.validity(runs),
    }


def _relative(swims: pd.DataFrame, limits: pd.DataFrame, keys: list[str], names: tuple[str, ...]) -> pd.DataFrame:
    """Relative differences of swims to the limits that have the same keys in their index."""
    return swims[list(names)] / swims[keys].join(limits[list(names)], on=keys)[list(names)] - 1


def errors(runs: pd.DataFrame, reference: pd.DataFrame) -> pd.DataFrame:
    """The relative error of each run against the reference of its gait and fluid: columns of `MEASURED`."""
    wrong = _relative(runs, reference, _SWIM, MEASURED).abs()
    return runs[[*_SWIM, "drives", *_NUMERICS, "energy_gap"]].join(wrong)


def limits(runs: pd.DataFrame, reference: pd.DataFrame) -> pd.DataFrame:
    """PyBullet's limit over planar's, less one: Richardson's extrapolation of its two finest rates, second order."""
    bullet = runs[runs["engine"] == "pybullet"]
    slow, fast = sorted(bullet["physics_rate"].unique())[-2:]
    coarse, fine = (bullet[bullet["physics_rate"] == rate].set_index(_SWIM)[_AGREED] for rate in (slow, fast))
    limit = (fine + slow**2 / (fast**2 - slow**2) * (fine - coarse)).dropna(how="all")
    return limit / reference.loc[limit.index, _AGREED] - 1


def observed_orders(order: pd.DataFrame) -> pd.DataFrame:
    """Order between each rate and the next finer one: log of the errors' ratio over log of the rates' ratio."""
    rows = order.sort_values("physics_rate", kind="stable")
    finer = rows.groupby(["gait", "engine"])[["physics_rate", "error"]].shift(-1)
    observed = np.log(rows["error"] / finer["error"]) / np.log(finer["physics_rate"] / rows["physics_rate"])
    return rows.assign(finer=finer["physics_rate"], observed=observed).dropna(subset="observed")


def _finest(adversaries: pd.DataFrame) -> pd.DataFrame:
    planar = adversaries[adversaries["engine"] == "planar"]
    return planar[planar["physics_rate"] == planar["physics_rate"].max()].set_index(_ATTACK)


def against_finest(adversaries: pd.DataFrame) -> pd.DataFrame:
    """Relative errors of powers, and distance [m] of the centre of mass at the end, from planar at its finest rate."""
    finest = _finest(adversaries)
    wrong = _relative(adversaries, finest, _ATTACK, POWERS).abs().add_suffix("_off")
    ends = adversaries[_ATTACK].join(finest[["end_x", "end_y"]], on=_ATTACK)
    away = np.hypot(adversaries["end_x"] - ends["end_x"], adversaries["end_y"] - ends["end_y"])
    return adversaries.join(wrong).assign(displaced=away)


def _error_table(wrong: pd.DataFrame) -> Table:
    columns: list[Any] = [
        (f"error of {label}", lambda part, name=name: f"{percent(part[name].median())} / {percent(part[name].max())}")
        for name, label in _SHORT.items()
    ]
    columns.append(("energy gap", lambda part: percent(part["energy_gap"].abs().max())))
    columns.append(("cost [ms/s]", lambda part: f"{1000 * part['seconds_per_second'].iloc[0]:.2f}"))
    return _by_engine(wrong, columns)


def _agreement(reference: pd.DataFrame, apart: pd.DataFrame) -> Table:
    both = reference.join(apart.add_suffix("_limit"), how="right").reset_index()
    differences = [
        (f"PyBullet's limit, {_SHORT[name]}", lambda part, name=name: f"{100 * part[f'{name}_limit'].iloc[0]:+.2g} %")
        for name in _AGREED
    ]
    return summary(both, _SWIM, [*under_labels(digits3, _AGREED), *differences, ("settled", table.yes_or_no("steady"))])


def _by_engine(swims: pd.DataFrame, columns: list[Any]) -> Table:
    by = ["engine", "drives", "physics_rate"]
    label = "{}, {}, {} Hz".format
    named = swims.sort_values(by, kind="stable").assign(drives=lambda rows: rows["drives"].map(DRIVES))
    return summary(named, by, columns, label=label)


def _attack_table(attacks: pd.DataFrame) -> Table:
    shown = attacks.assign(gap=100 * attacks["energy_gap"], millimetres=1000 * attacks["displaced"])
    by = {name: shown[name].unique() for name in _ATTACK} | {name: sorted(shown[name].unique()) for name in _NUMERICS}
    others = [("energy gap [%]", first("gap", ".2g")), ("displaced by [mm]", first("millimetres", ".2g"))]
    return summary(shown, by, [*under_labels(digits3, POWERS), *others])
