"""The page of the cross study: gaits in fluids that are not their own."""

from itertools import chain
from typing import Any

import pandas as pd

from snakebench.collocation.front import under_first_bounds
from snakebench.names import ADAPTIVE, CURRENCIES, FINE, PAPER
from snakebench.report import matrix_figure, paper, table
from snakebench.report.accuracy import step_changes, step_table
from snakebench.report.table import CURRENCY_LABELS, LABELS, Table, name_of, size, summary
from snakebench.studies.limit_shares import shares
from snakebench.studies.published import Published
from snakebench.studies.published_fronts import limit_beside
from snakebench.studies.replays import COMPARED, replays

_SWIM = ["method", "seed", "fluid"]
_LOOPS = {"open": "replayed", "closed": "itself"}


def page(study: Published) -> dict[str, Any]:
    """What the page shows."""
    config, matrix = study.config, table.of_valid(study.tables["matrix"])
    fine = matrix[matrix["variant"] == FINE]
    order = list(fine["method"].unique())
    policies, fluids = [name for name in config["pilots"] if name in order], config["fluids"]
    replayed, itself, of_limit = replays(fine), feedback(fine), _of_limit(study, fine)
    by = {"method": order, "loop": _LOOPS.values()}
    places = {"fluid": fluids, "gait_of": fluids}
    every = {"method": order, "loop": _LOOPS.values(), "fluid": fluids, "gait_of": fine["gait_of"].unique()}
    changes = [(f"change of {LABELS[name].split()[0]} [%]", table.change(f"{name}_change")) for name in COMPARED]
    keys, figure = [*by, "seed", "gait_of", "fluid"], {"speed": "v", "cost_of_transport": "CoT"}
    return {
        "findings": {"replays": replayed, "feedback": itself, "of_limit": of_limit},
        "policies": policies,
        "n_seeds": fine[fine["method"].isin(policies)]["seed"].nunique(),
        "matrices": matrices(study),
        "lost": _lost_feedback(itself, order, fluids),
        "wrong": summary(replayed[~replayed["home"]], {"method": order} | places, [("n", size), *changes]),
        "swims": summary(fine.replace({"loop": _LOOPS}), every, [("n", size), "path_speed", *COMPARED]),
        "of_limit": _limit_table(of_limit, order, fluids),
        "rates": step_table(step_changes(matrix.replace({"loop": _LOOPS}), keys, figure), by),
        "unrecorded": itself[~itself["recorded"]].to_dict("records"),
        "swimmers": _swimmers(study, (policies or order)[0]),
        **table.validity(fine),
    }


def feedback(fine: pd.DataFrame) -> pd.DataFrame:
    """What belongs in a fluid, by method, seed and fluid, and whether its torque was `recorded`.

    For each figure, FIGURE_itself is of the swim, FIGURE_replayed of its replay, FIGURE_lost the relative change.
    """
    at_home = fine[(fine["gait_of"] == fine["fluid"]) | (fine["gait_of"] == ADAPTIVE)]
    itself, found = (at_home[at_home["loop"] == loop].set_index(_SWIM)[[*COMPARED]] for loop in ("closed", "open"))
    replayed = found.reindex(itself.index)
    parts = {"itself": itself, "replayed": replayed, "lost": replayed / itself - 1}
    both = pd.concat([part.add_suffix(f"_{label}") for label, part in parts.items()], axis=1)
    return both.assign(recorded=itself.index.isin(found.index)).reset_index()


def matrices(study: Published) -> str:
    """The heat maps of every method; those of the paper first where there are policies to compare with them."""
    matrix, fluids = table.of_valid(study.tables["matrix"]), study.config["fluids"]
    fine = matrix[matrix["variant"] == FINE]
    swims = fine.assign(method=fine["method"].map(name_of))
    if set(map(name_of, study.config["pilots"])) & set(swims["method"]):
        swims = pd.concat([paper.replays(fluids), swims])
    return matrix_figure.matrices(swims, fluids)


def _lost_feedback(itself: pd.DataFrame, order: list[str], fluids: list[str]) -> Table:
    pairs = [
        ((LABELS[name], table.mean(f"{name}_itself")), ("change by replay [%]", table.change(f"{name}_lost")))
        for name in COMPARED
    ]
    return summary(itself, {"method": order, "fluid": fluids}, [("n", size), *chain.from_iterable(pairs)])


def _of_limit(study: Published, fine: pd.DataFrame) -> pd.DataFrame:
    """Speeds as shares of the limit at each swim's own power, where it is known: columns currency, share [1].

    `own` marks what was recorded, where it belongs.
    """
    if not (limit := limit_beside(study)):
        return pd.DataFrame()
    known = under_first_bounds(limit.tables["limit"], limit.config)
    at_home = (fine["gait_of"] == fine["fluid"]) | (fine["gait_of"] == ADAPTIVE)
    swims = fine.assign(own=at_home & (fine["loop"] == "closed"), is_front=False, swim=range(len(fine)))
    reached = shares(known, swims).set_index(["currency", "swim"])["share"]
    both = [swims.assign(currency=currency) for currency in CURRENCIES]
    return pd.concat(both).join(reached, on=["currency", "swim"])  # without a share where the limit is not known


def _limit_table(reached: pd.DataFrame, order: list[str], fluids: list[str]) -> Table | None:
    if reached.empty:
        return None
    replayed = {f"{gait}'s gait [%]": table.at(table.share("share"), loop="open", gait_of=gait) for gait in fluids}
    labelled = reached.assign(currency=reached["currency"].map(CURRENCY_LABELS))
    by = {"currency": CURRENCY_LABELS.values(), "method": order, "fluid": fluids}
    return summary(labelled, by, [("itself [%]", table.at(table.share("share"), own=True)), *replayed.items()])


def _swimmers(study: Published, chosen: str) -> list[dict[str, Any]]:
    fluids = study.config["fluids"]
    labels = {f"{method}-{fluid}": f"{name_of(method)} in {fluid}" for method in (chosen, PAPER) for fluid in fluids}
    labels |= {f"replayed-{gait}-{at}": f"{gait}'s gait replayed in {at}" for gait in fluids for at in fluids}
    return study.swimmers(labels)
