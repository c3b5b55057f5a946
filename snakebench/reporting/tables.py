"""Tables: result rows to what a page prints, with intervals and numerical uncertainty."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
import pandas as pd
from scipy import stats

from snakebench.value import FloatArray

_FIGURES = ["J", "v [m/s]", "P [W]", "CoT", "tail [m]"]


class Table(NamedTuple):
    """A table ready to print; the first column names the rows."""

    caption: str
    head: list[str]
    rows: list[list[str]]


def confidence_interval(values: FloatArray, level: float = 0.95) -> tuple[float, float] | None:
    """Student-t interval of the mean; None for fewer than two values."""
    if len(values) < 2:
        return None
    center, error = float(np.mean(values)), float(stats.sem(values))
    half = error * float(stats.t.ppf((1 + level) / 2, len(values) - 1))
    return center - half, center + half


def winners(optima: pd.DataFrame) -> pd.DataFrame:
    """Of `optima`, the rows of each objective's best seed, judged by the mean return over its fluids as searched."""
    best = _values(optima).groupby("objective", sort=False).idxmax()
    return optima[[pair in set(best) for pair in zip(optima["objective"], optima["seed"], strict=True)]]


def best_gaits(optima: pd.DataFrame, space: Mapping[str, tuple[float, float]]) -> Table:
    """Each fluid's own best gait at the finer rate, ± the difference between the two rates."""
    rows = []
    for fluid, of_fluid in _own(optima).groupby("fluid", sort=False):
        fine, coarse = _variant(of_fluid, "finer step"), _variant(of_fluid, "searched")
        parameters = [_bounded(fine[name], *space[name]) for name in ("amplitude", "frequency", "phase")]
        numbers = [_uncertain(fine[name], coarse[name]) for name in ("return", "speed", "power", "cost_of_transport")]
        swim = [_number(fine[name]) for name in ("swim_frequency", "tail_amplitude", "joint_amplitude")]
        rows.append([f"{fluid}{'' if fine['steady'] else ' †'}", *parameters, *numbers, *swim])
    head = ["tuned to", "A [rad]", "f [Hz]", "ψ [rad]", "J", "v [m/s]", "P [W]", "CoT"]
    return Table(
        "Best sea-snake gait of each fluid. ± is the difference between the two physics rates; for a first-order"
        " integrator the error that remains is about as large. * marks a parameter at the edge of the search space,"
        " † a run that had not settled.",
        [*head, "f_swim [Hz]", "tail [m]", "joint [rad]"],
        rows,
    )


def answers(optima: pd.DataFrame) -> list[str]:
    """The finding for each fluid in one sentence."""
    sentences = []
    for fluid, of_fluid in _own(optima).groupby("fluid", sort=False):
        fine = _variant(of_fluid, "finer step")
        sentences.append(
            f"In {fluid}: {fine['speed']:.3f} m/s at {fine['power']:.2f} W (cost of transport"
            f" {_number(fine['cost_of_transport'])}, return J {_number(fine['return'])}), with"
            f" {_wave(fine)}."
        )
    if "mean" in set(optima["objective"]):
        shared = winners(optima[optima["objective"] == "mean"]).groupby("fluid", sort=False)
        rows = [_variant(of_fluid, "finer step") for _, of_fluid in shared]
        speeds = ", ".join(f"{row['speed']:.3f} m/s in {row['fluid']}" for row in rows)
        sentences.append(f"One gait for all: {speeds}, with {_wave(rows[0])}.")
    return sentences


def over_seeds(optima: pd.DataFrame) -> Table:
    """The objective's value that each search reached: all seeds, mean, spread and interval."""
    rows = []
    for objective, values in _values(optima).groupby("objective", sort=False):
        interval = confidence_interval(values.to_numpy())
        shown = "needs two seeds" if interval is None else f"{interval[0]:.2f} to {interval[1]:.2f}"
        spread = "" if interval is None else f"{values.std():.2f}"
        seeds = ", ".join(f"{value:.2f}" for value in values)
        rows.append([str(objective), str(len(values)), seeds, f"{values.mean():.2f}", spread, shown])
    return Table(
        "Return J of the best gait of every search.",
        ["objective", "n seeds", "J of each seed", "mean", "standard deviation", "95 % Student-t interval of the mean"],
        rows,
    )


def one_gait_for_all(optima: pd.DataFrame) -> Table:
    """The gait tuned to the mean over the fluids beside each fluid's own gait."""
    best = winners(optima)
    rows = [
        [fluid, f"tuned to {'all fluids' if objective == 'mean' else fluid}", *_figures(_variant(rows, "finer step"))]
        for fluid in best["fluid"].unique()
        for objective, rows in best[best["fluid"] == fluid].groupby("objective", sort=False)
    ]
    return Table("The price of one gait for all, at the finer rate.", ["fluid", "gait", *_FIGURES], rows)


def variants(optima: pd.DataFrame) -> Table:
    """Each fluid's own best gait as it was searched, with a finer step, and on a robot that floats neutrally."""
    rows = [
        [row["fluid"], row["variant"], f"{row['physics_rate']:.0f}", f"{row['diameter']:.4f}", *_figures(row)]
        for _, row in _own(optima).iterrows()
    ]
    head = ["fluid", "variant", "physics rate [Hz]", "diameter [m]", *_FIGURES]
    return Table("The same gaits with a finer step, and on a robot that floats neutrally in water.", head, rows)


def _own(optima: pd.DataFrame) -> pd.DataFrame:
    """The rows of each fluid's own best gait."""
    return winners(optima[optima["objective"] == optima["fluid"]])


def _wave(row: pd.Series) -> str:
    return f"A = {row['amplitude']:.2f} rad, f = {row['frequency']:.2f} Hz, ψ = {row['phase']:.2f} rad"


def _figures(row: pd.Series) -> list[str]:
    return [_number(row[name]) for name in ("return", "speed", "power", "cost_of_transport", "tail_amplitude")]


def _values(optima: pd.DataFrame) -> pd.Series:
    """The objective's value of every optimum, by objective and seed: the mean return over its fluids as searched."""
    searched = optima[optima["variant"] == "searched"]
    return searched.groupby(["objective", "seed"], sort=False)["return"].mean()


def _variant(rows: pd.DataFrame, variant: str) -> pd.Series:
    return rows[rows["variant"] == variant].iloc[0]


def _number(value: float | None) -> str:
    return "–" if value is None or pd.isna(value) else f"{value:.3g}" if abs(value) < 10 else f"{value:.1f}"


def _uncertain(fine: float, coarse: float) -> str:
    return f"{_number(fine)} ± {abs(fine - coarse):.1g}"


def _bounded(value: float, low: float, high: float) -> str:
    at_edge = min(value - low, high - value) < 0.02 * (high - low)
    return _number(value) + ("*" if at_edge else "")
