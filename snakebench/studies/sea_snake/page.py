"""The page of the sea-snake study: tables and figures of its searches and of the best gaits, samplers compared."""

from collections.abc import Mapping
from typing import Any

import numpy as np
import pandas as pd
from scipy import stats

from snakebench.controllers import SeaSnake
from snakebench.names import COARSE, FINE
from snakebench.report import table
from snakebench.report.intervals import confidence_interval
from snakebench.report.table import MEASURED, Cell, Column, Table, by_variant, digits3, first, summary, under_labels
from snakebench.studies.published import Published, best_of_seeds, values_of_searches
from snakebench.studies.sea_snake import figures
from snakebench.value import FloatArray

_SHOWN = ("return", *MEASURED)
_SHAPES = ("tail_amplitude", "joint_amplitude")
_STEPS = [FINE, COARSE]
_NAMES = {"tpe": "TPE", "cmaes": "CMA-ES", "gp": "GP"}
_SHARE = 0.99  # of the way from a random gait to the best one, at which a search has reached its goal
_SEARCH = ["objective", "sampler"]


def page(study: Published) -> dict[str, Any]:
    """What the page shows."""
    trials, optima, config = study.tables["trials"], study.tables["optima"], study.config
    pairs = list(dict.fromkeys(zip(optima["objective"], optima["fluid"], strict=True)))
    swims = {pair: swim for pair in pairs if (swim := study.swim("-".join(pair)))}
    own_swims = {fluid: swim for (objective, fluid), swim in swims.items() if objective == fluid}
    best = best_of_seeds(optima)
    own = best[best["objective"] == best["fluid"]]
    deviation = ("standard deviation", lambda part: f"{part['return'].std():.2f}" if len(part) > 1 else "")
    seeds = [("n seeds", table.size), *table.over_seeds("return", "J of each seed"), deviation]
    compared = comparison(study) if len(study.tables["samplers"]) else None
    return {
        "findings": {"best": best[best["variant"] == FINE]} | (compared["findings"] if compared else {}),
        "best": _best_gaits(own, config["space"]),
        "shared": _one_gait_for_all(best) if "mean" in set(optima["objective"]) else None,
        "variants": _variants(own),
        "seeds": summary(values_of_searches(optima).reset_index(), ["objective"], seeds),
        "compared": compared,
        "failed": table.failures(trials),
        "convergence": figures.convergence(trials),
        "search_space": figures.search_space(trials, config["space"]),
        "time_series": figures.time_series(own_swims),
        "spectra": figures.spectra(own_swims),
        "swimmers": study.swimmers(
            {"-".join(pair): f"{'own' if pair[0] == pair[1] else 'shared'} gait in {pair[1]}" for pair in pairs}
        ),
    }


def _best_gaits(own: pd.DataFrame, space: Mapping[str, tuple[float, float]]) -> Table:
    """Each fluid's own best gait with the finer step, and the difference to the coarser one."""

    def marked_at_edge(name: str) -> Cell:
        low, high = space[name]

        def cell(part: pd.DataFrame) -> str:
            value = part[name].iloc[0]
            return table.number(value) + ("*" if min(value - low, high - value) < 0.02 * (high - low) else "")

        return cell

    columns = under_labels(marked_at_edge, SeaSnake.SPACE) + under_labels(by_variant, _SHOWN)
    columns += under_labels(first, _SHAPES, ".3g")
    columns += [("steady", lambda part: "yes" if part["steady"].iloc[0] else "no")]
    verified = own[own["variant"].isin(_STEPS)].sort_values("variant", ascending=False, kind="stable")
    return summary(verified, {"fluid": own["fluid"].unique()}, columns, head="tuned to")


def _one_gait_for_all(best: pd.DataFrame) -> Table:
    """The gait tuned to the mean over the fluids beside each fluid's own gait, with the finer step."""
    fine = best[best["variant"] == FINE]

    def label(fluid: str, objective: str) -> str:
        return f"{fluid}, tuned to {'all fluids' if objective == 'mean' else fluid}"

    return summary(fine, ["fluid", "objective"], under_labels(digits3, _SHOWN), label=label, head="fluid, gait")


def _variants(own: pd.DataFrame) -> Table:
    """Each fluid's own best gait as searched, if not with a step of `_best_gaits`, and on a neutrally buoyant robot."""
    swims = own.drop_duplicates(["fluid", "engine", "physics_rate", "diameter"], keep="last")
    columns = [("engine", first("engine")), ("rate [Hz]", first("physics_rate")), ("diameter [m]", digits3("diameter"))]
    columns += under_labels(digits3, _SHOWN)
    return summary(swims[~swims["variant"].isin(_STEPS)], ["fluid", "variant"], columns)


