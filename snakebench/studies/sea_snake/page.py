"""The page of the sea-snake study: tables and figures of its searches and of the best gaits."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import pandas as pd

from snakebench.controllers import SeaSnake
from snakebench.report.animation import swimmer
from snakebench.report.table import (
    LABELS,
    MEASURED,
    Cell,
    Table,
    by_variant,
    digits3,
    failures,
    first,
    number,
    over_seeds,
    size,
    summary,
)
from snakebench.studies.published import Published
from snakebench.studies.sea_snake import figures
from snakebench.studies.sea_snake.sampler_tables import comparison

_SHOWN = ("return", *MEASURED)
_SHAPES = ("swim_frequency", "tail_amplitude", "joint_amplitude")


def page(study: Published) -> dict[str, Any]:
    """What the page shows."""
    trials, optima, config = study.tables["trials"], study.tables["optima"], study.config
    pairs = list(dict.fromkeys(zip(optima["objective"], optima["fluid"], strict=True)))
    swims = {pair: swim for pair in pairs if (swim := study.swim("-".join(pair)))}
    own_swims = {fluid: swim for (objective, fluid), swim in swims.items() if objective == fluid}
    best = best_of_seeds(optima)
    own = best[best["objective"] == best["fluid"]]
    compared = comparison(study) if len(study.tables["samplers"]) else None
    return {
        "findings": {"best": best[best["variant"] == "finer step"]} | (compared["findings"] if compared else {}),
        "best": _best_gaits(own, config["space"]),
        "shared": _one_gait_for_all(best) if "mean" in set(optima["objective"]) else None,
        "variants": _variants(own),
        "seeds": _returns(optima),
        "compared": compared,
        "failed": failures(trials),
        "convergence": figures.convergence(trials),
        "search_space": figures.search_space(trials, config["space"]),
        "time_series": figures.time_series(own_swims),
        "spectra": figures.spectra(own_swims),
        "swimmers": [
            swimmer(f"{'own' if objective == fluid else 'shared'} gait in {fluid}", swim)
            for (objective, fluid), swim in swims.items()
        ],
    }


def best_of_seeds(optima: pd.DataFrame) -> pd.DataFrame:
    """The rows of each objective's best seed, judged by the mean return over its fluids as searched."""
    best = set(_values(optima).groupby("objective", sort=False).idxmax())
    return optima[[pair in best for pair in zip(optima["objective"], optima["seed"], strict=True)]]


def _values(optima: pd.DataFrame) -> pd.Series:
    """The objective's value of every optimum, by objective and seed: the mean return over its fluids as searched."""
    searched = optima[optima["variant"] == "searched"]
    return searched.groupby(["objective", "seed"], sort=False)["return"].mean()


def _best_gaits(own: pd.DataFrame, space: Mapping[str, tuple[float, float]]) -> Table:
    """Each fluid's own best gait with the finer step, and the difference to the coarser one."""
    parameters = [(LABELS[name], _marked_at_edge(name, *space[name])) for name in SeaSnake.SPACE]
    return summary(
        own[own["variant"].isin(["finer step", "coarser step"])].sort_values("variant", ascending=False, kind="stable"),
        {"fluid": own["fluid"].unique()},
        [
            *parameters,
            *((LABELS[name], by_variant(name)) for name in _SHOWN),
            *((LABELS[name], first(name, ".3g")) for name in _SHAPES),
            ("steady", lambda part: "yes" if part["steady"].iloc[0] else "no"),
        ],
        head="tuned to",
    )


def _marked_at_edge(name: str, low: float, high: float) -> Cell:
    """A parameter, with * at the edge of the search space."""

    def cell(part: pd.DataFrame) -> str:
        value = part[name].iloc[0]
        return number(value) + ("*" if min(value - low, high - value) < 0.02 * (high - low) else "")

    return cell


def _one_gait_for_all(best: pd.DataFrame) -> Table:
    """The gait tuned to the mean over the fluids beside each fluid's own gait, with the finer step."""
    fine = best[best["variant"] == "finer step"]
    return summary(
        fine,
        {"fluid": fine["fluid"].unique(), "objective": fine["objective"].unique()},
        [(LABELS[name], digits3(name)) for name in _SHOWN],
        label=lambda fluid, objective: f"{fluid}, tuned to {'all fluids' if objective == 'mean' else fluid}",
        head="fluid, gait",
    )


def _variants(own: pd.DataFrame) -> Table:
    """Each fluid's own best gait as searched, if not with a step of `_best_gaits`, and on a neutrally buoyant robot."""
    swims = own.drop_duplicates(["fluid", "engine", "physics_rate", "diameter"], keep="last")
    columns = [("engine", first("engine")), ("rate [Hz]", first("physics_rate")), ("diameter [m]", digits3("diameter"))]
    columns += [(LABELS[name], digits3(name)) for name in _SHOWN]
    return summary(swims[~swims["variant"].isin(["finer step", "coarser step"])], ["fluid", "variant"], columns)


def _returns(optima: pd.DataFrame) -> Table:
    deviation = ("standard deviation", lambda part: f"{part['return'].std():.2f}" if len(part) > 1 else "")
    columns = [("n seeds", size), *over_seeds("return", "J of each seed"), deviation]
    return summary(_values(optima).reset_index(), ["objective"], columns)
