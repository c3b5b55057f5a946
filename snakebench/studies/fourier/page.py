"""What the Fourier page shows: fronts and optima of the free waveform to sentences, tables and figures."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from snakebench.controllers import Fourier
from snakebench.metrics import GRAVITY
from snakebench.report.animation import swimmer
from snakebench.report.assumptions import assumptions_of
from snakebench.report.standings import beside, fastest_within
from snakebench.report.summary import first, over_seeds, size, step_and_engine, summary
from snakebench.report.tables import (
    TAKEN,
    Table,
    downloads,
    failures,
    in_both_currencies,
    number,
    with_difference,
)
from snakebench.robot import Robot
from snakebench.store import INTEGRATED, SIMPLE_SUM, read_manifest
from snakebench.studies.fourier import figures
from snakebench.studies.pareto.page import front_table
from snakebench.studies.sea_snake.page import winners
from snakebench.tables import fourier_gait, read_table
from snakebench.trajectory import Trajectory
from snakebench.value import FloatArray

_GOAL = ["tuned_to", "harmonics", "objective", "price"]
_SEARCH = [*_GOAL, "seed", "value"]
_TIMES = 240  # at which a waveform is drawn over its period


def page(directory: Path, manifest: dict[str, Any]) -> dict[str, Any]:
    """Everything the Fourier page shows; the sea-snake study's optima stand beside the study's directory."""
    growth, optima, gaits, indicators = (
        read_table(directory / f"{name}.csv") for name in ("growth", "optima", "gaits", "indicators")
    )
    optima = in_both_currencies(optima)
    config = manifest["config"]
    swims = _swims(optima)
    searches = _searches(swims, Robot(**config["robot"]).total_mass * GRAVITY)
    best = _best(searches, _GOAL)
    highest = _best(best[best["objective"] == "return"], ["tuned_to"]).to_dict("records")
    sea_snake = _sea_snake(beside(directory, "sea_snake"), config["fluids"])
    shown = {str(row["tuned_to"]): gait_of(gaits, row) for row in highest}
    return {
        "manifest": manifest,
        "config": config,
        "answers": [*_answers(highest, searches), *_one_for_all(indicators), *_beside_sea_snake(searches, sea_snake)],
        "swimmers": [swim for row in highest for swim in _swimmers(directory, row, config["fluids"])],
        "fronts": figures.fronts(searches[searches["valid"]], sea_snake),
        "stars": len(sea_snake),
        "front": _front(best),
        "worth": front_table(indicators),
        "seeds": _over_seeds(searches),
        "best": _best_gaits(best),
        "convergence": figures.growth(growth[growth["objective"] == "return"]),
        "waveforms": figures.waveforms(
            {name: _one_period(gait) for name, gait in shown.items()},
            {name: gait.frequency for name, gait in shown.items()},
        ),
        "agreement": _agreement(optima, swims, manifest),
        "unsettled": int((~swims["steady"]).sum()),
        "failed": failures(swims),
        "n_swims": len(swims),
        "n_optima": len(searches),
        "downloads": downloads(directory, "optima", "gaits", "fronts", "indicators"),
        "assumptions": assumptions_of(config),
    }


def gait_of(gaits: pd.DataFrame, search: Mapping[Any, Any]) -> Fourier:
    """The gait that a search found, from the study's table of gaits and a row that names the search."""
    same = [gaits[name].isna() if pd.isna(search[name]) else gaits[name] == search[name] for name in (*_GOAL, "seed")]
    return fourier_gait(gaits[np.logical_and.reduce(same)])


def _swims(optima: pd.DataFrame) -> pd.DataFrame:
    """One row a search and fluid: what its gait does at the finer rate, at the `_coarse` one, and as `_searched`."""
    of_variant = {name: rows.drop(columns="variant") for name, rows in optima.groupby("variant")}
    which = [*_SEARCH, "fluid"]
    both = of_variant["finer step"].merge(of_variant["coarser step"], on=which, suffixes=("", "_coarse"))
    return both.merge(of_variant["searched"], on=which, suffixes=("", "_searched"))


