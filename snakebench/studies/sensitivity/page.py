"""The page of the sensitivity study: other steps, another engine and other robots."""

from typing import Any

import numpy as np
import pandas as pd

from snakebench.names import ADAPTIVE, COARSE, EXTENDED, FINE, INTEGRATED, PAPER
from snakebench.report import table
from snakebench.report.accuracy import step_changes, step_table
from snakebench.report.equal_power import speeds_within
from snakebench.report.table import COSTS, LABELS, MEASURED, Column, Table, change, mean, name_of, size, summary
from snakebench.studies.front_tables import speeds_at_powers
from snakebench.studies.published import Published
from snakebench.studies.sensitivity import figures

_SWIM = ["method", "seed", "fluid"]
_CHANGED = {"speed": "v", "power": "P"}
_CONCLUSIONS = {  # by id, in the order of the table
    f"faster-than-{PAPER}": "faster than the sinusoids' front of each fluid",
    f"faster-than-{PAPER}-for-all": "faster than one sinusoid for all fluids, by means over them",
    f"faster-than-{EXTENDED}": "faster than the wider sinusoids' front of each fluid",
    f"faster-than-{EXTENDED}-for-all": "faster than one wider sinusoid for all fluids, by means over them",
    "frequency-falls": "frequency falls from the first fluid to the last, as the paper's does",
    "tail-grows": "tail amplitude grows, as the paper's does",
    "keeps-its-teachers-speed": "at least 95 % as fast as its teacher",
}
_TRENDS = {"frequency-falls": ("swim_frequency", -1), "tail-grows": ("tail_amplitude", 1)}
_KEPT = 0.95  # of the teacher's speed


def page(study: Published) -> dict[str, Any]:
    """What the page shows; policies learned anew are those of the study beside it, if it is there."""
    config, fronts = study.config, study.tables["fronts"]
    swims, original = table.of_valid(study.tables["swims"]), _robot(config)
    swims = swims.assign(variant=_variants(swims, config["verify_rate"]))
    own = swims[(swims["tuned_to"] == ADAPTIVE) | (swims["tuned_to"] == swims["fluid"])]  # where they belong
    here, published = own[own["robot"] == original], own[own["variant"] == FINE]
    anew, policies = _learned_anew(study, own), published[published["tuned_to"] == ADAPTIVE]
    places = [
        here[here["tuned_to"] == ADAPTIVE].assign(place=here["variant"]),
        policies[policies["robot"] != original].assign(place=policies["robot"].map(name_of) + " robot, same policies"),
        anew.assign(place=anew["how"] + ", retrained"),
    ]
    found = margins(pd.concat(places, ignore_index=True), fronts, config["fluids"], config["pilots"])
    steps = step_changes(here, _SWIM, _CHANGED)
    worth, zero_shot = _against_original(study.tables["indicators"], original), _zero_shot(published, original)
    names = [name for name in (*config["fluids"], INTEGRATED) if name in set(fronts["front"])]
    return {
        "findings": {"margins": found, "zero_shot": zero_shot, "worth": worth},
        "original": original,
        "margins": margin_table(found),
        "steps": step_table(steps, {"method": here["method"].unique(), "fluid": config["fluids"]}),
        "robots": _robot_table(zero_shot, config),
        "fronts": figures.fronts(fronts, names, list(config["robots"]), policies),
        "equal_power": _front_table(worth, config),
        "anew": _anew_table(anew, own, original),
        **table.validity(own),
    }


def _robot(config: dict[str, Any], **changes: Any) -> str:
    """The name of the study's robot, or of one with some changes; of the first one if none is like this."""
    robot, bodies = config["robot"] | changes, config["robots"]
    shape = {"joints": len(robot["lengths"]) - 1, "diameter": robot["diameter"]}
    return next((name for name, body in bodies.items() if body == shape), next(iter(bodies)))


