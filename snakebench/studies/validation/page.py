"""What the page shows: tables of the study to sentences, tables and figures."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from snakebench.engines import PHYSICS_RATES
from snakebench.report.accuracy import bounds_held
from snakebench.report.bench import DRIVES, bench_page, percent
from snakebench.report.tables import TAKEN, Table, failures, in_both_currencies, number
from snakebench.store import read_manifest
from snakebench.studies.validation import figures
from snakebench.tables import read_table

METRICS = {"speed": "v"} | {name: label.removesuffix(" [W]") for name, label in TAKEN.items()}
_SWIM = ["gait", "fluid"]
_ATTACK = ["adversary", "fluid"]
_ENGINES = {"pybullet": "PyBullet", "planar": "the planar engine"}
_POWERS = {"power": "P", "positive_power": "P+"}
_SAID = {"speed": "v"} | _POWERS  # in sentences and of each swim


def page(directory: Path, manifest: dict[str, Any]) -> dict[str, Any]:
    """Everything the validation page shows; the last bench stands beside the study's directory."""
    runs, order, adversaries, costs = (
        read_table(directory / f"{name}.csv") for name in ("runs", "order", "adversaries", "costs")
    )
    runs, adversaries = in_both_currencies(runs), in_both_currencies(adversaries)
    is_reference = (runs["engine"] == "planar") & (runs["physics_rate"] == manifest["config"]["reference_rate"])
    reference = runs[is_reference].set_index(_SWIM)
    errors, disagreement = _errors(runs[~is_reference], reference), _disagreement(runs, reference)
    orders = _observed_orders(order)
    bench = directory.parent / "bench"
    return {
        "manifest": manifest,
        "config": manifest["config"],
        "answers": _answers(errors, disagreement, orders, adversaries),
        "summary": _summary(errors, runs, costs),
        "agreement": _agreement(reference, disagreement, errors),
        "bounds": bounds_held(runs[~is_reference], reference, _SWIM),
        "attacked": bounds_held(adversaries, _finest(adversaries), _ATTACK),
        "orders": _orders_table(orders),
        "ledger": _ledger(adversaries),
        "work_precision": figures.work_precision(errors.merge(costs)),
        "order_figure": figures.order(order),
        "energy": figures.energy(runs, adversaries),
        "n_runs": len(runs),
        "unsteady": int((~runs["steady"]).sum()),
        "failed": failures(runs),
        "bench": bench_page(bench, read_manifest(bench)) if (bench / "bench.csv").exists() else None,
    }


def _errors(runs: pd.DataFrame, reference: pd.DataFrame) -> pd.DataFrame:
    """Relative error of each metric of each run against the reference of its gait and fluid; one row a metric."""
    at = pd.MultiIndex.from_frame(runs[_SWIM])
    about = runs[[*_SWIM, "drives", "engine", "physics_rate"]]
    return pd.concat(
        [
            about.assign(
                metric=metric, error=np.abs(runs[metric].to_numpy() / reference[metric].loc[at] - 1).to_numpy()
            )
            for metric in METRICS
        ],
        ignore_index=True,
    )


def _disagreement(runs: pd.DataFrame, reference: pd.DataFrame) -> pd.DataFrame:
    """PyBullet's limit over planar's, less one: Richardson's extrapolation of its two finest rates, second order."""
    bullet = runs[runs["engine"] == "pybullet"]
    slow, fast = sorted(bullet["physics_rate"].unique())[-2:]
    coarse, fine = (bullet[bullet["physics_rate"] == rate].set_index(_SWIM)[list(METRICS)] for rate in (slow, fast))
    limit = (fine + slow**2 / (fast**2 - slow**2) * (fine - coarse)).dropna(how="all")
    return limit / reference[list(METRICS)].loc[limit.index] - 1


def _observed_orders(order: pd.DataFrame) -> pd.DataFrame:
    """Order between each rate and the next finer one: log of the errors' ratio over log of the rates' ratio."""
    rows = order.sort_values("physics_rate", kind="stable")
    finer = rows.groupby(["gait", "engine"])[["physics_rate", "error"]].shift(-1)
    observed = np.log(rows["error"] / finer["error"]) / np.log(finer["physics_rate"] / rows["physics_rate"])
    return rows.assign(finer=finer["physics_rate"], observed=observed).dropna(subset="observed")


