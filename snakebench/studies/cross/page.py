"""The page of the cross study: gaits in fluids that are not their own."""

from __future__ import annotations

from itertools import chain
from typing import Any

import pandas as pd

from snakebench.report import paper
from snakebench.report.accuracy import step_changes, step_table
from snakebench.report.animation import swimmer
from snakebench.report.method_names import name_of
from snakebench.report.table import COSTS, LABELS, Column, Table, change, failures, first, mean, of_valid, size, summary
from snakebench.store import PAPER
from snakebench.studies.cross import figures
from snakebench.studies.cross.changes import FIGURES, feedback, replays, without_replay
from snakebench.studies.published import Published

_PAPERS = "paper's policy"
_LOOPS = {"open": "replayed", "closed": "itself"}


def page(study: Published) -> dict[str, Any]:
    """What the page shows."""
    config, matrix = study.config, of_valid(study.tables["matrix"])
    fine = matrix[matrix["variant"] == "finer step"]
    order = list(fine["method"].unique())
    policies = [name for name in config["pilots"] if name in order]
    replayed, itself = replays(fine), feedback(fine)
    by = {"method": order, "loop": list(_LOOPS)}
    keys, figure = [*by, "seed", "gait_of", "fluid"], {"speed": "v", "cost_of_transport": "CoT"}
    return {
        "findings": {"replays": replayed, "feedback": itself},
        "policies": policies,
        "matrices": matrices(study),
        "best": _own_gait_is_best(replayed, order),
        "paper": _beside_paper(replayed, policies[0]) if policies else None,
        "lost": _lost_feedback(itself, order, config["fluids"]),
        "wrong": _wrong_gait(replayed, order, config["fluids"]),
        "swims": _swims(fine, order, config["fluids"]),
        "rates": step_table(step_changes(matrix, keys, figure, study.manifest), by),
        "unrecorded": without_replay(fine).to_dict("records"),
        "unsteady": int((~fine["steady"]).sum()),
        "n_swims": len(fine),
        "failed": failures(fine),
        "swimmers": _swimmers(study, (policies or order)[0]),
    }


def matrices(study: Published) -> str:
    """The heat maps of every method; those of the paper first where there are policies to compare with them."""
    matrix, fluids = of_valid(study.tables["matrix"]), study.config["fluids"]
    fine = matrix[matrix["variant"] == "finer step"]
    fine = fine.assign(method=fine["method"].map(name_of))
    means = fine.groupby(["method", "loop", "gait_of", "fluid"], sort=False)[["speed", "cost_of_transport"]].mean()
    methods, parts = list(fine["method"].unique()), [means.reset_index()]
    if set(map(name_of, study.config["pilots"])) & set(methods):
        methods.insert(0, _PAPERS)
        theirs = _papers()
        parts.insert(0, theirs[theirs["fluid"].isin(fluids) & theirs["gait_of"].isin(fluids)])
    return figures.matrices(pd.concat(parts, ignore_index=True), methods, fluids)


def _papers() -> pd.DataFrame:
    """The paper's matrix: a row for each fluid and gait_of."""
    return pd.DataFrame(
        {"method": _PAPERS, "loop": "open", "gait_of": gait, "fluid": fluid} | claim._asdict()
        for fluid, claims in paper.CROSS.items()
        for gait, claim in claims.items()
    )


def _own_gait_is_best(replayed: pd.DataFrame, order: list[str]) -> Table:
    """In how many fluids, of all seeds, no other gait of the method is better than the fluid's own."""
    own = replayed[replayed["home"]]
    columns = [
        (head, lambda part, name=name: f"{part[name].sum():.0f} of {part[name].count()}")
        for head, name in (("fastest", "speed_best"), ("cheapest by CoT", "cost_of_transport_best"))
    ]
    return summary(own[own["speed_best"].notna()], {"method": order}, columns)


def _beside_paper(replayed: pd.DataFrame, policy: str) -> Table:
    """The paper's matrix and that of the policy."""
    own, papers = replayed[replayed["method"] == policy].assign(share=1 + replayed["speed_change"]), _papers()
    at_home = papers[papers["fluid"] == papers["gait_of"]].set_index("fluid")["speed"]
    papers["share"] = papers["speed"] / papers["fluid"].map(at_home)
    heads = {"speed_paper": "paper: v [m/s]", "share_paper": "of own", "cost_of_transport_paper": "CoT"}
    theirs = [(head, first(name, ".2f")) for name, head in heads.items()]
    ours: list[Column] = [("ours: v [m/s]", mean("speed")), ("of own", mean("share", 2)), *COSTS]
    return summary(
        own.merge(papers, on=["fluid", "gait_of"], suffixes=("", "_paper")), ["fluid", "gait_of"], [*theirs, *ours]
    )


def _lost_feedback(itself: pd.DataFrame, order: list[str], fluids: list[str]) -> Table:
    """Swims of what belongs in the fluid, and the change of its replay there."""
    pairs = [
        ((LABELS[name], mean(f"{name}_itself")), ("change by replay [%]", change(f"{name}_lost"))) for name in FIGURES
    ]
    return summary(itself, {"method": order, "fluid": fluids}, [("n", size), *chain.from_iterable(pairs)])


def _wrong_gait(replayed: pd.DataFrame, order: list[str], fluids: list[str]) -> Table:
    """Replays of other fluids' gaits: their change against the replay of the fluid's own."""
    changes = [(f"change of {LABELS[name].split()[0]} [%]", change(f"{name}_change")) for name in FIGURES]
    by = {"method": order, "fluid": fluids, "gait_of": fluids}
    return summary(replayed[~replayed["home"]], by, [("n", size), *changes])


def _swims(fine: pd.DataFrame, order: list[str], fluids: list[str]) -> Table:
    by: dict[str, Any] = {"method": order, "loop": list(_LOOPS), "fluid": fluids, "gait_of": fine["gait_of"].unique()}

    def label(method: str, loop: str, fluid: str, gait: str) -> str:
        return f"{name_of(method)} {_LOOPS[loop]}, in {fluid}, {gait if gait not in fluids else f'gait of {gait}'}"

    return summary(fine, by, [("n", size), *FIGURES], head="method, fluid, gait", label=label)


def _swimmers(study: Published, chosen: str) -> list[dict[str, Any]]:
    """What belongs in each fluid, and the policy's gait of one replayed in another."""
    fluids = study.config["fluids"]
    labels = {f"{method}-{fluid}": f"{name_of(method)} in {fluid}" for method in (chosen, PAPER) for fluid in fluids}
    labels |= {f"replayed-{gait}-{at}": f"{gait}'s gait replayed in {at}" for gait in fluids for at in fluids}
    return [swimmer(label, swim) for name, label in labels.items() if (swim := study.swim(name))]