def _searches(swims: pd.DataFrame, weight: float) -> pd.DataFrame:
    """One row a search: the means of its swims over its fluids, undefined unless all are valid.

    Costs of transport are those of the mean speed and powers of a robot of a weight [N].
    """
    by_search = swims.assign(valid=swims["status"] == "ok").groupby(_SEARCH, sort=False, dropna=False)
    every = by_search[["valid", "steady"]].all()
    means = by_search.mean(numeric_only=True).where(every["valid"]).assign(**every)
    for variant in ("", "_coarse"):
        for kind in ("", "positive_"):
            paid = means[f"{kind}power{variant}"] / (weight * means[f"speed{variant}"])
            means[f"{kind}cost_of_transport{variant}"] = paid
    return means.reset_index()


def _best(searches: pd.DataFrame, by: list[str]) -> pd.DataFrame:
    """The best search of each group, judged as searched; the first of equals."""
    ranked = searches.sort_values("value", ascending=False, kind="stable")
    return ranked.groupby(by, dropna=False).head(1).sort_index()


def _sea_snake(directory: Path, fluids: list[str]) -> pd.DataFrame:
    """The best sea-snake gait of each fluid, and of the same fluids at once, at the finer rate; no rows without any."""
    if not (directory / "manifest.json").exists():
        return pd.DataFrame(columns=["tuned_to", "speed", "power"])
    alike = sorted(read_manifest(directory)["config"]["fluids"]) == sorted(fluids)
    optima = winners(read_table(directory / "optima.csv"))
    fine = optima[(optima["variant"] == "finer step") & optima["fluid"].isin(fluids)]
    shared = fine[(fine["objective"] == "mean") & alike].assign(objective=INTEGRATED)
    found = pd.concat([fine[fine["objective"] == fine["fluid"]], shared])
    return found.groupby("objective", sort=False)[["speed", "power"]].mean().rename_axis("tuned_to").reset_index()


def _swimmers(directory: Path, row: Mapping[Any, Any], fluids: Sequence[str]) -> Iterator[dict[str, Any]]:
    """A gait of the highest return swimming where it was tuned to."""
    shared = row["tuned_to"] == INTEGRATED
    for fluid in fluids if shared else [str(row["tuned_to"])]:
        label, name = (f"one for all in {fluid}", f"{INTEGRATED}-{fluid}") if shared else (fluid, fluid)
        run = Trajectory.load(directory / "trajectories" / f"{name}.npz")
        yield swimmer(f"{label}, {_harmonics(row)}", run)


def _one_period(gait: Fourier) -> FloatArray:
    return gait.commands(np.arange(_TIMES) / _TIMES / gait.frequency, len(gait.cosine[0]))


def _answers(highest: list[dict[Any, Any]], searches: pd.DataFrame) -> Iterator[str]:
    """The best gait of each fluid and of all, and what each further harmonic adds to the return."""
    for row in highest:
        yield (
            f"{_where(row['tuned_to']).capitalize()}: {number(row['speed'])} m/s at {number(row['power'])} W (cost of"
            f" transport {number(row['cost_of_transport'])}, return J {number(row['return'])}), with {_harmonics(row)}"
            f" at {row['swim_frequency']:.2f} Hz."
        )
    of_return = searches[searches["objective"] == "return"]
    names = [row["tuned_to"] for row in highest]
    mean = of_return.groupby(["harmonics", "tuned_to"])["value"].mean().unstack("tuned_to")[names]
    for fewer, more in pairwise(mean.index):
        gains = mean.loc[more] / mean.loc[fewer] - 1
        shown = ", ".join(f"{100 * gain:+.1f} % {_where(str(name))}" for name, gain in gains.items())
        yield f"From {fewer} to {more} harmonics the mean J of all seeds changes by {shown}."


def _one_for_all(indicators: pd.DataFrame) -> Iterator[str]:
    """What one waveform for all fluids costs."""
    worth = indicators.set_index("front")["hypervolume"]
    if INTEGRATED in worth:
        yield (
            f"One waveform for all fluids reaches {100 * worth[INTEGRATED] / worth[SIMPLE_SUM]:.0f} % of the"
            " hypervolume of switching between those of each fluid."
        )


