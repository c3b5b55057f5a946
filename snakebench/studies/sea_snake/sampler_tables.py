"""What the sea-snake page shows of the samplers: which finds the best gait, how soon, and how sure that is."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import pandas as pd
from scipy import stats

from snakebench.controllers import SeaSnake
from snakebench.report.summary import over_seeds, summary
from snakebench.report.tables import TAKEN, Table, confidence_interval, in_both_currencies, with_difference
from snakebench.studies.sea_snake import figures
from snakebench.value import FloatArray

_NAMES = {"tpe": "TPE", "random": "random", "cmaes": "CMA-ES", "gp": "GP"}
_SHARE = 0.99  # of the way from a random gait to the best one that counts as being there
_SHARE_SHOWN = f"{100 * _SHARE:.0f} %"
_LEVEL = 0.05  # of significance, over all differences together
_SEARCH = ["objective", "sampler"]


def comparison(tried: pd.DataFrame, winners: pd.DataFrame, config: Mapping[str, Any]) -> dict[str, Any]:
    """Answers, figure and tables from the tables `samplers` and `winners` of a study with this configuration."""
    per_gait = tried.sort_values("trial", kind="stable")
    best = per_gait.groupby([*_SEARCH, "seed"], sort=False)["value"].cummax()
    progress = per_gait.assign(best=best, gaits=per_gait["trial"] + 1)
    goals = _goals(tried, config["batch"])
    reached = _reached(progress, goals)
    differences = _differences(reached, config["compared"])
    answers = [_how_soon(reached, config), *([] if differences is None else [_how_sure(differences, config)])]
    return {
        "answers": answers,
        "figure": figures.samplers(progress, goals, _NAMES),
        "reached": _reached_table(reached, config["trials"]),
        "differences": None if differences is None else _differences_table(differences),
        "verified": _verified_table(in_both_currencies(winners)),
    }


def _goals(tried: pd.DataFrame, batch: int) -> pd.DataFrame:
    """By objective: the median value of the gaits that searches begin with, the best of all, and what counts as there.

    Searches begin with a batch drawn at random, so that the goal has a meaning whatever sign or size the values have.
    """
    by_objective = tried.groupby("objective", sort=False)["value"]
    start = tried[tried["trial"] < batch].groupby("objective", sort=False)["value"].median()
    goals = pd.DataFrame({"start": start, "best": by_objective.max()}).reindex(tried["objective"].unique())
    return goals.assign(goal=goals["start"] + _SHARE * (goals["best"] - goals["start"]))


def _reached(progress: pd.DataFrame, goals: pd.DataFrame) -> pd.DataFrame:
    """The best value of each search, and the number of gaits after which it was at the goal (infinite if never)."""
    there = progress[progress["best"] >= progress["objective"].map(goals["goal"])]
    search = [*_SEARCH, "seed"]
    final = progress.groupby(search, sort=False)["best"].max()
    soon = there.groupby(search, sort=False)["gaits"].min().reindex(final.index)
    return pd.DataFrame({"value": final, "gaits": soon.fillna(np.inf)}).reset_index()


def _reached_table(reached: pd.DataFrame, trials: int) -> Table:
    """What each sampler reached and after how many gaits, one row an objective and sampler."""
    known = ("n seeds", lambda part: str(part["value"].count()))
    spread = ("deviation", lambda part: "" if pd.isna(width := part["value"].std()) else f"{width:.2g}")
    return summary(
        f"Return J of the best gait of each search, and the gaits tried until J had come {_SHARE_SHOWN} of the"
        " way from the median gait of the first batches, which are drawn at random, to the best gait that any sampler"
        " found: the median over the seeds, and how many of them got there. Deviation is the seeds' standard deviation,"
        " the interval Student's t of their mean.",
        reached,
        {name: reached[name].unique() for name in _SEARCH},
        [
            *(known, *over_seeds("value", "J of each seed", "#.4g"), spread),
            (f"gaits until {_SHARE_SHOWN}", lambda part: _count(part["gaits"].median(), trials)),
            ("seeds there", lambda part: f"{np.isfinite(part['gaits']).sum()} of {len(part)}"),
        ],
        head="tuned to, by",
        label=lambda objective, sampler: f"{objective}, {_called(sampler)}",
    )


def _differences(reached: pd.DataFrame, compared: list[str]) -> pd.DataFrame | None:
    """Each sampler's value less that of the first sampler compared, seed by seed; None without two seeds."""
    first, *others = compared
    rows = []
    for objective, of_objective in reached.groupby("objective", sort=False):
        values = of_objective.pivot(index="seed", columns="sampler", values="value")
        for sampler in others:
            paired = (values[sampler] - values[first]).dropna().to_numpy()
            found = confidence_interval(paired)
            if found is not None:
                about = {"objective": objective, "sampler": sampler, "n": len(paired), "difference": paired.mean()}
                rows.append(about | {"low": found[0], "high": found[1], "p": _p(paired)})
    if not rows:
        return None
    table = pd.DataFrame(rows)
    return table.assign(first=first, holm=holm(table["p"].to_numpy()))


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
    rows = [
        [
            f"{row['objective']}, {_called(row['sampler'])} − {_called(row['first'])}",
            f"{row['n']}",
            *(f"{row['difference']:+.2g}", f"{row['low']:+.2g} to {row['high']:+.2g}"),
            *(f"{row['p']:.2g}", f"{row['holm']:.2g}"),
        ]
        for row in differences.to_dict("records")
    ]
    return Table(
        "Differences of J, seed by seed: with one seed all samplers begin with the same batch. Interval and p are of"
        " the paired t-test, each difference by itself; the last column holds for all of them together (Holm).",
        ["tuned to", "n seeds", "mean difference", "95 % interval", "p", "p, all together"],
        rows,
    )


