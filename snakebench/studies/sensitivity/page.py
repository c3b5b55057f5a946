"""The page of the sensitivity study: other steps, another engine and other robots."""

from __future__ import annotations

from typing import Any

import pandas as pd

from snakebench.report.accuracy import step_changes, step_table
from snakebench.report.method_names import name_of
from snakebench.report.table import (
    COSTS,
    LABELS,
    MEASURED,
    Table,
    change,
    failures,
    first,
    mean,
    of_valid,
    share,
    size,
    summary,
)
from snakebench.store import ADAPTIVE, INTEGRATED
from snakebench.studies.pareto.page import speeds_at_powers
from snakebench.studies.published import Published
from snakebench.studies.sensitivity import figures
from snakebench.studies.sensitivity.robustness import beyond, margin_table, margins

_SWIM = ["method", "seed", "fluid"]
_CHANGED = {"speed": "v", "power": "P"}


def page(study: Published) -> dict[str, Any]:
    """What the page shows; policies learned anew are those of the study beside it, if it is there."""
    config, fronts = study.config, study.tables["fronts"]
    swims, original = of_valid(study.tables["swims"]), _robot(config)
    own = swims[(swims["tuned_to"] == ADAPTIVE) | (swims["tuned_to"] == swims["fluid"])]  # where they belong
    anew, policies = _learned_anew(study), own[own["tuned_to"] == ADAPTIVE]
    found = margins(_places(policies, anew, config, original), fronts, config["fluids"], config["pilots"])
    here = own[own["robot"] == original]
    steps = step_changes(here.assign(variant=_variants(here, config)), _SWIM, _CHANGED, study.manifest)
    published, names = _published(own, config), [*config["fluids"], INTEGRATED]
    worth = _against_original(study.tables["indicators"], original)
    zero_shot = _zero_shot(published, original)
    compared = _beside_headline(anew, own, fronts, config, original)
    return {
        "findings": {"margins": found, "steps": steps, "zero_shot": zero_shot, "worth": worth},
        "original": original,
        "margins": margin_table(found),
        "steps": step_table(steps, {"method": here["method"].unique(), "fluid": config["fluids"]}),
        "robots": _robot_table(zero_shot, config),
        "fronts": figures.fronts(
            fronts,
            [name for name in names if name in set(fronts["front"])],
            list(config["robots"]),
            published[published["tuned_to"] == ADAPTIVE],
        ),
        "equal_power": _front_table(worth, config),
        "anew": _anew_table(compared),
        "failed": failures(own),
        "n_swims": len(own),
    }


def _robot(config: dict[str, Any], **changes: Any) -> str:
    """The name of the study's robot, or of one with some changes; of the first one if none is like this."""
    robot, bodies = config["robot"] | changes, config["robots"]
    shape = {"joints": len(robot["lengths"]) - 1, "diameter": robot["diameter"]}
    return next((name for name, body in bodies.items() if body == shape), next(iter(bodies)))


def _published(swims: pd.DataFrame, config: dict[str, Any]) -> pd.DataFrame:
    """The swims at the published rate."""
    return swims[(swims["engine"] == "pybullet") & (swims["physics_rate"] == config["verify_rate"])]