def _answers(
    errors: pd.DataFrame, disagreement: pd.DataFrame, orders: pd.DataFrame, adversaries: pd.DataFrame
) -> list[str]:
    """The findings, a sentence each."""
    n_gaits, n_fluids = (disagreement.index.unique(level).size for level in _SWIM)
    rate, worst = _usual_rate(errors), disagreement.abs().max()
    bullet = errors[(errors["engine"] == "pybullet") & (errors["physics_rate"] == rate)]
    typical = bullet.groupby("metric")["error"].agg(["median", "max"])
    return [
        f"Both engines tend to the same limit: over {n_gaits} gaits in {n_fluids} fluid{'s' if n_fluids > 1 else ''},"
        f" PyBullet extrapolated to vanishing steps differs from the planar engine by at most {_each(worst)}.",
        f"At {rate} Hz PyBullet is off by {_each(typical['median'])} in the median, by up to {_each(typical['max'])}.",
        f"Order of convergence observed: {_by_engine(orders, _orders_of)}.",
        "Under adversarial target angles the part of the driving work that does not close is at most"
        f" {_by_engine(adversaries, _gaps_of)}.",
        *_adversarial(adversaries, rate),
    ]


def _each(shares: pd.Series) -> str:
    """Errors of speed and powers, those that are known."""
    *most, last = (f"{percent(shares[name])} in {said}" for name, said in _SAID.items() if pd.notna(shares[name]))
    return f"{', '.join(most)} and {last}"


def _adversarial(adversaries: pd.DataFrame, rate: int) -> list[str]:
    """How wrong PyBullet is under adversarial target angles; nothing of tables that lack the displacement."""
    here = _against_finest(adversaries).query("engine == 'pybullet' and physics_rate == @rate")
    if not len(here):
        return []
    off = [
        f"in {said} by {percent(error.median())} in the median and by at most {percent(error.max())}"
        for name, said in _POWERS.items()
        if (error := here[f"{name}_error"].abs()).notna().any()
    ]
    return [
        f"Under them PyBullet's power at {rate} Hz is off {', '.join(off)}, and its centre of mass by at most"
        f" {1000 * here['strayed'].max():.2g} mm."
    ]


def _finest(adversaries: pd.DataFrame) -> pd.DataFrame:
    """Those of the planar engine at its finest rate, by adversary and fluid."""
    planar = adversaries[adversaries["engine"] == "planar"]
    return planar[planar["physics_rate"] == planar["physics_rate"].max()].set_index(_ATTACK)


def _against_finest(adversaries: pd.DataFrame) -> pd.DataFrame:
    """Relative errors of powers, and distance [m] of the centre of mass at the end, from planar at its finest rate."""
    errors = {f"{name}_error": 0.0 for name in _POWERS}
    if "end_x" not in adversaries:  # version 1.0 did not write it
        return adversaries.iloc[:0].assign(**errors, strayed=0.0)
    limit = _finest(adversaries).loc[pd.MultiIndex.from_frame(adversaries[_ATTACK])]
    away = [adversaries[name].to_numpy() - limit[name].to_numpy() for name in ("end_x", "end_y")]
    errors = {f"{name}_error": adversaries[name].to_numpy() / limit[name].to_numpy() - 1 for name in _POWERS}
    return adversaries.assign(**errors, strayed=np.hypot(*away))


def _by_engine(table: pd.DataFrame, said: Callable[[pd.DataFrame], str]) -> str:
    return "; ".join(f"{said(part)} in {_ENGINES[str(engine)]}" for engine, part in table.groupby("engine"))


def _orders_of(orders: pd.DataFrame) -> str:
    found = orders.groupby("drives")["observed"].median()
    return " and ".join(f"{value:.1f} under {DRIVES[str(drives)]}" for drives, value in found.items())


def _gaps_of(adversaries: pd.DataFrame) -> str:
    worst = adversaries["energy_gap"].abs().groupby(adversaries["physics_rate"]).max()
    return " and ".join(f"{percent(worst.iloc[k])} at {worst.index[k]} Hz" for k in (0, -1))


def _usual_rate(errors: pd.DataFrame) -> int:
    """PyBullet's own rate [Hz] if all gaits were run at it, or the slowest at which they were."""
    bullet = errors[errors["engine"] == "pybullet"]
    run = bullet.groupby("physics_rate")["gait"].nunique()
    common = set(run[run == run.max()].index)
    return PHYSICS_RATES["pybullet"] if PHYSICS_RATES["pybullet"] in common else int(min(common))