def comparison(study: Published) -> dict[str, Any]:
    """Which sampler finds the best gait, after how many gaits, and how surely: figure and tables."""
    tried, config = study.tables["samplers"], study.config
    progress, goals = tried.sort_values("trial", kind="stable"), _goals(tried, config["batch"])
    best = progress.groupby([*_SEARCH, "seed"], sort=False)["value"].cummax()
    progress = progress.assign(best=best, gaits=progress["trial"] + 1)
    reached = _reached(progress, goals)
    differences = _differences(reached, config["compared"])
    return {
        "findings": {"reached": reached, "differences": differences},
        "figure": figures.samplers(progress, goals, _NAMES),
        "reached": _reached_table(reached, config["trials"]),
        "differences": _differences_table(differences, config["compared"][0]) if len(differences) else None,
        "verified": _verified_table(study.tables["winners"]),
    }


def _goals(tried: pd.DataFrame, batch: int) -> pd.DataFrame:
    """By objective: the median of the first batches, which are random, the best of all, and the goal in between."""
    best = tried.groupby("objective", sort=False)["value"].max()
    start = tried[tried["trial"] < batch].groupby("objective")["value"].median()
    return pd.DataFrame({"best": best, "start": start, "goal": start + _SHARE * (best - start)}).loc[best.index]


def _reached(progress: pd.DataFrame, goals: pd.DataFrame) -> pd.DataFrame:
    """The best value of each search, and the number of gaits after which it was at the goal (infinite if never)."""
    there = progress["best"] >= progress["objective"].map(goals["goal"])
    searches = progress.assign(gaits=progress["gaits"].where(there, np.inf)).groupby([*_SEARCH, "seed"], sort=False)
    return searches.agg(value=("best", "max"), gaits=("gaits", "min")).reset_index()


def _reached_table(reached: pd.DataFrame, trials: int) -> Table:
    def gaits(part: pd.DataFrame) -> str:
        median = part["gaits"].median()
        return f"{median:g}" if np.isfinite(median) else f"more than {trials}"

    columns: list[Column] = [("n seeds", lambda part: str(part["value"].count()))]
    columns += [*table.over_seeds("value", "J of each seed", "#.4g"), (f"gaits until {100 * _SHARE:.0f} %", gaits)]
    columns += [("seeds there", lambda part: f"{np.isfinite(part['gaits']).sum()} of {len(part)}")]
    return summary(reached, _SEARCH, columns, head="tuned to, sampler", label=_label)


def _differences(reached: pd.DataFrame, compared: list[str]) -> pd.DataFrame:
    """Each sampler's value less that of the first sampler compared, seed by seed; no rows without two seeds."""
    head, *others = compared
    rows = []
    for objective, of_objective in reached.groupby("objective", sort=False):
        values = of_objective.pivot(index="seed", columns="sampler", values="value")
        for sampler in others:
            paired = (values[sampler] - values[head]).dropna().to_numpy()
            if interval := confidence_interval(paired):
                # Of the paired t-test; 1 where all pairs are equal, 0 where they differ by the same.
                p = stats.ttest_1samp(paired, 0.0).pvalue if np.ptp(paired) else float(paired[0] == 0)
                row = {"objective": objective, "sampler": sampler, "n": len(paired), "difference": paired.mean()}
                rows.append(row | {"low": interval[0], "high": interval[1], "p": p})
    differences = pd.DataFrame(rows)
    return differences.assign(holm=holm(differences["p"].to_numpy())) if rows else differences


def holm(p: FloatArray) -> FloatArray:
    """The p-values of several tests, shape (n,), raised so that a chance find among all of them is as rare as one."""
    order = np.argsort(p)
    raised = np.maximum.accumulate(p[order] * np.arange(len(p), 0, -1))
    return np.minimum(raised, 1.0)[np.argsort(order)]


def _differences_table(differences: pd.DataFrame, head: str) -> Table:
    columns: list[Column] = [("n seeds", first("n")), ("mean difference", first("difference", "+.2g"))]
    columns += [("95 % interval", lambda part: f"{part['low'].iloc[0]:+.2g} to {part['high'].iloc[0]:+.2g}")]
    columns += [("p", first("p", ".2g")), ("p, all together", first("holm", ".2g"))]

    def label(objective: str, sampler: str) -> str:
        return f"{_label(objective, sampler)} − {_NAMES.get(head, head)}"

    return summary(differences, _SEARCH, columns, head="tuned to, sampler", label=label)


def _verified_table(winners: pd.DataFrame) -> Table:
    """The best seed's gait of each objective and sampler as searched and as verified: means over its fluids."""
    searches = winners.set_index([*_SEARCH, "seed"])
    values = searches[searches["variant"] == "searched"].groupby(level=[0, 1, 2], sort=False)["return"].mean()
    best = values.groupby(level=[0, 1], sort=False).idxmax()
    found = searches.join(values.rename("value"))[searches.index.isin(best)].reset_index()
    columns: list[Column] = [("seed", first("seed")), *under_labels(first, SeaSnake.SPACE, ".3f")]
    columns += [("J as searched", first("value", "#.4g")), *under_labels(by_variant, _SHOWN)]
    by = {name: winners[name].unique() for name in _SEARCH}
    return summary(found, by, columns, head="tuned to, sampler", label=_label)


def _label(objective: str, sampler: str) -> str:
    return f"{objective}, {_NAMES.get(sampler, sampler)}"
