"""The page of the study of the limit: the highest speed at each power, how sure it is, and how near others come."""

from collections.abc import Mapping
from itertools import product
from typing import Any

import numpy as np
import pandas as pd

from snakebench.collocation.front import AGREE, REFINED, of_first_bounds, under_first_bounds
from snakebench.report.accuracy import spread
from snakebench.report.table import CURRENCY_LABELS, POWERS, Table, at, change, first, largest, share, size, summary
from snakebench.studies.limit import figures
from snakebench.studies.limit_shares import best_of_all, rivals, shares, shares_at
from snakebench.studies.published import Published

_POINT = ["fluid", "viscosity", "currency", "bounds", "allowed"]
_REFINED = 0.005  # change of speed below which a mesh is fine enough


def page(study: Published) -> dict[str, Any]:
    """What the page shows."""
    config, limit, replays = study.config, study.tables["limit"], study.tables["replays"]
    usual, usual_replays = (of_first_bounds(table, config) for table in (limit, replays))
    named, gaits = (under_first_bounds(table, config) for table in (limit, study.tables["gaits"]))
    shown = gaits[gaits["allowed"] == config["shown"]]
    over_viscosity = config["viscosities"] and len(usual)
    others = rivals(study)
    of_each = shares(named, others)
    reached = shares_at(named, others)
    best = best_of_all(reached)
    unpublished = _unpublished(study.tables["solutions"], limit)
    labels = {
        f"{fluid}-{currency}": f"{fluid}, {CURRENCY_LABELS[currency]} = {config['shown']:g} W"
        for fluid, currency in product(config["fluids"], config["currencies"])
    }
    return {
        "findings": {"usual": usual, "others": other_bounds(limit, usual, config), "shares": reached, "best": best},
        "speeds": figures.speeds(limit, others) if len(named) else None,
        "rivals": _rivals(pd.concat([reached, best], ignore_index=True)),
        "highest": of_each["share"].max() if len(of_each) else None,
        "viscosity": figures.over_viscosity(usual, config["powers"][::3]) if over_viscosity else None,
        "waveforms": figures.waveforms(shown) if len(shown) else None,
        "points": _points(named),
        "certainty": _certainty(usual),
        "kinds": _kinds(of_first_bounds(study.tables["solutions"], config)),
        "evidence": _evidence(usual, usual_replays),
        "held": _held(usual_replays),
        "other_bounds": _other_bounds(limit, usual, config),
        "n_points": len(usual),
        "n_published": len(limit),
        "n_unpublished": sum(int(row[1]) for row in unpublished.rows) if unpublished else 0,
        "unpublished": unpublished,
        "solutions": len(study.tables["solutions"]),
        "unsteady": int((~usual["steady"]).sum()),
        "coarse": int((usual["change"].abs() > _REFINED).sum()),
        "agree": int((usual["agreeing"] >= 2).sum()),
        "swimmers": study.swimmers(labels),
    }


def other_bounds(limit: pd.DataFrame, usual: pd.DataFrame, config: Mapping[str, Any]) -> pd.DataFrame:
    """The points of other bounds in the fluids, with `gain`: speed against the first bounds at equal power [1].

    Speeds are those of simulations: optima differ in smoothing.
    """
    others = limit[(limit["bounds"] != next(iter(config["bounds"]))) & limit["fluid"].notna()]
    known = usual.assign(usual=usual["optimal_speed"] * (1 + usual["gap"]))
    known = known.set_index(["viscosity", "currency", "allowed"])[["usual"]]
    joined = others.join(known, on=["viscosity", "currency", "allowed"])
    return joined.assign(gain=joined["optimal_speed"] * (1 + joined["gap"]) / joined["usual"] - 1)


def _labelled(frame: pd.DataFrame) -> pd.DataFrame:
    places = frame["fluid"].fillna(frame["viscosity"].map("{:.2g} m²/s".format))
    return frame.assign(place=places, currency=frame["currency"].map(CURRENCY_LABELS))


def _points(named: pd.DataFrame) -> Table:
    columns = [
        ("v [m/s]", first("speed", ".3f")),
        ("P [W]", first("power", ".2f")),
        ("P+ [W]", first("positive_power", ".2f")),
        ("dv/dP [m/s/W]", first("multiplier", ".4f")),
        ("f [Hz]", first("frequency", ".2f")),
        ("tail [m]", first("tail_amplitude", ".3f")),
        ("joint [rad]", first("joint_amplitude", ".2f")),
        ("torque [N m]", first("torque_amplitude", ".1f")),
        ("targets at bound [%]", share("at_bound", 0)),
    ]
    return summary(_labelled(named), ["place", "currency", "allowed"], columns, head="fluid, power counted, at [W]")