def _variants(swims: pd.DataFrame, rate: int) -> pd.Series:
    """The published rate as "finer step", its half as "coarser step", the planar engine, and other rates by name."""
    names = swims["physics_rate"].map({rate: FINE, rate // 2: COARSE})
    names = names.fillna(swims["physics_rate"].astype(str) + " Hz")
    return names.where(swims["engine"] == "pybullet", swims["engine"])


def _learned_anew(study: Published, own: pd.DataFrame) -> pd.DataFrame:
    """The policies of the study `relearned` of the same profile, how each learned, and its robot; none without it."""
    other = study.beside("relearned")
    if other is None:
        return own.iloc[:0].assign(policy="", how="")
    evaluations = table.of_valid(other.tables["evaluations"])
    fine = evaluations[evaluations["variant"] == FINE]
    parts = fine["policy"].str.extract("(?P<method>[^_]*)_?(?P<how>.*)")
    policies = other.config["policies"].items()
    robots = {name: _robot(study.config, **policy.get("robot", {})) for name, policy in policies}
    how = parts["how"].str.replace("Hz", " Hz")
    return fine.assign(method=parts["method"], how=how, robot=fine["policy"].map(robots))


def margins(swims: pd.DataFrame, fronts: pd.DataFrame, fluids: list[str], pilots: list[str]) -> pd.DataFrame:
    """By what share each conclusion about the first of the pilots holds, at each place of its swims.

    Fronts are of the swims' robots; fluids are in the order of their viscosity; the second pilot is the teacher.
    """
    own = swims[swims["method"] == pilots[0]]
    by_seed = own.groupby(["place", "robot", "seed"], sort=False)[["speed", "power"]]
    means = by_seed.mean(skipna=False)[by_seed.size() == len(fluids)].reset_index().assign(fluid=INTEGRATED)
    parts = {}
    for space, of_space in fronts.groupby("space", sort=False):
        parts[f"faster-than-{space}"] = beyond(of_space, own)
        parts[f"faster-than-{space}-for-all"] = beyond(of_space, means)
    for id, (column, sign) in _TRENDS.items() if len(fluids) > 1 else ():
        wide = own.pivot(index=["place", "seed"], columns="fluid", values=column).reindex(columns=list(fluids))
        grown = sign * (wide[fluids[-1]] / wide[fluids[0]] - 1)
        parts[id] = grown.rename("margin").dropna().reset_index()
    teachers = swims[swims["method"].isin(pilots[1:2])]
    both = own.merge(teachers, on=["place", "seed", "fluid"], suffixes=("", "_taught"))
    parts["keeps-its-teachers-speed"] = both.assign(margin=both["speed"] / both["speed_taught"] - _KEPT)
    tables = [part[["place", "margin"]].assign(conclusion=id) for id, part in parts.items() if len(part)]
    return pd.concat(tables, ignore_index=True) if tables else pd.DataFrame(columns=["place", "margin", "conclusion"])


def beyond(fronts: pd.DataFrame, swims: pd.DataFrame) -> pd.DataFrame:
    """Swims with `margin`: the share by which they are faster than the front of their robot and fluid at their power.

    It is infinite where the front has no gait of so low a power; swims without a front are left out.
    """
    parts = [swims.iloc[:0].assign(margin=0.0)]
    for (robot, fluid), part in swims.groupby(["robot", "fluid"], sort=False):
        front = fronts[(fronts["robot"] == robot) & (fronts["front"] == fluid)]
        if len(front):
            bound = pd.Series(speeds_within(front, part["power"].to_numpy()), part.index).fillna(0.0)
            parts.append(part.assign(margin=part["speed"] / bound.where(part["power"].notna()) - 1))
    return pd.concat(parts)


def margin_table(found: pd.DataFrame) -> Table:
    """For how many swims or seeds each conclusion holds at each place, and the least margin."""

    def held(part: pd.DataFrame) -> str:
        margin = part["margin"]
        least = f", least {100 * margin.min():+.0f} %" if np.isfinite(margin.min()) else ""
        return f"{(margin > 0).sum()} of {len(margin)}{least}" if len(margin) else "–"

    columns = [(str(place), table.at(held, place=place)) for place in found["place"].unique()]
    return summary(found, {"conclusion": _CONCLUSIONS}, columns, label=lambda id: _CONCLUSIONS[id])


def _zero_shot(published: pd.DataFrame, original: str) -> pd.DataFrame:
    """What was found for one robot, swum with others: columns FIGURE, FIGURE_before and FIGURE_change."""
    before = published[published["robot"] == original].set_index(_SWIM)[list(MEASURED)].add_suffix("_before")
    others = published[published["robot"] != original].join(before, on=_SWIM)
    return others.assign(**{f"{name}_change": others[name] / others[f"{name}_before"] - 1 for name in MEASURED})


def _robot_table(zero_shot: pd.DataFrame, config: dict[str, Any]) -> Table:
    columns: list[Any] = [("n", size)]
    for name in ("speed", *COSTS):
        columns += [(f"{LABELS[name]} before", mean(f"{name}_before")), name]
    changes = [(f"change of {label} [%]", change(f"{name}_change")) for name, label in _CHANGED.items()]
    by = {name: zero_shot[name].unique() for name in ("robot", "method")} | {"fluid": config["fluids"]}
    return summary(zero_shot, by, [*columns, *changes])


def _against_original(indicators: pd.DataFrame, original: str) -> pd.DataFrame:
    keys = ["space", "front"]
    home = indicators[indicators["robot"] == original].set_index(keys)["hypervolume"].rename("home")
    return indicators.join(home, on=keys).assign(change=lambda rows: rows["hypervolume"] / rows["home"] - 1)


def _front_table(worth: pd.DataFrame, config: dict[str, Any]) -> Table:
    by = {"space": worth["space"].unique(), "front": worth["front"].unique(), "robot": config["robots"]}
    hypervolume = [(LABELS["hypervolume"], table.first("hypervolume", ".2f")), ("change [%]", change("change", 0))]
    return summary(worth, by, [*speeds_at_powers(worth), *hypervolume, ("points", table.first("points"))])


def _anew_table(anew: pd.DataFrame, own: pd.DataFrame, original: str) -> Table:
    """Policies trained anew beside the published ones at the same rate, on the original robot and on their own."""
    keys = ["physics_rate", "method", "fluid"]
    bullet = own[own["engine"] == "pybullet"]
    headline = bullet[bullet["robot"] == original].groupby(keys)["speed"].mean().rename("headline")
    same_robot = bullet.groupby(["robot", *keys])["speed"].mean().rename("same_robot")
    both = anew.join(headline, on=keys).join(same_robot, on=["robot", *keys])
    both["change"], both["same_robot"] = both["speed"] / both["headline"] - 1, both["speed"] / both["same_robot"] - 1
    columns: list[Column] = [("n", size), *MEASURED, ("published v [m/s]", table.first("headline", ".3f"))]
    columns += [("change [%]", table.share("change")), ("same robot [%]", table.share("same_robot"))]
    return summary(both, ["policy", "fluid"], columns)
