"""What the cross-environment page shows: gaits in fluids that are not their own, to sentences, tables and figures."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import pandas as pd

from snakebench.report import paper
from snakebench.report.animation import swimmer
from snakebench.report.assumptions import assumptions_of_comparison
from snakebench.report.measurements import of, readable
from snakebench.report.method_names import name_of
from snakebench.report.summary import mean, percent, size, step_and_engine, summary
from snakebench.report.tables import Table, averaged, downloads, failures, number
from snakebench.store import ADAPTIVE, PAPER
from snakebench.studies.cross import figures
from snakebench.studies.cross.gait_swims import Swims, home, level, swims_of
from snakebench.tables import read_table
from snakebench.trajectory import Trajectory

_COLUMNS = {"speed": "speed v [m/s]", "cost_of_transport": "cost of transport"}
_SHOWN = _COLUMNS | {"positive_cost_of_transport": "cost of transport CoT+"}  # in tables
_PAPERS = "paper's policy"


def page(directory: Path, manifest: dict[str, Any]) -> dict[str, Any]:
    """Everything the cross-environment page shows."""
    config = manifest["config"]
    matrix = readable(read_table(directory / "matrix.csv"), "gait_of")
    fine = matrix[matrix["variant"] == "finer step"]
    order, fluids = list(dict.fromkeys(fine["method"])), config["fluids"]
    policies = [name for name in config["pilots"] if name in order]
    chosen = next(iter([*policies, *order]))
    every = {column: swims_of(fine, column) for column in _SHOWN}
    swims = {column: every[column] for column in _COLUMNS}
    shown = [column for column in _SHOWN if column in _COLUMNS or fine[column].notna().any()]
    return {
        "manifest": manifest,
        "config": config,
        "answers": list(_answers(swims, chosen, order)),
        "swimmers": list(_swimmers(directory, fluids, chosen)),
        "policies": policies,
        "matrices": matrices(matrix, fluids, beside_paper=bool(policies)),
        "diagonal": _diagonal(swims, order, beside_paper=bool(policies)),
        "split": [_split(every[column], order, fluids) for column in shown],
        "paper": _beside_paper(every, chosen) if policies else None,
        "matrix": [_matrix(every[column], loop, order, fluids) for loop in _LOOPS for column in shown],
        "rates": _rates(matrix, order, manifest),
        "unrecorded": _unrecorded(fine),
        "unsteady": int((~fine["steady"]).sum()),
        "n_swims": len(fine),
        "failed": failures(fine),
        "downloads": downloads(directory, "matrix", "contenders"),
        "assumptions": assumptions_of_comparison(config),
    }


_LOOPS = {"replayed": "Replayed open loop", "itself": "The gaits and policies themselves, in closed loop"}


def matrices(matrix: pd.DataFrame, fluids: Sequence[str], *, beside_paper: bool = True) -> str:
    """The heat maps of every method, the paper's first."""
    fine = matrix[matrix["variant"] == "finer step"]
    methods = [*([_PAPERS] if beside_paper else []), *map(name_of, dict.fromkeys(fine["method"]))]
    return figures.matrices(_means(fine, fluids), methods, fluids)


def _means(fine: pd.DataFrame, fluids: Sequence[str]) -> pd.DataFrame:
    """Means over the seeds, and the paper's, as the figure takes them."""
    keys = ["method", "loop", "gait_of", "fluid"]
    ours = fine.assign(method=fine["method"].map(name_of)).groupby(keys)[list(_COLUMNS)].mean().reset_index()
    rows = [
        {"method": _PAPERS, "loop": "open", "gait_of": gait, "fluid": fluid, **claim._asdict()}
        for fluid, claims in paper.CROSS.items()
        for gait, claim in claims.items()
        if {fluid, gait} <= set(fluids)
    ]
    return pd.concat([pd.DataFrame(rows, columns=ours.columns), ours], ignore_index=True) if rows else ours


