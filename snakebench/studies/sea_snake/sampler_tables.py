"""The sea-snake page's comparison of samplers: which finds the best gait, after how many gaits, and how surely."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd
from scipy import stats

from snakebench.controllers import SeaSnake
from snakebench.report.table import LABELS, MEASURED, Table, by_variant, confidence_interval, first, over_seeds, summary
from snakebench.studies.published import Published
from snakebench.studies.sea_snake import figures
from snakebench.value import FloatArray

_NAMES = {"tpe": "TPE", "cmaes": "CMA-ES", "gp": "GP"}
_SHARE = 0.99  # of the way from a random gait to the best one, at which a search has reached its goal
_SEARCH = ["objective", "sampler"]
_VERIFIED = ("return", *MEASURED)


def comparison(study: Published) -> dict[str, Any]:
    """Figure and tables of the samplers."""
    tried, config = study.tables["samplers"], study.config
    per_gait = tried.sort_values("trial", kind="stable")
    best = per_gait.groupby([*_SEARCH, "seed"], sort=False)["value"].cummax()
    progress = per_gait.assign(best=best, gaits=per_gait["trial"] + 1)
    goals = _goals(tried, config["batch"])
    reached = _reached(progress, goals)
    differences = _differences(reached, config["compared"])
    return {
        "findings": {"reached": reached, "differences": differences},
        "figure": figures.samplers(progress, goals, _NAMES),
        "reached": _reached_table(reached, config["trials"]),
        "differences": _differences_table(differences) if len(differences) else None,
        "verified": _verified_table(study.tables["winners"]),
    }


def _goals(tried: pd.DataFrame, batch: int) -> pd.DataFrame:
    """By objective: the median value of the gaits that searches begin with, the best of all, and the goal.

    Searches begin with a batch drawn at random, so that the goal has a meaning whatever sign or size the values have.
    """
    by_objective = tried.groupby("objective", sort=False)["value"]
    start = tried[tried["trial"] < batch].groupby("objective", sort=False)["value"].median()
    goals = pd.DataFrame({"start": start, "best": by_objective.max()}).reindex(tried["objective"].unique())
    return goals.assign(goal=goals["start"] + _SHARE * (goals["best"] - goals["start"]))


def _reached(progress: pd.DataFrame, goals: pd.DataFrame) -> pd.DataFrame:
    """The best value of each search, and the number of gaits after which it was at the goal (infinite if never)."""
    there = progress["best"] >= progress["objective"].map(goals["goal"])
    searches = progress.assign(gaits=progress["gaits"].where(there, np.inf)).groupby([*_SEARCH, "seed"], sort=False)
    return searches.agg(value=("best", "max"), gaits=("gaits", "min")).reset_index()


def _reached_table(reached: pd.DataFrame, trials: int) -> Table:
    """The best value of each search of a sampler, and after how many gaits its goal was reached."""

    def gaits(part: pd.DataFrame) -> str:
        median = part["gaits"].median()
        return f"{median:g}" if np.isfinite(median) else f"more than {trials}"

    return summary(
        reached,
        _SEARCH,
        [
            ("n seeds", lambda part: str(part["value"].count())),
            *over_seeds("value", "J of each seed", "#.4g"),
            (f"gaits until {100 * _SHARE:.0f} %", gaits),
            ("seeds there", lambda part: f"{np.isfinite(part['gaits']).sum()} of {len(part)}"),
        ],
        head="tuned to, sampler",
        label=_label,
    )


def _differences(reached: pd.DataFrame, compared: list[str]) -> pd.DataFrame:
    """Each sampler's value less that of the first sampler compared, seed by seed; no rows without two seeds."""
    head, *others = compared
    rows = []
    for objective, of_objective in reached.groupby("objective", sort=False):
        values = of_objective.pivot(index="seed", columns="sampler", values="value")
        for sampler in others:
            paired = (values[sampler] - values[head]).dropna().to_numpy()
            if interval := confidence_interval(paired):
                row = {"objective": objective, "sampler": sampler, "first": head, "n": len(paired)}
                row |= {"difference": paired.mean(), "low": interval[0], "high": interval[1]}
                rows.append(row | {"p": _p(paired)})
    table = pd.DataFrame(rows)
    return table.assign(holm=holm(table["p"].to_numpy())) if rows else table


def _p(paired: FloatArray) -> float:
    """Of the paired t-test; 1 where all pairs are equal, 0 where they differ by the same."""
    if np.ptp(paired) == 0:
        return float(paired[0] == 0)
    return float(stats.ttest_1samp(paired, 0.0).pvalue)


def holm(p: FloatArray) -> FloatArray:
    """The p-values of several tests, shape (n,), raised so that a chance find among all of them is as rare as one."""
    order = np.argsort(p)
    raised = np.maximum.accumulate(p[order] * np.arange(len(p), 0, -1))
    result = np.empty(len(p))
    result[order] = np.minimum(raised, 1.0)
    return result


def _differences_table(differences: pd.DataFrame) -> Table:
    head = differences["first"].iloc[0]
    return summary(
        differences,
        _SEARCH,
        [
            ("n seeds", first("n")),
            ("mean difference", first("difference", "+.2g")),
            ("95 % interval", lambda part: f"{part['low'].iloc[0]:+.2g} to {part['high'].iloc[0]:+.2g}"),
            ("p", first("p", ".2g")),
            ("p, all together", first("holm", ".2g")),
        ],
        head="tuned to, sampler",
        label=lambda objective, sampler: f"{_label(objective, sampler)} − {_NAMES.get(head, head)}",
    )


def _verified_table(winners: pd.DataFrame) -> Table:
    """The best seed's gait of each objective and sampler as searched and as verified: means over its fluids."""
    searches = winners.set_index([*_SEARCH, "seed"])
    values = searches[searches["variant"] == "searched"].groupby(level=[0, 1, 2], sort=False)["return"].mean()
    best = values.groupby(level=[0, 1], sort=False).idxmax()
    return summary(
        searches.join(values.rename("value"))[searches.index.isin(best)].reset_index(),
        {name: winners[name].unique() for name in _SEARCH},
        [
            *(("seed", first("seed")), *((LABELS[name], first(name, ".3f")) for name in SeaSnake.SPACE)),
            *(("J as searched", first("value", "#.4g")), *((LABELS[name], by_variant(name)) for name in _VERIFIED)),
        ],
        head="tuned to, sampler",
        label=_label,
    )


def _label(objective: str, sampler: str) -> str:
    return f"{objective}, {_NAMES.get(sampler, sampler)}"
