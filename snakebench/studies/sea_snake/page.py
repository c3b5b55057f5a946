"""What the sea-snake page shows: searches and optima to sentences, tables and figures."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pandas as pd

from snakebench.controllers import SeaSnake
from snakebench.report.animation import swimmer
from snakebench.report.assumptions import assumptions_of
from snakebench.report.summary import over_seeds, size, summary
from snakebench.report.tables import (
    TAKEN,
    Table,
    downloads,
    failures,
    in_both_currencies,
    number,
    with_difference,
)
from snakebench.store import read_table
from snakebench.studies.sea_snake import figures
from snakebench.studies.sea_snake.sampler_tables import comparison
from snakebench.trajectory import Trajectory

_FIGURES = {"return": "J", "speed": "v [m/s]"} | TAKEN | {"tail_amplitude": "tail [m]"}
_UNCERTAIN = ["return", "speed", *TAKEN]


def page(directory: Path, manifest: dict[str, Any]) -> dict[str, Any]:
    """Everything the sea-snake page shows."""
    trials, optima = read_table(directory / "trials.csv"), in_both_currencies(read_table(directory / "optima.csv"))
    config = {"engine": "pybullet"} | manifest["config"]
    objectives = list(dict.fromkeys(trials["objective"]))
    pairs = list(dict.fromkeys(zip(optima["objective"], optima["fluid"], strict=True)))
    swims = {pair: Trajectory.load(directory / "trajectories" / f"{pair[0]}-{pair[1]}.npz") for pair in pairs}
    own = {fluid: swim for (objective, fluid), swim in swims.items() if objective == fluid}
    labels = {pair: f"own gait in {pair[1]}" if pair[0] == pair[1] else f"shared gait in {pair[1]}" for pair in pairs}
    compared = _compared(directory, config) if config.get("compared") else None
    failed = failures(trials)
    return {
        "manifest": manifest,
        "config": config,
        "answers": [*_answers(optima), *(compared["answers"] if compared else [])],
        "compared": compared,
        "best": _best_gaits(optima, config["space"]),
        "seeds": _over_seeds(optima),
        "shared": _one_gait_for_all(optima) if "mean" in objectives else None,
        "variants": _variants(optima),
        "failed": failed,
        "convergence": figures.convergence(trials),
        "search_space": figures.search_space(trials, config["space"]),
        "time_series": figures.time_series(own),
        "spectra": figures.spectra(own),
        "swimmers": [swimmer(labels[pair], swim) for pair, swim in swims.items()],
        "downloads": downloads(directory, "optima", *(["winners"] if compared else [])),
        "assumptions": assumptions_of(config),
    }


def _compared(directory: Path, config: dict[str, Any]) -> dict[str, Any]:
    """What the sea-snake page shows of the samplers."""
    tried, winners = (read_table(directory / f"{name}.csv") for name in ("samplers", "winners"))
    return comparison(tried, winners, config)


def winners(optima: pd.DataFrame) -> pd.DataFrame:
    """Of `optima`, the rows of each objective's best seed, judged by the mean return over its fluids as searched."""
    best = _values(optima).groupby("objective", sort=False).idxmax()
    return optima[[pair in set(best) for pair in zip(optima["objective"], optima["seed"], strict=True)]]


def _best_gaits(optima: pd.DataFrame, space: Mapping[str, tuple[float, float]]) -> Table:
    """Each fluid's own best gait at the finer rate, and the difference between the two rates."""
    rows = []
    for fluid, of_fluid in _own(optima).groupby("fluid", sort=False):
        fine, coarse = _variant(of_fluid, "finer step"), _variant(of_fluid, "coarser step")
        parameters = [_bounded(fine[name], *space[name]) for name in SeaSnake.SPACE]
        numbers = [with_difference(fine[name], coarse[name], "step") for name in _UNCERTAIN]
        swim = [number(fine[name]) for name in ("swim_frequency", "tail_amplitude", "joint_amplitude")]
        rows.append([f"{fluid}{'' if fine['steady'] else ' †'}", *parameters, *numbers, *swim])
    head = ["tuned to", "A [rad]", "f [Hz]", "ψ [rad]", *(_FIGURES[name] for name in _UNCERTAIN)]
    return Table(
        "Best sea-snake gait of each fluid. Δ is the difference between the two physics rates; the"
        " error that remains is at most about as large. * marks a parameter at the edge of the search space,"
        " † a run that had not settled.",
        [*head, "f_swim [Hz]", "tail [m]", "joint [rad]"],
        rows,
    )