def _answers(swims: Mapping[str, Swims], chosen: str, order: Sequence[str]) -> Iterator[str]:
    """The findings, a sentence each."""
    speed, cost = swims["speed"], swims["cost_of_transport"]
    n = level(of(speed.itself, method=chosen), "seed").nunique()
    seeds = f"mean of {n} seeds ± half its 95 % interval" if n > 1 else "one seed"
    if len(worst := of(speed.wrong(), method=chosen)):
        v, c = (percent(by_seed(of(values.wrong(), method=chosen)), 0) for values in (speed, cost))
        fluid, gait = worst.groupby(["fluid", "gait_of"]).mean().idxmin()
        least = percent(by_seed(of(worst, fluid=fluid, gait_of=gait)), 0)
        yield (
            f"The wrong gait: the {name_of(chosen)}'s torque of another fluid's gait, replayed, changes speed by {v} %"
            f" and cost of transport by {c} % against the replay of the fluid's own ({seeds}); most in {fluid} with"
            f" {gait}'s gait, {least} % in speed."
        )
    if len(lost := of(speed.lost(), method=chosen)):
        v, c = (percent(by_seed(of(values.lost(), method=chosen))) for values in (speed, cost))
        yield (
            f"The lost feedback: in its own fluid the replay changes speed by {v} % and cost of transport by {c} %"
            f" against the {name_of(chosen)} itself; speed by at most {number(100 * lost.abs().max())} %, of all"
            " seeds and fluids."
        )
    yield from _diagonal_answers(swims, chosen)
    for method in order:
        if method != chosen and len(changes := of(speed.wrong(), method=method)):
            costs = of(cost.wrong(), method=method)
            yield (
                f"Another fluid's gait of the {name_of(method)} changes speed by {_range(changes)} and cost of"
                f" transport by {_range(costs)}, both replayed."
            )


def _diagonal_answers(swims: Mapping[str, Swims], chosen: str) -> Iterator[str]:
    """In how many fluids the own gait is the best one."""
    won = {column: _wins(of(values.best(values.replayed), method=chosen)) for column, values in swims.items()}
    if len(won["speed"]):
        fast, cheap = (f"{part.sum()} of {len(part)}" for part in won.values())
        yield (
            f"The fluid's own gait is the fastest replay in {fast} and the cheapest in {cheap} fluids of all seeds"
            f" together; in the paper's table of its policy it is both in {len(paper.CROSS)} of {len(paper.CROSS)}."
        )


def by_seed(changes: pd.Series) -> pd.Series:
    """Means by seed."""
    return changes.groupby("seed").mean()


def _range(changes: pd.Series) -> str:
    known = 100 * changes.dropna()
    return f"{known.min():+.0f} to {known.max():+.0f} % (mean {known.mean():+.0f} %)" if len(known) else "–"


def _wins(best: pd.Series) -> pd.Series:
    return best == level(best, "fluid")


def _diagonal(swims: Mapping[str, Swims], order: Sequence[str], *, beside_paper: bool) -> Table:
    """In how many fluids the own gait is the fastest and the cheapest, and where it is not."""
    every = f"{len(paper.CROSS)} of {len(paper.CROSS)}"
    rows = [[_PAPERS + ", replayed", every, "", every, ""]] if beside_paper else []
    for method in order:
        for loop, what in (("replayed", "replayed"), ("itself", "itself")):
            best = [of(values.best(getattr(values, loop)), method=method) for values in swims.values()]
            if len(best[0]):
                rows.append(
                    [f"{name_of(method)}, {what}", *(cell for part in best for cell in (_won(part), _not(part)))]
                )
    return Table(
        "In how many fluids the gait of the fluid is the best of all that are of its method: of each seed, and where"
        " another one is better.",
        ["method", "fastest in", "but", "cheapest in", "but"],
        rows,
    )


def _won(best: pd.Series) -> str:
    won = _wins(best).groupby("seed")
    return f"{', '.join(map(str, won.sum()))} of {won.size().max()}" if len(best) else "–"


def _not(best: pd.Series) -> str:
    """Where a gait of another fluid is better, in how many seeds."""
    others = (
        best[~_wins(best)].reset_index(name="gait_of").groupby(["fluid", "gait_of"]).size().reset_index(name="seeds")
    )
    n = level(best, "seed").nunique()
    return "; ".join(
        f"{row['gait_of']}'s in {row['fluid']}" + (f" ({row['seeds']} of {n})" if n > 1 else "")
        for row in others.to_dict("records")
    )


def _capital(words: str) -> str:
    return words[0].upper() + words[1:]


def _split(swims: Swims, order: Sequence[str], fluids: Sequence[str]) -> Table:
    """What the lost feedback and what the wrong gait changes."""
    wrong = 100 * swims.wrong().unstack("gait_of").reindex(columns=list(fluids))
    known = {"itself": home(swims.itself), "replayed": home(swims.replayed), "lost": 100 * swims.lost()}
    table = pd.DataFrame(known).reindex(known["itself"].index).join(wrong).reset_index()
    columns = [
        ("n", size),
        ("itself", mean("itself")),
        ("replayed", mean("replayed")),
        ("lost feedback", mean("lost", 1)),
    ]
    columns += [(f"gait of {gait}", partial(_unless_own, gait)) for gait in fluids]
    return summary(
        f"{_capital(_SHOWN[swims.column])}: of what belongs in the fluid, swimming itself; of its replay"
        " in that fluid, and the change, which the lost feedback makes [%]; and the change from there to the replay of"
        " other fluids' gaits, which the wrong gait makes [%]. Mean over the seeds ± half its 95 % interval. A torque"
        " gait has no feedback to lose.",
        table,
        {"method": order, "fluid": fluids},
        columns,
    )


