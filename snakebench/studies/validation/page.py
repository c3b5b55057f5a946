"""The page of the validation study: errors of both engines, their orders, and the energy that does not close."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd

from snakebench.engines import PHYSICS_RATES
from snakebench.report.accuracy import bounds_held
from snakebench.report.bench import DRIVES, bench_page, percent
from snakebench.report.table import LABELS, MEASURED, POWERS, Cell, Column, Table, digits3, failures, first, summary
from snakebench.store import read_manifest
from snakebench.studies.published import Published
from snakebench.studies.validation import figures

_SWIM = ["gait", "fluid"]
_ATTACK = ["adversary", "fluid"]
_NUMERICS = ["engine", "physics_rate"]
_AGREED = ("speed", *POWERS)


def page(study: Published) -> dict[str, Any]:
    """What the page shows; the last bench stands beside the study's directory."""
    runs, order, adversaries, costs = (study.tables[name] for name in ("runs", "order", "adversaries", "costs"))
    is_reference = (runs["engine"] == "planar") & (runs["physics_rate"] == study.config["reference_rate"])
    reference = runs[is_reference].set_index(_SWIM)
    errors = _errors(runs[~is_reference], reference).merge(costs)
    limits, orders, attacks = _limits(runs, reference), _observed_orders(order), _against_finest(adversaries)
    rate = _usual_rate(errors)
    bench = study.directory.parent / "bench"
    return {
        "findings": {
            "errors": errors,
            "limits": limits.reset_index(),
            "orders": orders,
            "attacks": attacks,
            "usual": errors[(errors["engine"] == "pybullet") & (errors["physics_rate"] == rate)],
        },
        "rate": rate,
        "errors": _error_table(errors),
        "agreement": _agreement(reference, limits, errors, rate),
        "bounds": bounds_held(runs[~is_reference], reference, _SWIM),
        "attacked": bounds_held(adversaries, _finest(adversaries), _ATTACK),
        "orders": _order_table(orders),
        "attacks": _attack_table(attacks),
        "work_precision": figures.work_precision(errors.melt(_LABELS, MEASURED, "metric", "error")),
        "order_figure": figures.order(order),
        "energy": figures.energy(runs, adversaries),
        "n_runs": len(runs),
        "unsteady": int((~runs["steady"]).sum()),
        "failed": failures(runs),
        "bench": bench_page(bench, read_manifest(bench)) if (bench / "bench.csv").exists() else None,
    }


_LABELS = [*_SWIM, "drives", *_NUMERICS, "seconds_per_second"]


def _errors(runs: pd.DataFrame, reference: pd.DataFrame) -> pd.DataFrame:
    """The relative error of each run against the reference of its gait and fluid: columns of `MEASURED`."""
    limit = reference.loc[pd.MultiIndex.from_frame(runs[_SWIM]), list(MEASURED)].to_numpy()
    return runs[[*_SWIM, "drives", *_NUMERICS, "energy_gap"]].join((runs[list(MEASURED)] / limit - 1).abs())


def _limits(runs: pd.DataFrame, reference: pd.DataFrame) -> pd.DataFrame:
    """PyBullet's limit over planar's, less one: Richardson's extrapolation of its two finest rates, second order."""
    bullet = runs[runs["engine"] == "pybullet"]
    slow, fast = sorted(bullet["physics_rate"].unique())[-2:]
    coarse, fine = (bullet[bullet["physics_rate"] == rate].set_index(_SWIM)[list(_AGREED)] for rate in (slow, fast))
    limit = (fine + slow**2 / (fast**2 - slow**2) * (fine - coarse)).dropna(how="all")
    return limit / reference.loc[limit.index, list(_AGREED)] - 1


def _observed_orders(order: pd.DataFrame) -> pd.DataFrame:
    """Order between each rate and the next finer one: log of the errors' ratio over log of the rates' ratio."""
    rows = order.sort_values("physics_rate", kind="stable")
    finer = rows.groupby(["gait", "engine"])[["physics_rate", "error"]].shift(-1)
    observed = np.log(rows["error"] / finer["error"]) / np.log(finer["physics_rate"] / rows["physics_rate"])
    return rows.assign(finer=finer["physics_rate"], observed=observed).dropna(subset="observed")


def _finest(adversaries: pd.DataFrame) -> pd.DataFrame:
    """Those of the planar engine at its finest rate, by adversary and fluid."""
    planar = adversaries[adversaries["engine"] == "planar"]
    return planar[planar["physics_rate"] == planar["physics_rate"].max()].set_index(_ATTACK)