def _answers(optima: pd.DataFrame) -> list[str]:
    """The finding for each fluid in one sentence."""
    sentences = []
    for fluid, of_fluid in _own(optima).groupby("fluid", sort=False):
        fine = _variant(of_fluid, "finer step")
        sentences.append(
            f"In {fluid}: {fine['speed']:.3f} m/s at {fine['power']:.2f} W (cost of transport"
            f" {number(fine['cost_of_transport'])}, return J {number(fine['return'])}), with"
            f" {_wave(fine)}."
        )
    if "mean" in set(optima["objective"]):
        shared = winners(optima[optima["objective"] == "mean"]).groupby("fluid", sort=False)
        rows = [_variant(of_fluid, "finer step") for _, of_fluid in shared]
        speeds = ", ".join(f"{row['speed']:.3f} m/s in {row['fluid']}" for row in rows)
        sentences.append(f"One gait for all: {speeds}, with {_wave(rows[0])}.")
    return sentences


def _over_seeds(optima: pd.DataFrame) -> Table:
    """The objective's value that each search reached: all seeds, mean, interval and spread."""
    values = _values(optima).reset_index()
    spread = ("standard deviation", lambda part: f"{part['return'].std():.2f}" if len(part) > 1 else "")
    return summary(
        "Return J of the best gait of every search.",
        values,
        {"objective": values["objective"].unique()},
        [("n seeds", size), *over_seeds("return", "J of each seed"), spread],
        label=str,
    )


def _one_gait_for_all(optima: pd.DataFrame) -> Table:
    """The gait tuned to the mean over the fluids beside each fluid's own gait."""
    best = winners(optima)
    rows = [
        [fluid, f"tuned to {'all fluids' if objective == 'mean' else fluid}", *_figures(_variant(rows, "finer step"))]
        for fluid in best["fluid"].unique()
        for objective, rows in best[best["fluid"] == fluid].groupby("objective", sort=False)
    ]
    return Table("The price of one gait for all, at the finer rate.", ["fluid", "gait", *_FIGURES.values()], rows)


def _variants(optima: pd.DataFrame) -> Table:
    """Each fluid's own best gait as it was searched, with a finer step, and on a robot that floats neutrally."""
    rows = [
        [row["fluid"], row["variant"], row["engine"], f"{row['physics_rate']:.0f}", f"{row['diameter']:.4f}", *figures]
        for _, row in _own(optima).drop_duplicates(["fluid", "engine", "physics_rate", "diameter"]).iterrows()
        for figures in [_figures(row)]
    ]
    head = ["fluid", "variant", "engine", "rate [Hz]", "diameter [m]", *_FIGURES.values()]
    return Table("The same gaits with a finer step, and on a robot that floats neutrally in water.", head, rows)


def _own(optima: pd.DataFrame) -> pd.DataFrame:
    """The rows of each fluid's own best gait."""
    return winners(optima[optima["objective"] == optima["fluid"]])


def _wave(row: pd.Series) -> str:
    return f"A = {row['amplitude']:.2f} rad, f = {row['frequency']:.2f} Hz, ψ = {row['phase']:.2f} rad"


def _figures(row: pd.Series) -> list[str]:
    return [number(row[name]) for name in _FIGURES]


def _values(optima: pd.DataFrame) -> pd.Series:
    """The objective's value of every optimum, by objective and seed: the mean return over its fluids as searched."""
    searched = optima[optima["variant"] == "searched"]
    return searched.groupby(["objective", "seed"], sort=False)["return"].mean()


def _variant(rows: pd.DataFrame, variant: str) -> pd.Series:
    return rows[rows["variant"] == variant].iloc[0]


def _bounded(value: float, low: float, high: float) -> str:
    at_edge = min(value - low, high - value) < 0.02 * (high - low)
    return number(value) + ("*" if at_edge else "")