def _verified_table(winners: pd.DataFrame) -> Table:
    """The best seed's gait of each objective and sampler as searched and as verified: means over its fluids."""
    rows = []
    for objective, sampler, of_both in _groups(winners):
        measured = ["return", "speed", *TAKEN]
        searched = of_both[of_both["variant"] == "searched"].groupby("seed")["return"].mean()
        seed = searched.idxmax()
        means = (
            of_both[of_both["seed"] == seed].groupby("variant")[[*measured, *SeaSnake.SPACE]].mean().to_dict("index")
        )
        coarse, fine = means["coarser step"], means["finer step"]
        rows.append(
            [
                f"{objective}, {_called(sampler)}",
                f"{seed}",
                *(f"{fine[name]:.3f}" for name in SeaSnake.SPACE),
                f"{searched.max():#.4g}",
                *(with_difference(fine[name], coarse[name], "step") for name in measured),
            ]
        )
    head = ["tuned to, by", "seed", "A [rad]", "f [Hz]", "ψ [rad]", "J as searched", "J", "v [m/s]", *TAKEN.values()]
    return Table(
        "The best seed's gait as searched, and verified as every result is; Δ is the difference between the two rates."
        " A gait tuned to the mean has the means over the fluids.",
        head,
        rows,
    )


def _how_soon(reached: pd.DataFrame, config: Mapping[str, Any]) -> str:
    """Which sampler was there first for each objective, beside the first one named, in one sentence."""
    medians = reached.groupby(_SEARCH, sort=False)["gaits"].median().unstack("sampler", sort=False)
    first, parts = config["compared"][0], []
    for objective, gaits in medians.iterrows():
        soonest = gaits.min()
        names = " and ".join(_called(name) for name in gaits.index[gaits == soonest])
        by = f"{names} after {soonest:g} gaits" if np.isfinite(soonest) else f"none in {config['trials']} gaits"
        behind = f" ({_called(first)} {_count(gaits[first], config['trials'])})" if gaits[first] != soonest else ""
        parts.append(f"for {_of(str(objective))} by {by}{behind}")
    n = len(config["seeds"])
    return (
        f"How soon: {_SHARE_SHOWN} of the way from a random gait to the best one was reached first {'; '.join(parts)}"
        + (f": the median of {n} seeds." if n > 1 else ".")
    )


def _how_sure(differences: pd.DataFrame, config: Mapping[str, Any]) -> str:
    """Which samplers end apart from the first by more than chance explains, in one sentence."""
    apart = differences[differences["holm"] < _LEVEL]
    found = ", ".join(
        f"{_called(row['sampler'])} for {_of(row['objective'])} ({row['difference']:+.2g}, p = {row['holm']:.2g})"
        for row in apart.to_dict("records")
    )
    first, after = _called(config["compared"][0]), f"How sure: after {config['trials']} gaits"
    test = f"paired t-tests over {differences['n'].min()} seeds, with Holm's correction for {len(differences)}"
    if not found:
        return f"{after} no sampler's J differs from {first}'s by more than chance explains ({test})."
    rest = len(differences) - len(apart)
    return (
        f"{after} J differs from {first}'s by more than chance explains with {found}; the other {rest} do not ({test})."
    )


def _of(objective: str) -> str:
    return "the mean" if objective == "mean" else objective


def _groups(table: pd.DataFrame) -> list[tuple[str, str, pd.DataFrame]]:
    """The rows of each objective and sampler, objectives together, both in the order of the table."""
    order = [(objective, sampler) for objective in table["objective"].unique() for sampler in table["sampler"].unique()]
    parts = dict(list(table.groupby(_SEARCH)))
    return [(*both, parts[both]) for both in order if both in parts]


def _count(gaits: float, trials: int) -> str:
    return f"{gaits:g}" if np.isfinite(gaits) else f"more than {trials}"


def _called(sampler: object) -> str:
    """What a sampler is called; one of a plug-in by its name."""
    return _NAMES.get(str(sampler), str(sampler))