def _against_finest(adversaries: pd.DataFrame) -> pd.DataFrame:
    """Relative errors of powers, and distance [m] of the centre of mass at the end, from planar at its finest rate."""
    limit = _finest(adversaries).loc[pd.MultiIndex.from_frame(adversaries[_ATTACK])]
    away = [adversaries[name].to_numpy() - limit[name].to_numpy() for name in ("end_x", "end_y")]
    errors = {f"{name}_off": (adversaries[name] / limit[name].to_numpy() - 1).abs() for name in POWERS}
    return adversaries.assign(**errors, displaced=np.hypot(*away))


def _usual_rate(errors: pd.DataFrame) -> int:
    """PyBullet's own rate [Hz] if all gaits were run at it, or the slowest at which they were."""
    run = errors[errors["engine"] == "pybullet"].groupby("physics_rate")["gait"].nunique()
    common = set(run[run == run.max()].index)
    return PHYSICS_RATES["pybullet"] if PHYSICS_RATES["pybullet"] in common else int(min(common))


def _error_table(errors: pd.DataFrame) -> Table:
    """Errors over all gaits and fluids, median / largest, and the cost of an engine at a rate."""

    def spread(name: str) -> Cell:
        return lambda part: f"{percent(part[name].median())} / {percent(part[name].max())}"

    columns: list[Column] = [(f"error of {LABELS[name].split()[0]}", spread(name)) for name in MEASURED]
    columns.append(("energy gap", lambda part: percent(part["energy_gap"].abs().max())))
    columns.append(("cost [ms/s]", lambda part: f"{1000 * part['seconds_per_second'].iloc[0]:.2f}"))
    ordered = errors.sort_values(["engine", "drives", "physics_rate"], kind="stable")
    return summary(ordered, ["engine", "drives", "physics_rate"], columns, label=_label)


def _agreement(reference: pd.DataFrame, limits: pd.DataFrame, errors: pd.DataFrame, rate: int) -> Table:
    """The planar limit of every swim, how far PyBullet's is from it, and PyBullet's error at its rate."""
    at_rate = errors[(errors["engine"] == "pybullet") & (errors["physics_rate"] == rate)].set_index(_SWIM)
    table = (
        reference[[*_AGREED, "steady"]].join(limits.add_suffix("_limit")).join(at_rate[[*_AGREED]], rsuffix="_error")
    )

    def signed(name: str) -> Cell:
        return lambda part: f"{100 * part[name].iloc[0]:+.4f} %"

    labels = {name: LABELS[name].split()[0] for name in _AGREED}
    return summary(
        table.dropna(subset="speed_limit").reset_index(),
        _SWIM,
        [
            *((LABELS[name], digits3(name)) for name in _AGREED),
            *((f"PyBullet's limit, {label}", signed(f"{name}_limit")) for name, label in labels.items()),
            *((f"{label} at {rate} Hz", _share(f"{name}_error")) for name, label in labels.items()),
            ("settled", lambda part: "yes" if part["steady"].iloc[0] else "no"),
        ],
    )


def _share(name: str) -> Cell:
    return lambda part: percent(part[name].iloc[0])


def _order_table(orders: pd.DataFrame) -> Table:
    """Order of convergence of the joint angles, over all gaits."""
    columns = [(how, lambda part, how=how: f"{part['observed'].agg(how):.2f}") for how in ("median", "min", "max")]
    by = ["engine", "drives", "physics_rate"]
    finer = ("to [Hz]", first("finer", ".0f"))
    return summary(orders.sort_values(by, kind="stable"), by, [finer, *columns], label=_label)


def _attack_table(attacks: pd.DataFrame) -> Table:
    """Each engine and rate under every adversary: powers, energy gap, and displacement at the end."""
    return summary(
        attacks.sort_values(_NUMERICS, kind="stable"),
        {name: attacks[name].unique() for name in _ATTACK}
        | {name: sorted(attacks[name].unique()) for name in _NUMERICS},
        [
            *((LABELS[name], digits3(name)) for name in POWERS),
            ("energy gap [%]", lambda part: f"{100 * part['energy_gap'].iloc[0]:.2g}"),
            ("displaced by [mm]", lambda part: f"{1000 * part['displaced'].iloc[0]:.2g}"),
        ],
    )


def _label(engine: str, drives: str, rate: int) -> str:
    return f"{engine}, {DRIVES[drives]}, {rate} Hz"
