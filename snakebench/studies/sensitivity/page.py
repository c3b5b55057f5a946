"""What the sensitivity page shows: headline figures at other steps and with other robots, to sentences and tables."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import pandas as pd

from snakebench.report.assumptions import assumptions_of_comparison
from snakebench.report.measurements import MEASURED, of, readable
from snakebench.report.method_names import name_of
from snakebench.report.summary import Cell, first, mean, percent, size, summary
from snakebench.report.tables import Table, averaged, downloads, failures, number
from snakebench.store import ADAPTIVE, INTEGRATED, read_manifest
from snakebench.studies.pareto.page import speeds_at_powers
from snakebench.studies.sensitivity import figures
from snakebench.studies.sensitivity.robustness import Conclusion, Place, beyond, conclusion_table, conclusions
from snakebench.tables import read_table

_KEYS = ["method", "seed", "fluid"]
_CHANGED = {"speed": "v", "power": "P"}


def page(directory: Path, manifest: dict[str, Any]) -> dict[str, Any]:
    """Everything the sensitivity page shows; policies learned anew are those of the study beside it, if it is there."""
    config = manifest["config"]
    swims, fronts, indicators = (read_table(directory / f"{name}.csv") for name in ("swims", "fronts", "indicators"))
    own = _where_they_belong(readable(swims))
    anew = _learned_anew(directory, config)
    places = list(_places(own[own["tuned_to"] == ADAPTIVE], anew, config))
    found = conclusions(places, fronts, config["fluids"], config["pilots"])
    others = [name for name in config["robots"] if name != _original(config) and name in set(own["robot"])]
    names = [name for name in (*config["fluids"], INTEGRATED) if name in set(fronts["front"])]
    return {
        "manifest": manifest,
        "config": config,
        "answers": list(_answers(found, own, indicators, config)),
        "conclusions": conclusion_table(found, places) if found else None,
        "steps": _steps(own, config),
        "robots": [_zero_shot(own, name, config) for name in others],
        "fronts": figures.fronts(
            fronts, names, list(config["robots"]), _published(own[own["tuned_to"] == ADAPTIVE], config)
        ),
        "equal_power": _equal_power(indicators, config),
        "anew": _beside_headline(anew, own, fronts, config) if anew is not None else None,
        "failed": failures(own),
        "n_swims": len(own),
        "downloads": downloads(directory, "swims", "fronts", "indicators", "contenders"),
        "assumptions": assumptions_of_comparison(config),
    }


def _where_they_belong(swims: pd.DataFrame) -> pd.DataFrame:
    """The swims of policies, and of gaits in the fluid that they are tuned to."""
    return swims[(swims["tuned_to"] == ADAPTIVE) | (swims["tuned_to"] == swims["fluid"])]


def _original(config: dict[str, Any]) -> str:
    """The robot that policies and gaits were found for."""
    joints, diameter = len(config["robot"]["lengths"]) - 1, config["robot"]["diameter"]
    return _robot(config, joints, diameter) or next(iter(config["robots"]))


def _robot(config: dict[str, Any], joints: int, diameter: float) -> str | None:
    bodies = config["robots"].items()
    return next((name for name, body in bodies if (body["joints"], body["diameter"]) == (joints, diameter)), None)


def _published(swims: pd.DataFrame, config: dict[str, Any]) -> pd.DataFrame:
    """The swims at the published rate."""
    return swims[(swims["engine"] == "pybullet") & (swims["physics_rate"] == config["verify_rate"])]


def _steps_of(swims: pd.DataFrame) -> Iterator[tuple[str, pd.DataFrame]]:
    """The swims by engine and rate, as they are called."""
    for (engine, rate), part in swims.groupby(["engine", "physics_rate"], sort=False):
        yield f"{rate} Hz" if engine == "pybullet" else f"{engine}, {rate} Hz", part


def _places(policies: pd.DataFrame, anew: pd.DataFrame | None, config: dict[str, Any]) -> Iterator[Place]:
    """Where conclusions are tried: at every step, on every robot, and where policies learned anew."""
    original = _original(config)
    published = f"{config['verify_rate']} Hz"
    steps = [Place(name, part, original) for name, part in _steps_of(policies[policies["robot"] == original])]
    yield from sorted(steps, key=lambda place: place.name != published)
    others = _published(policies[policies["robot"] != original], config)
    yield from (Place(f"{name_of(str(name))}, as it is", part, str(name)) for name, part in others.groupby("robot"))
    for (how, robot), part in anew.groupby(["how", "robot"], sort=False) if anew is not None else ():
        yield Place(f"{name_of(str(how))}, learned anew", part, str(robot))


def _answers(
    found: Sequence[Conclusion], own: pd.DataFrame, indicators: pd.DataFrame, config: dict[str, Any]
) -> Iterator[str]:
    """The findings, a sentence each."""
    policy = config["pilots"][0]
    for one in found:
        failing = [f"{place} ({one.cell(place)})" for place in one.margins if not one.holds(place)]
        n, held = len(one.margins), len(one.margins) - len(failing)
        where = f"; not, or not for all, at {'; '.join(failing)}" if held and failing else ""
        yield f"The {name_of(policy)} {one.name}: this holds at {held} of {n} places{where}."
    home = own[(own["robot"] == _original(config)) & (own["method"] == policy)]
    if len(home):
        yield _step_answer(home, policy, config)
    yield from _robot_answers(own[own["method"] == policy], config)
    yield from _front_answers(indicators, config)


def _step_answer(home: pd.DataFrame, policy: str, config: dict[str, Any]) -> str:
    """What other steps and the other engine change of the swims of a policy."""
    published = _index(_published(home, config))[list(_CHANGED)]
    changes = pd.concat([(_index(part)[list(_CHANGED)] / published - 1).abs() for _, part in _steps_of(home)]).max()
    return (
        f"Other steps and the planar engine change the {name_of(policy)}'s speed by at most"
        f" {number(100 * changes['speed'])} % and its power by at most {number(100 * changes['power'])} %."
    )


def _robot_answers(own: pd.DataFrame, config: dict[str, Any]) -> Iterator[str]:
    """What another robot changes of the speed of a policy, a sentence for each robot."""
    speeds = _published(own, config).set_index(["robot", "fluid", "seed"])["speed"]
    for robot in dict.fromkeys(own["robot"]):
        before, after = (of(speeds, robot=name).droplevel("robot") for name in (_original(config), robot))
        if robot != _original(config) and len(before):
            changes = [f"{percent(of(after / before - 1, fluid=fluid), 0)} % in {fluid}" for fluid in config["fluids"]]
            yield f"With the {name_of(robot)} robot, nothing learned anew, its speed changes by {', '.join(changes)}."


def _front_answers(indicators: pd.DataFrame, config: dict[str, Any]) -> Iterator[str]:
    """What the fronts of other robots are worth, a sentence for each search space."""
    for space, part in indicators[indicators["front"].isin(config["fluids"])].groupby("space", sort=False):
        worth = part.pivot(index="robot", columns="front", values="hypervolume")
        original = _original(config)
        if original in worth.index:
            ratios = (100 * (worth / worth.loc[original] - 1)).drop(index=original)
            said_of = [
                f"{name_of(str(name))} {row.min():+.0f} to {row.max():+.0f} %" for name, row in ratios.iterrows()
            ]
            yield (
                f"Hypervolume of the {name_of(str(space))}'s fronts against the {name_of(original)} robot's, over the"
                f" fluids: {', '.join(said_of)}."
            )


def _index(swims: pd.DataFrame) -> pd.DataFrame:
    return swims.set_index(_KEYS)


def _steps(own: pd.DataFrame, config: dict[str, Any]) -> Table:
    """Speed and power at the published rate, and their changes at others and in the other engine."""
    home = own[own["robot"] == _original(config)]
    published = _index(_published(home, config))
    others = {name: _index(part) for name, part in _steps_of(home) if name != f"{config['verify_rate']} Hz"}
    changes = {
        f"{name}: {head}": part[column] / published[column] - 1
        for name, part in others.items()
        for column, head in _CHANGED.items()
    }
    swims = published.assign(**{head: change.reindex(published.index) for head, change in changes.items()})
    return summary(
        f"Speed [m/s] and powers [W] in PyBullet at {config['verify_rate']} Hz, and changes of v and P at other rates"
        " and in the planar engine [%]: mean over the seeds ± half its 95 % interval. Gaits are in the fluid that they"
        " are tuned to.",
        swims.reset_index(),
        _by(home, config),
        [("n", size), *_spent("v", "P", "P+"), *((head, _change(head, 2)) for head in changes)],
    )


def _by(swims: pd.DataFrame, config: dict[str, Any]) -> dict[str, Sequence[str]]:
    """A row for each method and fluid."""
    return {"method": list(swims["method"].unique()), "fluid": config["fluids"]}


def _spent(*heads: str) -> Iterator[tuple[str, Cell]]:
    """Means of as many of the measured figures as there are heads."""
    for name, head in zip(MEASURED, heads, strict=False):
        yield head, mean(name, 1 if name.endswith("power") else 3)


def _change(column: str, digits: int = 1) -> Cell:
    """The mean of a change where it is known [%]."""
    return lambda part: percent(part[column].dropna(), digits)


def _zero_shot(own: pd.DataFrame, robot: str, config: dict[str, Any]) -> Table:
    """What was found for one robot, swum with another."""
    published = _published(own, config)
    home, there = (_index(published[published["robot"] == name])[MEASURED] for name in (_original(config), robot))
    both = there.join(home.add_suffix(" before"))
    both = both.assign(**{f"{name} change": both[name] / both[f"{name} before"] - 1 for name in _CHANGED})
    compared = {"speed": "v", "cost_of_transport": "CoT", "positive_cost_of_transport": "CoT+"}
    pairs = [
        pair
        for name, head in compared.items()
        for pair in ((f"{head} before", mean(f"{name} before")), (head, mean(name)))
    ]
    return summary(
        f"The robot {name_of(robot)}, swum by what was found for the {name_of(_original(config))} one: speed [m/s],"
        " costs of transport, and the changes of speed and power [%], in PyBullet at"
        f" {config['verify_rate']} Hz: mean over the seeds ± half its 95 % interval.",
        both.reset_index(),
        _by(own, config),
        [("n", size), *pairs, ("change of v", _change("speed change")), ("of P", _change("power change"))],
    )


def _equal_power(indicators: pd.DataFrame, config: dict[str, Any]) -> Table:
    """What the fronts of each robot are worth."""
    original = name_of(_original(config))
    home = indicators[indicators["robot"] == _original(config)].set_index(["space", "front"])["hypervolume"]
    worth = indicators.join(home.rename("home"), on=["space", "front"])
    return summary(
        "Fronts of each robot: highest speed [m/s] for at most a power P, hypervolume [m/s W], its change from the"
        f" {original} robot's [%], and points; in brackets the P+ [W] of the point that has the speed",
        worth.assign(change=100 * (worth["hypervolume"] / worth["home"] - 1)),
        {"space": worth["space"].unique(), "front": worth["front"].unique(), "robot": config["robots"]},
        [
            *speeds_at_powers(indicators),
            ("hypervolume", first("hypervolume", ".2f")),
            ("change", first("change", "+.0f")),
            ("points", first("points")),
        ],
        head="front, space, robot",
        label=lambda space, front, robot: f"{front}, {name_of(space)}, {name_of(robot)}",
    )


def _learned_anew(directory: Path, config: dict[str, Any]) -> pd.DataFrame | None:
    """The policies of the study `relearned` of the same profile, and how each learned; None if it is not there."""
    other = directory.with_name(directory.name.replace("sensitivity", "relearned"))
    if not (other / "manifest.json").exists():
        return None
    evaluations = read_table(other / "evaluations.csv")
    fine = evaluations[evaluations["variant"] == "finer step"].assign(tuned_to=ADAPTIVE)
    parts = fine["policy"].str.split("_", n=1, expand=True)
    settings = read_manifest(other)["config"]["policies"]
    robots = {name: _robot_of(settings[name], config) for name in set(fine["policy"])}
    how = parts.get(1, pd.Series(index=fine.index, dtype=str)).fillna("").str.replace("Hz", " Hz")
    return readable(fine).assign(method=parts[0], how=how, robot=fine["policy"].map(robots))


def _robot_of(settings: dict[str, Any], config: dict[str, Any]) -> str:
    """The robot that a policy learned for."""
    diameter = settings.get("robot", {}).get("diameter", config["robot"]["diameter"])
    return _robot(config, len(config["robot"]["lengths"]) - 1, diameter) or _original(config)


def _beside_headline(anew: pd.DataFrame, own: pd.DataFrame, fronts: pd.DataFrame, config: dict[str, Any]) -> Table:
    """Policies learned anew beside those of the headline, as they are, on the original robot and on their own."""
    rows, spaces = [], list(dict.fromkeys(fronts["space"]))
    for (policy, method, robot), swims in anew.groupby(["policy", "method", "robot"], sort=False):
        rate = int(swims["physics_rate"].iloc[0])
        alike = own[(own["engine"] == "pybullet") & (own["physics_rate"] == rate)]
        alike = _published(own, config) if alike.empty else alike
        for fluid in config["fluids"]:
            part = swims[swims["fluid"] == fluid]
            before = alike[(alike["method"] == method) & (alike["fluid"] == fluid)]
            speeds = [before[before["robot"] == name]["speed"] for name in (_original(config), robot)]
            changes = [percent(part["speed"] / speed.mean() - 1) if len(speed) else "–" for speed in speeds]
            of_robot = fronts[(fronts["robot"] == robot) & (fronts["front"] == fluid)]
            margins = [percent(beyond(of_robot[of_robot["space"] == space], part), 0) for space in spaces]
            if len(part):
                means = [averaged(part[name], 1 if name.endswith("power") else 3) for name in MEASURED]
                changes = [averaged(speeds[0]), *changes, *margins]
                rows.append([f"{name_of(str(policy))}, {fluid}", str(len(part)), *means, *changes])
    original = name_of(_original(config))
    return Table(
        "Policies learned anew, at the finer rate: speed [m/s], powers [W] and costs of transport; the headline"
        f" policy's speed on the {original} robot, and the change from there and from the headline policy on the robot"
        " that the new one learned for [%]; and how much faster it is, at its own power, than the fronts of that robot"
        " [%]: mean over the seeds ± half its 95 % interval.",
        ["policy, fluid", "n", "v", "P", "P+", "CoT", "CoT+", f"headline v, {original}", "change", "change, same robot"]
        + [f"beyond the {name_of(space)}'s front" for space in spaces],
        rows,
    )
