"""The page of the validation study: errors of both engines, their orders, and the energy that does not close."""

from __future__ import annotations

from typing import Any

import pandas as pd

from snakebench.engines import PHYSICS_RATES
from snakebench.report.accuracy import bounds_held
from snakebench.report.bench import DRIVES, bench_page, percent
from snakebench.report.table import LABELS, MEASURED, POWERS, Cell, Table, digits3, failures, first, summary, yes_or_no
from snakebench.store import read_manifest
from snakebench.studies.published import Published
from snakebench.studies.validation import convergence, figures
from snakebench.studies.validation.convergence import AGREED, ATTACK, NUMERICS, SWIM


def page(study: Published) -> dict[str, Any]:
    """What the page shows; the last bench stands beside the study's directory."""
    runs, order, adversaries, costs = (study.tables[name] for name in ("runs", "order", "adversaries", "costs"))
    is_reference = (runs["engine"] == "planar") & (runs["physics_rate"] == study.config["reference_rate"])
    reference = runs[is_reference].set_index(SWIM)
    wrong = convergence.errors(runs[~is_reference], reference).merge(costs)
    apart, orders = convergence.limits(runs, reference), convergence.observed_orders(order)
    attacks, rate = convergence.against_finest(adversaries), _usual_rate(wrong)
    bench = study.directory.parent / "bench"
    return {
        "findings": {
            "errors": wrong,
            "limits": apart.reset_index(),
            "orders": orders,
            "attacks": attacks,
            "usual": wrong[(wrong["engine"] == "pybullet") & (wrong["physics_rate"] == rate)],
        },
        "rate": rate,
        "errors": _error_table(wrong),
        "agreement": _agreement(reference, apart, wrong, rate),
        "bounds": bounds_held(runs[~is_reference], reference, SWIM),
        "attacked": bounds_held(adversaries, convergence.finest(adversaries), ATTACK),
        "orders": _order_table(orders),
        "attacks": _attack_table(attacks),
        "work_precision": figures.work_precision(wrong),
        "order_figure": figures.order(order),
        "energy": figures.energy(runs, adversaries),
        "n_runs": len(runs),
        "unsteady": int((~runs["steady"]).sum()),
        "failed": failures(runs),
        "bench": bench_page(bench, read_manifest(bench)) if (bench / "bench.csv").exists() else None,
    }


def _usual_rate(wrong: pd.DataFrame) -> int:
    """PyBullet's own rate [Hz] if all gaits were run at it, or the slowest at which they were."""
    run = wrong[wrong["engine"] == "pybullet"].groupby("physics_rate")["gait"].nunique()
    common = set(run[run == run.max()].index)
    return PHYSICS_RATES["pybullet"] if PHYSICS_RATES["pybullet"] in common else int(min(common))


def _error_table(wrong: pd.DataFrame) -> Table:
    """Errors over all gaits and fluids, median / largest, and the cost of an engine at a rate."""

    def spread(name: str) -> Cell:
        return lambda part: f"{percent(part[name].median())} / {percent(part[name].max())}"

    columns: list[Any] = [(f"error of {LABELS[name].split()[0]}", spread(name)) for name in MEASURED]
    columns.append(("energy gap", lambda part: percent(part["energy_gap"].abs().max())))
    columns.append(("cost [ms/s]", lambda part: f"{1000 * part['seconds_per_second'].iloc[0]:.2f}"))
    ordered = wrong.sort_values(["engine", "drives", "physics_rate"], kind="stable")
    return summary(ordered, ["engine", "drives", "physics_rate"], columns, label=_label)


def _agreement(reference: pd.DataFrame, apart: pd.DataFrame, wrong: pd.DataFrame, rate: int) -> Table:
    """The planar limit of every swim, how far PyBullet's is from it, and PyBullet's error at its rate."""
    at_rate = wrong[(wrong["engine"] == "pybullet") & (wrong["physics_rate"] == rate)].set_index(SWIM)
    errors = at_rate[[*AGREED]].add_suffix("_error")
    table = reference[[*AGREED, "steady"]].join([apart.add_suffix("_limit"), errors])

    def signed(name: str) -> Cell:
        return lambda part: f"{100 * part[name].iloc[0]:+.4f} %"

    def error(name: str) -> Cell:
        return lambda part: percent(part[f"{name}_error"].iloc[0])

    labels = {name: LABELS[name].split()[0] for name in AGREED}
    return summary(
        table.dropna(subset="speed_limit").reset_index(),
        SWIM,
        [
            *((LABELS[name], digits3(name)) for name in AGREED),
            *((f"PyBullet's limit, {label}", signed(f"{name}_limit")) for name, label in labels.items()),
            *((f"{label} at {rate} Hz", error(name)) for name, label in labels.items()),
            ("settled", yes_or_no("steady")),
        ],
    )


def _order_table(orders: pd.DataFrame) -> Table:
    """Order of convergence of the joint angles, over all gaits."""
    columns = [(how, lambda part, how=how: f"{part['observed'].agg(how):.2f}") for how in ("median", "min", "max")]
    by = ["engine", "drives", "physics_rate"]
    finer = ("to [Hz]", first("finer", ".0f"))
    return summary(orders.sort_values(by, kind="stable"), by, [finer, *columns], label=_label)


def _attack_table(attacks: pd.DataFrame) -> Table:
    """Each engine and rate under every adversary: powers, energy gap, and displacement at the end."""
    return summary(
        attacks.sort_values(NUMERICS, kind="stable"),
        {name: attacks[name].unique() for name in ATTACK} | {name: sorted(attacks[name].unique()) for name in NUMERICS},
        [
            *((LABELS[name], digits3(name)) for name in POWERS),
            ("energy gap [%]", lambda part: f"{100 * part['energy_gap'].iloc[0]:.2g}"),
            ("displaced by [mm]", lambda part: f"{1000 * part['displaced'].iloc[0]:.2g}"),
        ],
    )


def _label(engine: str, drives: str, rate: int) -> str:
    return f"{engine}, {DRIVES[drives]}, {rate} Hz"
