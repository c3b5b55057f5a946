"""The judges of claims about gaits: they are judged at the power of the paper's policy, with top speed beside."""

from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

from snakebench.comparison.results import Finding, Judge, Numbers, Results, Rows, rising, unit_of
from snakebench.names import FINE
from snakebench.report.table import COSTS, LABELS
from snakebench.studies.operating_point.columns import AMPLITUDES

TOP_SPEED = "at top speed"  # of policies of the paper's weights


def _own_fluid(results: Results, _: Mapping[str, Any]) -> Finding:
    labels = {"speed": ("v (m/s)", 3), **{cost: (LABELS[cost], 2) for cost in COSTS}}
    here = {column: results.at_papers_power(column) for column in labels}
    measured = {label: (here[column], digits) for column, (label, digits) in labels.items()}
    beside = {f"{TOP_SPEED}, {label}": (results.in_fluids(name), digits) for name, (label, digits) in labels.items()}
    falls, rises = rising([*here["speed"].values()][::-1]), rising([*here[COSTS[0]].values()])
    return Finding(measured | beside, [falls, rises], leading=2)


def _trend(results: Results, _: Mapping[str, Any], column: str, label: str, *, rises: bool) -> Finding:
    """Whether a figure rises or falls from the first fluid to the last."""
    numbers = results.at_papers_power(column)
    first, *_between, last = numbers.values()
    measured = {label: (numbers, 3), TOP_SPEED: (results.in_fluids(column), 3)}
    return Finding(measured, [rising([first, last] if rises else [last, first])])


def _torque(results: Results, text: Mapping[str, Any]) -> Finding:
    torque = results.at_papers_power("torque_amplitude")
    means = [one.mean for one in torque.values()]
    alike = max(means) <= text["ratio"] * min(means)
    measured = {"torque (N m)": (torque, 1), TOP_SPEED: (results.in_fluids("torque_amplitude"), 1)}
    return Finding(measured, [alike, all(text["least"] <= mean <= text["most"] for mean in means)])


def _fixed_sinusoid(results: Results, _: Mapping[str, Any]) -> Finding:
    """Every definition of the tail's amplitude, on the robots that policies swim with."""
    tails = dict[str, Numbers]()
    for diameter in results.study("operating_point").config["diameters"]:
        for name in AMPLITUDES:
            place, half = name.split("_")
            numbers = tails[f"{half} peak-to-peak of {place}, {diameter:g} m (m)"] = {}
            for fluid in results.fluids:
                rows = results.rows("operating_point", "sinusoid", diameter=diameter, fluid=fluid)
                id = f"fixed sinusoid/{fluid}/{name} at {diameter:g} m"
                numbers[fluid] = rows.measure(id, "m", rows.frame[name], name)
    measured = {label: (numbers, 3) for label, numbers in tails.items()}
    return Finding(measured, [rising([*numbers.values()][::-1]) for numbers in tails.values()])


Replays = Callable[..., Rows]  # of the student's gaits, where columns have some values


def _at_top_speed(results: Results, **where: str) -> Rows:
    return results.rows("cross", "matrix", method="student", loop="open", **where, variant=FINE)


def _best(results: Results, replays: Replays, column: str, at: str) -> Numbers:
    """By fluid in which seeds its own gait, replayed, is the fastest there or has the lowest cost."""
    found = {}
    for fluid in results.fluids:
        rows = replays(results, fluid=fluid)
        power = rows.frame["power"].where(rows.frame["power"] >= 0)  # as of the cost of transport
        table = rows.frame.assign(path_cost=power / rows.frame["path_speed"])
        by_gait = table.pivot(index="seed", columns="gait_of", values=column).dropna(how="all")
        fastest = column in ("speed", "path_speed")
        best = by_gait.idxmax(axis=1) if fastest else by_gait.idxmin(axis=1)
        what = f"whether gait_of = {fluid} is the {'fastest' if fastest else 'lowest'} by {column}"
        id = f"own gait/{fluid}/best by {column} {at}"
        found[fluid] = rows.measure(id, "1", 1.0 * (best == fluid), what, counted=True)
    return found


def _exchanged(results: Results, replays: Replays, column: str, at: str) -> Numbers:
    """A figure of the first fluid's gait in the last one, and of the last one's in the first."""
    ends, found = (results.fluids[0], results.fluids[-1]), Numbers()
    for gait, fluid in (ends, ends[::-1]):
        rows = replays(results, fluid=fluid, gait_of=gait)
        number = rows.measure(f"gait of {gait}/{fluid}/{column} {at}", unit_of(column), column)
        seeds = rows.frame["seed"].nunique()  # of which those that swim backwards have no cost of transport
        found[f"{gait}'s in {fluid}" + (f" (n = {number.n} of {seeds})" if number.n < seeds else "")] = number
    return found


def _best_at_home(results: Results, _: Mapping[str, Any], columns: Mapping[str, str]) -> Finding:
    """Whether own gaits are best by the first column; of further ones numbers are shown under their labels."""
    measured, judged = dict[str, tuple[Numbers, int]](), Numbers()
    at_papers_power = (partial(Results.student, table="matrix"), "at the paper's power", "")
    for replays, at, prefix in (at_papers_power, (_at_top_speed, TOP_SPEED, f"{TOP_SPEED}, ")):
        for column, label in columns.items():
            best = _best(results, replays, column, at)
            judged = judged or best
            measured[f"{prefix}seeds whose own gait is best by {label}"] = best, 0
            if column in LABELS:
                measured[f"{prefix}{label}"] = _exchanged(results, replays, column, at), 2
    return Finding(measured, [one.mean == 1 for one in judged.values()], leading=2)


_BY_COST = {COSTS[0]: "CoT", "path_cost": "CoT along the path", COSTS[1]: "CoT+"}
GAIT_JUDGES: dict[str, Judge] = {  # by the claim's id
    "own-fluid": _own_fluid,
    "frequency": partial(_trend, column="swim_frequency", label="f (Hz)", rises=False),
    "tail": partial(_trend, column="tail_amplitude", label="tail amplitude (m)", rises=True),
    "torque": _torque,
    "fixed-sinusoid": _fixed_sinusoid,
    "fastest-at-home": partial(_best_at_home, columns={"speed": "v", "path_speed": "path v"}),
    "cheapest-at-home": partial(_best_at_home, columns=_BY_COST),
}