def _rivals(reached: pd.DataFrame) -> Table:
    powers = reached["allowed"].map("{:g} W".format).where(reached["allowed"].notna(), "its own power")
    named = reached.assign(at=powers, currency=reached["currency"].map(CURRENCY_LABELS))
    by = {name: list(named[name].unique()) for name in ("method", "fluid", "currency")}
    places = sorted(powers.unique(), key=lambda text: float(text.split()[0]) if text.endswith(" W") else np.inf)
    return summary(named, by, [(f"at {place}", at(change("share", 0), at=place)) for place in places])


def _certainty(usual: pd.DataFrame) -> Table:
    columns = [
        ("points", size),
        ("two starts agree", lambda part: str(int((part["agreeing"] >= 2).sum()))),
        ("residual, largest", largest("residual", ".0e")),
        ("change by mesh, median / largest [%]", spread("change")),
        ("replay in PyBullet, median / largest [%]", spread("gap")),
        ("in planar, median / largest [%]", spread("planar_gap")),
    ]
    return summary(_labelled(usual), ["place", "currency"], columns, head="fluid, power counted")


def _kinds(solutions: pd.DataFrame) -> Table:
    """Of each kind of start how many there were on the coarse mesh, and how many ended within 1 % of the fastest."""
    starts = solutions[~solutions["start"].isin(REFINED)]
    optima = starts[starts["status"] == "optimal"]
    fastest = optima.groupby(_POINT, dropna=False)["optimal_speed"].transform("max")
    near = optima["optimal_speed"] >= (1 - AGREE) * fastest
    parts = [starts["start"], optima["start"], optima.loc[near, "start"]]
    counts = pd.concat([part.value_counts() for part in parts], axis=1).loc[starts["start"].unique()].fillna(0)
    rows = [[str(kind), *(f"{number:.0f}" for number in row)] for kind, row in counts.iterrows()]
    return Table(["start", "solutions", "optima", "within 1 % of the fastest"], rows)


def _evidence(usual: pd.DataFrame, replays: pd.DataFrame) -> Table:
    """Of each point its optimum, its simulation in planar, and how sure it is."""

    def changed(part: pd.DataFrame) -> str:
        return spread("change")(part) + (" *" if abs(part["change"].iloc[0]) > _REFINED else "")

    planar = replays[(replays["engine"] == "planar") & (replays["waveform"] == "continuous")]
    planar = planar.set_index(_POINT[1:])[["speed", *POWERS]].add_suffix("_planar")
    joined = usual.join(planar, on=_POINT[1:])
    columns = [
        ("v, optimum [m/s]", first("optimal_speed", ".4f")),
        ("its power [W]", first("optimal_power", ".3f")),
        ("v, planar [m/s]", first("speed_planar", ".4f")),
        ("P, planar [W]", first("power_planar", ".3f")),
        ("P+, planar [W]", first("positive_power_planar", ".3f")),
        ("PyBullet [%]", spread("gap")),
        ("planar [%]", spread("planar_gap")),
        ("residual", largest("residual", ".0e")),
        ("agreeing of starts", lambda part: f"{part['agreeing'].iloc[0]} of {part['starts'].iloc[0]}"),
        ("knots", first("knots")),
        ("intervals", first("intervals")),
        ("change [%]", changed),
        ("ε [mm/s]", lambda part: f"{1e3 * part['smoothing'].iloc[0]:g}"),
    ]
    return summary(_labelled(joined), ["place", "currency", "allowed"], columns, head="fluid, power counted, at [W]")


def _held(replays: pd.DataFrame) -> Table:
    """How much speed in PyBullet changes where targets are held instead of linear."""
    ours = replays[(replays["engine"] == "pybullet") & replays["published"]]
    waveform, steps = (ours[ours["waveform"] == name].set_index(_POINT) for name in ("continuous", "held"))
    swims = steps.assign(loss=steps["speed"] / waveform["speed"] - 1).reset_index()
    columns = [("points", size), ("speed, median / largest change [%]", spread("loss"))]
    return summary(_labelled(swims), ["place", "currency"], columns, head="fluid, power counted")


def _other_bounds(limit: pd.DataFrame, usual: pd.DataFrame, config: Mapping[str, Any]) -> Table | None:
    others = _labelled(other_bounds(limit, usual, config)).sort_values("allowed", kind="stable")
    columns = [("v [m/s]", first("speed", ".3f")), ("speed against the first bounds [%]", share("gain"))]
    by = ["bounds", "place", "currency", "allowed"]
    return summary(others, by, columns, head="bounds, fluid, power counted, at [W]") if len(others) else None


def _unpublished(solutions: pd.DataFrame, limit: pd.DataFrame) -> Table | None:
    """The points that were sought but are not published, by bounds and fluid; None without any."""
    asked = solutions[_POINT].drop_duplicates()
    found = asked.merge(limit[_POINT], "left", _POINT, indicator="found")
    missing = _labelled(found[found["found"] == "left_only"])
    columns = [("points", size), ("at [W]", lambda part: ", ".join(map("{:g}".format, part["allowed"])))]
    by = ["bounds", "place", "currency"]
    return summary(missing, by, columns, head="bounds, fluid, power counted") if len(missing) else None