def _beside_sea_snake(searches: pd.DataFrame, sea_snake: pd.DataFrame) -> Iterator[str]:
    """How much faster the free waveform is than the best sea-snake gait at no more power."""
    for star in sea_snake.to_dict("records"):
        rivals = searches[searches["tuned_to"] == star["tuned_to"]]
        for fastest in fastest_within(rivals, star["power"]).to_dict("records"):
            yield (
                f"{_where(star['tuned_to']).capitalize()}, at no more power than the best sea-snake gait"
                f" ({number(star['speed'])} m/s at {number(star['power'])} W), the free waveform swims"
                f" {number(fastest['speed'])} m/s at {number(fastest['power'])} W."
            )


def _over_seeds(searches: pd.DataFrame) -> Table:
    """The return that each search reached, at the finer rate."""
    known = searches[searches["objective"] == "return"].dropna(subset="return")
    return summary(
        "Return J of the best gait of every search for J, at the finer rate.",
        known,
        {"tuned_to": known["tuned_to"].unique(), "harmonics": sorted(known["harmonics"].unique())},
        [("n seeds", size), *over_seeds("return", "J of each seed")],
        head="fluid, harmonics",
        label="{}, {}".format,
    )


def _best_gaits(best: pd.DataFrame) -> Table:
    """The gait of the highest return in each fluid and in all, with each number of harmonics."""
    of_return = best[best["objective"] == "return"]
    rows = []
    in_order = [part.sort_values("harmonics") for _, part in of_return.groupby("tuned_to", sort=False)]
    for row in pd.concat(in_order).to_dict("records"):
        numbers = [with_difference(row[name], row[f"{name}_coarse"], "step") for name in ("return", "speed", *TAKEN)]
        searched = [number(row[f"{name}_searched"]) for name in ("return", "speed", "power")]
        name = f"{row['tuned_to']}, {row['harmonics']}{_mark(row)}"
        rows.append([name, *numbers, number(row["swim_frequency"]), *searched])
    head = ["J", "v [m/s]", *TAKEN.values(), "f [Hz]", "J searched", "v searched", "P searched"]
    return Table(
        "The best gait of all seeds for J. Δ is the difference between the two physics rates; the"
        " error that remains is at most about as large. f, which the gait imposes, hardly differs. † marks a run"
        " that had not settled. Beside them the figures of the search's engine.",
        ["fluid, harmonics", *head],
        rows,
    )


def _front(best: pd.DataFrame) -> Table:
    """Speed and power of the best gait of all seeds at each price, side by side for the numbers of harmonics."""
    priced = best[best["objective"] == "price"]
    told = priced.assign(told=[_at_price(row) for row in priced.to_dict("records")])
    by_harmonics = told.pivot(index=["tuned_to", "price"], columns="harmonics", values="told").reset_index()
    return summary(
        "The fronts: v [m/s] at P / P+ [W] of the best gait of all seeds at each price of power. Δ and † as above.",
        by_harmonics,
        {"tuned_to": priced["tuned_to"].unique(), "price": sorted(priced["price"].unique())},
        [(_harmonics({"harmonics": count}), first(count)) for count in sorted(priced["harmonics"].unique())],
        head="price of power",
        label="{}, {:g} / W".format,
    )


def _at_price(row: Mapping[Any, Any]) -> str:
    speed, power = (with_difference(row[name], row[f"{name}_coarse"], "step") for name in ("speed", "power"))
    return f"{speed} at {power} / {number(row['positive_power'])}{_mark(row)}"


def _agreement(optima: pd.DataFrame, swims: pd.DataFrame, manifest: Mapping[str, Any]) -> Table:
    """How far PyBullet is from its own limit and from the planar engine."""
    valid = swims[(swims[["status", "status_coarse", "status_searched"]] == "ok").all(axis=1)]
    price = {"price": 0.0}  # of those that no price is for
    which = [*_SEARCH, "fluid"]
    variants = optima.fillna(price).replace({"variant": {"searched": "planar"}})
    alike = variants.merge(valid[which].fillna(price), on=which)
    by = {"fluid": swims["fluid"].unique()}
    return step_and_engine(alike, by, _SEARCH, {"speed": "v", "power": "P"}, manifest, ", over all optima")


def _where(tuned_to: str) -> str:
    return "for all at once" if tuned_to == INTEGRATED else f"in {tuned_to}"


def _harmonics(row: Mapping[Any, Any]) -> str:
    return f"{row['harmonics']} harmonic{'s' if row['harmonics'] > 1 else ''}"


def _mark(row: Mapping[Any, Any]) -> str:
    return "" if row["steady"] else " †"