def _variants(swims: pd.DataFrame, config: dict[str, Any]) -> pd.Series:
    """The published rate as "finer step", its half as "coarser step", the planar engine, and other rates by name."""
    rate = config["verify_rate"]
    names = swims["physics_rate"].map({rate: "finer step", rate // 2: "coarser step"})
    names = names.fillna(swims["physics_rate"].astype(str) + " Hz")
    return names.where(swims["engine"] == "pybullet", swims["engine"])


def _places(policies: pd.DataFrame, anew: pd.DataFrame, config: dict[str, Any], original: str) -> pd.DataFrame:
    """Where conclusions are tried: at every step, on every robot, and where policies were trained anew."""
    here, others = policies[policies["robot"] == original], policies[policies["robot"] != original]
    rate = here["physics_rate"].astype(str) + " Hz"
    steps = here.assign(place=rate.where(here["engine"] == "pybullet", here["engine"] + ", " + rate))
    steps = steps.sort_values("place", key=lambda place: place != f"{config['verify_rate']} Hz", kind="stable")
    others = _published(others, config)
    robots = others.assign(place=others["robot"].map(name_of) + " robot, same policies")
    return pd.concat([steps, robots, anew.assign(place=anew["how"] + ", retrained")], ignore_index=True)


def _zero_shot(published: pd.DataFrame, original: str) -> pd.DataFrame:
    """What was found for one robot, swum with others: columns FIGURE, FIGURE_before and FIGURE_change."""
    before = published[published["robot"] == original].set_index(_SWIM)[list(MEASURED)].add_suffix("_before")
    table = published[published["robot"] != original].join(before, on=_SWIM)
    return table.assign(**{f"{name}_change": table[name] / table[f"{name}_before"] - 1 for name in MEASURED})


def _robot_table(zero_shot: pd.DataFrame, config: dict[str, Any]) -> Table:
    columns: list[Any] = [("n", size)]
    for name in ("speed", *COSTS):
        columns += [(f"{LABELS[name]} before", mean(f"{name}_before")), name]
    changes = [(f"change of {label} [%]", change(f"{name}_change")) for name, label in _CHANGED.items()]
    by = {name: zero_shot[name].unique() for name in ("robot", "method")} | {"fluid": config["fluids"]}
    return summary(zero_shot, by, [*columns, *changes])


def _against_original(indicators: pd.DataFrame, original: str) -> pd.DataFrame:
    """The indicators of fronts with `change`, of the hypervolume from that of the original robot."""
    keys = ["space", "front"]
    home = indicators[indicators["robot"] == original].set_index(keys)["hypervolume"].rename("home")
    table = indicators.join(home, on=keys)
    return table.assign(change=table["hypervolume"] / table["home"] - 1)


def _front_table(worth: pd.DataFrame, config: dict[str, Any]) -> Table:
    by = {"space": worth["space"].unique(), "front": worth["front"].unique(), "robot": config["robots"]}
    hypervolume = [(LABELS["hypervolume"], first("hypervolume", ".2f")), ("change [%]", change("change", 0))]
    return summary(worth, by, [*speeds_at_powers(worth), *hypervolume, ("points", first("points"))])


def _learned_anew(study: Published) -> pd.DataFrame:
    """The policies of the study `relearned` of the same profile, how each learned, and its robot; none without it."""
    other, config = study.beside("relearned"), study.config
    if other is None:
        return pd.DataFrame(columns=["policy", "how", "robot", "physics_rate", *_SWIM, *MEASURED])
    evaluations = other.tables["evaluations"]
    fine = evaluations[evaluations["variant"] == "finer step"]
    parts = fine["policy"].str.extract("(?P<method>[^_]*)_?(?P<how>.*)")
    robots = {name: _robot(config, **policy.get("robot", {})) for name, policy in other.config["policies"].items()}
    how = parts["how"].str.replace("Hz", " Hz")
    return of_valid(fine).assign(method=parts["method"], how=how, robot=fine["policy"].map(robots))


def _beside_headline(
    anew: pd.DataFrame, own: pd.DataFrame, fronts: pd.DataFrame, config: dict[str, Any], original: str
) -> pd.DataFrame:
    """Policies trained anew beside those of the headline, as they are, on the original robot and on their own.

    Further columns are `headline`, its speed on the original robot [m/s], `change` from there, `same_robot` from the
    headline policy on the robot of the new one, and `beyond_SPACE`, by what share it is faster than the front.
    """
    rates = set(own[own["engine"] == "pybullet"]["physics_rate"])
    rate = anew["physics_rate"].where(anew["physics_rate"].isin(rates), config["verify_rate"])
    speeds = own[own["engine"] == "pybullet"].groupby(["physics_rate", "robot", "method", "fluid"])["speed"].mean()

    def headline(robots: pd.Series) -> pd.Series:
        keys = pd.MultiIndex.from_arrays([rate, robots, anew["method"], anew["fluid"]])
        return pd.Series(speeds.reindex(keys).to_numpy(), anew.index)

    here = headline(pd.Series(original, anew.index))
    changes = {"change": anew["speed"] / here - 1, "same_robot": anew["speed"] / headline(anew["robot"]) - 1}
    spaces = {f"beyond_{space}": beyond(part, anew)["margin"] for space, part in fronts.groupby("space", sort=False)}
    return anew.assign(headline=here, **changes, **spaces)


def _anew_table(compared: pd.DataFrame) -> Table:
    spaces = [name for name in map(str, compared) if name.startswith("beyond_")]
    beyond_fronts = [(f"faster than {name_of(name.removeprefix('beyond_'))}s [%]", share(name, 0)) for name in spaces]
    changes = [("change [%]", share("change")), ("same robot [%]", share("same_robot"))]
    columns: list[Any] = [("n", size), *MEASURED, ("headline v", mean("headline")), *changes, *beyond_fronts]
    return summary(compared, ["policy", "fluid"], columns)