def _summary(errors: pd.DataFrame, runs: pd.DataFrame, costs: pd.DataFrame) -> Table:
    by = ["engine", "drives", "physics_rate"]
    cost = costs.set_index(by)["seconds_per_second"].to_dict()
    gaps = runs.groupby(by)["energy_gap"].apply(lambda gaps: gaps.abs().max()).to_dict()
    rows = []
    for key, part in errors.groupby(by):
        engine, drives, rate = map(str, key)
        of_metric = part.groupby("metric")["error"].agg(["median", "max"]).to_dict("index")
        shown = [f"{percent(of_metric[name]['median'])} / {percent(of_metric[name]['max'])}" for name in METRICS]
        rows.append([f"{engine}, {DRIVES[drives]}", rate, *shown, percent(gaps[key]), f"{1000 * cost[key]:.2f}"])
    rows.sort(key=lambda row: (row[0], int(row[1])))
    return Table(
        "Error against the planar limit over all gaits and fluids, median / largest; the largest part of the driving"
        " work that the integrator lost or made; and time per simulated second of one robot on one core.",
        ["engine", "rate [Hz]", *(f"error of {name}" for name in METRICS.values()), "energy gap", "cost [ms/s]"],
        rows,
    )


def _agreement(reference: pd.DataFrame, disagreement: pd.DataFrame, errors: pd.DataFrame) -> Table:
    rate = _usual_rate(errors)
    bullet = errors[(errors["engine"] == "pybullet") & (errors["physics_rate"] == rate)]
    at_rate = bullet.set_index([*_SWIM, "metric"])["error"].to_dict()
    limit = reference.to_dict("index")
    rows = []
    for row in disagreement.reset_index().to_dict("records"):
        swim = row["gait"], row["fluid"]
        rows.append(
            [
                f"{row['gait']}, {row['fluid']}",
                f"{limit[swim]['speed']:.4f}",
                f"{limit[swim]['power']:.4f}",
                number(limit[swim]["positive_power"]),
                *("–" if pd.isna(row[metric]) else f"{100 * row[metric]:+.4f} %" for metric in _SAID),
                *(percent(at_rate[*swim, metric]) for metric in _SAID),
                "yes" if limit[swim]["steady"] else "no",
            ]
        )
    limits = ["v [m/s]", "P [W]", "P+ [W]", *(f"PyBullet's limit, {said}" for said in _SAID.values())]
    return Table(
        "The planar limit of every swim, how far PyBullet's extrapolated limit is from it, and PyBullet's error at"
        f" {rate} Hz.",
        ["swim", *limits, *(f"{said} at {rate} Hz" for said in _SAID.values()), "settled"],
        rows,
    )


def _orders_table(orders: pd.DataFrame) -> Table:
    rows = []
    for (engine, drives, rate, finer), part in orders.groupby(["engine", "drives", "physics_rate", "finer"]):
        observed = part["observed"]
        shown = [f"{value:.2f}" for value in (observed.median(), observed.min(), observed.max())]
        rows.append([f"{engine}, {DRIVES[str(drives)]}", f"{rate} to {finer:.0f} Hz", *shown])
    return Table(
        "Order of convergence of the joint angles, over all gaits.",
        ["engine", "between", "median order", "least", "largest"],
        rows,
    )


def _ledger(adversaries: pd.DataFrame) -> Table:
    columns = sorted(set(zip(adversaries["engine"], adversaries["physics_rate"], strict=True)))
    rows = []
    for (adversary, fluid), part in adversaries.groupby(["adversary", "fluid"], sort=False):
        cells = part.set_index(["engine", "physics_rate"])[[*_POWERS, "energy_gap"]].to_dict("index")
        away = _against_finest(part).set_index(["engine", "physics_rate"])["strayed"].to_dict()
        moved = {key: f", {1000 * distance:.2g} mm" for key, distance in away.items()}
        powers = {key: f"{cell['power']:.2f} / {number(cell['positive_power'])} W" for key, cell in cells.items()}
        shown = [f"{powers[key]}, {100 * cells[key]['energy_gap']:.2g} %{moved.get(key, '')}" for key in columns]
        rows.append([f"{adversary}, {fluid}", *shown])
    return Table(
        "Adversarial target angles at 30 Hz: power P / P+, the part of the driving work that the integrator lost (below"
        " zero: made), and how far the centre of mass ends from planar's at its finest rate.",
        ["targets", *(f"{engine} {rate} Hz" for engine, rate in columns)],
        rows,
    )