def _unless_own(gait: str, part: pd.DataFrame) -> str:
    return "own" if (part["fluid"] == gait).all() else averaged(part[gait], 1)


def _matrix(swims: Swims, loop: str, order: Sequence[str], fluids: Sequence[str]) -> Table:
    """One figure of every gait in every fluid."""
    values: pd.Series = getattr(swims, loop)
    by_gait = values.unstack("gait_of").reset_index()
    gaits = [name for name in (ADAPTIVE, *fluids) if name in by_gait]
    cells = [(name if name == ADAPTIVE else f"gait of {name}", mean(name)) for name in gaits]
    caption = f"{_LOOPS[loop]}: {_SHOWN[swims.column]} in each fluid, mean over the seeds ± half its 95 % interval."
    return summary(caption, by_gait, {"method": order, "fluid": fluids}, [("n", size), *cells])


def _beside_paper(swims: Mapping[str, Swims], chosen: str) -> Table:
    """The paper's matrix and that of the policy."""
    speed, cost, positive = (of(values.replayed, method=chosen) for values in swims.values())
    rows = []
    for fluid, claims in paper.CROSS.items():
        for gait, claim in claims.items():
            own, here = claims[fluid], {"fluid": fluid, "gait_of": gait}
            if len(v := of(speed, **here)) and len(v_own := of(speed, fluid=fluid, gait_of=fluid)):
                kept = averaged(v.droplevel("gait_of") / v_own.droplevel("gait_of"), 2)
                theirs = [f"{claim.speed:.2f}", f"{claim.speed / own.speed:.2f}", f"{claim.cost_of_transport:.2f}"]
                ours = [averaged(v), kept, *(averaged(of(values, **here)) for values in (cost, positive))]
                rows.append([f"in {fluid}, gait of {gait}", *theirs, *ours])
    return Table(
        f"The paper's matrix beside the {name_of(chosen)}'s: speed [m/s], the same as a share of the own gait's, and"
        " cost of transport, all replayed open loop. Trends compare, digits do not: the robot's diameter in its"
        " simulator is not known.",
        ["", "paper: v", "of own", "CoT", "ours: v", "of own", "CoT", "CoT+"],
        rows,
    )


def _rates(matrix: pd.DataFrame, order: Sequence[str], manifest: dict[str, Any]) -> Table:
    swims = matrix.replace({"loop": {"open": "replayed", "closed": "itself"}})
    by = {"method": order, "loop": ["replayed", "itself"]}
    same, figures = ["seed", "gait_of", "fluid"], {"speed": "v", "cost_of_transport": "CoT"}
    return step_and_engine(swims, by, same, figures, manifest, ", over all seeds, gaits and fluids")


def _unrecorded(fine: pd.DataFrame) -> list[str]:
    """The gaits that left no torque to replay, having no rhythm where they belong."""
    itself, replayed = (fine[fine["loop"] == loop] for loop in ("closed", "open"))
    at_home = itself[itself["gait_of"].isin([ADAPTIVE]) | (itself["gait_of"] == itself["fluid"])]
    keys = ["method", "seed"]
    there = set(replayed[[*keys, "gait_of"]].itertuples(index=False, name=None))
    return [
        f"{name_of(method)} (seed {seed}) in {fluid}"
        for method, seed, fluid in at_home[[*keys, "fluid"]].itertuples(index=False, name=None)
        if (method, seed, fluid) not in there
    ]


def _swimmers(directory: Path, fluids: Sequence[str], chosen: str) -> Iterator[dict[str, Any]]:
    """The runs that are there: what belongs in each fluid, and the policy's gait of one replayed in another."""
    runs = {f"{method}-{fluid}": f"{name_of(method)} in {fluid}" for method in (chosen, PAPER) for fluid in fluids}
    for gait in fluids:
        runs |= {f"replayed-{gait}-{fluid}": f"{gait}'s gait replayed in {fluid}" for fluid in fluids}
    for name, label in runs.items():
        if (path := directory / "trajectories" / f"{name}.npz").exists():
            yield swimmer(label, Trajectory.load(path))
