"""A second judge of the paper's claims: it reads the tables of results with pandas and imports nothing of snakebench.

Every function follows the words of a rule in `claims.toml`, and returns whether each of its parts holds.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from pathlib import Path

import pandas as pd
from scipy import stats

FLUIDS = ["water", "oil1", "oil2"]
Parts = list[bool]


def table(results: Path, name: str, query: str = "") -> pd.DataFrame:
    """The rows of the table STUDY/TABLE that a query chooses."""
    (path,) = [path for end in (".csv", ".csv.gz") if (path := results / f"{name}{end}").exists()]
    rows = pd.read_csv(path, low_memory=False)
    return rows.query(query) if query else rows


def ends(values: pd.Series) -> tuple[float, float]:
    """The 95 % interval of a mean by Student's t."""
    return stats.t.interval(0.95, len(values) - 1, loc=values.mean(), scale=stats.sem(values))


def points(results: Path) -> pd.DataFrame:
    """The policy at the paper's power, on the robot that it was trained on."""
    return table(results, "operating_point/points", "variant == 'finer step' and as_trained and method == 'student'")


def by_fluid(results: Path, column: str) -> pd.DataFrame:
    """A figure of the policy at the paper's power: a row a seed, a column a fluid."""
    return points(results).pivot(index="seed", columns="fluid", values=column)[FLUIDS]


def faster(swims: pd.DataFrame, front: pd.DataFrame) -> bool:
    """Whether swims, one a seed, are on average faster than any point of a front that needs no more power."""
    shares = [swim.speed / front.loc[front["power"] <= swim.power, "speed"].max() - 1 for swim in swims.itertuples()]
    return ends(pd.Series(shares))[0] > 0


def beats_each_fluid(results: Path) -> Parts:
    """In every fluid faster than every sinusoid that needs no more power."""
    fronts, swims = table(results, "pareto/fronts", "space == 'paper'"), points(results)
    return [faster(swims[swims["fluid"] == fluid], fronts[fronts["front"] == fluid]) for fluid in FLUIDS]


def over_all(results: Path) -> pd.DataFrame:
    """Mean speed and mean power over the fluids, by seed."""
    return points(results).groupby("seed")[["speed", "power"]].mean()


def beats_integrated(results: Path) -> Parts:
    """Its mean speed is higher than that of every one sinusoid for all fluids that needs no more mean power."""
    return [faster(over_all(results), table(results, "pareto/fronts", "space == 'paper' and front == 'integrated'"))]


def beats_switching(results: Path) -> Parts:
    """Its mean speed is higher than that of every combination of sinusoids that needs no more mean power."""
    return [faster(over_all(results), table(results, "pareto/switching", "space == 'paper'"))]


def cheaper_than_switching(results: Path) -> Parts:
    """Its mean power over its mean speed is less than that of the fastest switching of no more mean power."""
    switching, changes = table(results, "pareto/switching", "space == 'paper'"), []
    for swim in over_all(results).itertuples():
        allowed = switching[switching["power"] <= swim.power]
        fastest = allowed.loc[allowed["speed"].idxmax()]
        changes.append((swim.power / swim.speed) / (fastest["power"] / fastest["speed"]) - 1)
    return [ends(pd.Series(changes))[1] < 0]


def sea_snake(results: Path) -> Parts:
    """It is faster, and has a higher cost of transport, than the sea snake tuned to each fluid."""
    parts, optima = [], table(results, "sea_snake/optima", "variant == 'finer step' and objective == fluid")
    for fluid in FLUIDS:
        gait = optima[optima["fluid"] == fluid].groupby("seed")[["speed", "cost_of_transport"]].mean().mean()
        parts += [ends(by_fluid(results, name)[fluid] / gait[name])[0] > 1 for name in gait.index]
    return parts


def ordered(columns: pd.DataFrame) -> bool:
    """Whether values rise strictly from column to column, in every row."""
    return all(row.is_monotonic_increasing and row.is_unique for _, row in columns.iterrows())


def own_fluid(results: Path) -> Parts:
    """Speed falls and cost of transport rises from water to oil2, for every seed."""
    speed, cost = (by_fluid(results, name) for name in ("speed", "cost_of_transport"))
    return [ordered(speed[FLUIDS[::-1]]), ordered(cost)]


def frequency(results: Path) -> Parts:
    """Frequency falls from water to oil2, for every seed."""
    return [ordered(by_fluid(results, "swim_frequency")[["oil2", "water"]])]


def tail(results: Path) -> Parts:
    """Tail amplitude grows from water to oil2, for every seed."""
    return [ordered(by_fluid(results, "tail_amplitude")[["water", "oil2"]])]


def torque(results: Path) -> Parts:
    """Mean torque amplitudes are within a factor of 1.25, and each is from 4 to 5 N m."""
    means = by_fluid(results, "torque_amplitude").mean()
    return [means.max() / means.min() <= 1.25, means.between(4, 5).all()]


def fixed_sinusoid(results: Path) -> Parts:
    """The tail amplitude of the fixed sinusoid falls from fluid to fluid, by four definitions, on each robot."""
    swims, robots = table(results, "operating_point/sinusoid"), table(results, "operating_point/points")["diameter"]
    return [
        ordered(swims[swims["diameter"] == diameter].set_index("fluid")[[name]].T[FLUIDS[::-1]])
        for diameter in robots.unique()
        for name in ("tip_half", "tip_full", "link_half", "link_full")
    ]


def returns(results: Path) -> pd.DataFrame:
    """Returns over the range of viscosities: a row a seed, a column a policy."""
    means = table(results, "teacher_student/range").groupby(["policy", "seed"])["return"].mean()
    return means.unstack("policy")


def privilege(results: Path) -> Parts:
    """The return is higher with privileged information, and without it is less than 0.8 of that."""
    teacher, symmetric = (returns(results)[name].dropna() for name in ("teacher", "symmetric"))
    return [ends(teacher)[0] > symmetric.mean(), symmetric.mean() < 0.8 * teacher.mean()]


def imitation(results: Path) -> Parts:
    """The student keeps at least 97 % of its teacher's return."""
    both = returns(results)[["student", "teacher"]].dropna()
    return [ends(both["student"] / both["teacher"])[0] > 0.97]


def own_is_best(results: Path, figure: Callable[[pd.DataFrame], pd.Series]) -> Parts:
    """Whether in each fluid the replay of its own gait has the highest figure, for every seed."""
    swims = table(results, "operating_point/matrix", "variant == 'finer step' and as_trained and method == 'student'")
    best = swims.assign(figure=figure).sort_values("figure").groupby(["fluid", "seed"])["gait_of"].last()
    return [(best[fluid] == fluid).all() for fluid in FLUIDS]


def fastest_at_home(results: Path) -> Parts:
    """Replayed open loop, a fluid's own gait is the fastest along x."""
    return own_is_best(results, lambda swims: swims["speed"])


def cheapest_at_home(results: Path) -> Parts:
    """Replayed open loop, a fluid's own gait has the lowest cost of transport; one that swims back has none."""
    return own_is_best(results, lambda swims: (swims["speed"] / swims["power"]).where(swims["speed"] > 0, -1.0))


def adapts(results: Path) -> Parts:
    """Back in at most 3 s after a step, and at least 90 % of the distance of ideal switching of each kind."""
    back = table(results, "adaptation/recoveries", "method == 'student'")["seconds"]
    swims = table(results, "adaptation/courses", "method == 'student' and variant == 'finer step'")
    ideal = table(results, "adaptation/switching").rename(columns={"method": "kind", "distance": "farthest"})
    both = swims.merge(ideal[["course", "kind", "farthest"]], on="course")
    shares = (both["distance"] / both["farthest"]).groupby([both["kind"], both["seed"]]).mean()
    return [back.max() <= 3.0, *(ends(of_kind)[0] > 0.9 for _, of_kind in shares.groupby("kind"))]


RULES: dict[str, Callable[[Path], Parts]] = {
    "beats-each-fluid": beats_each_fluid,
    "beats-integrated": beats_integrated,
    "beats-switching": beats_switching,
    "cheaper-than-switching": cheaper_than_switching,
    "sea-snake": sea_snake,
    "own-fluid": own_fluid,
    "frequency": frequency,
    "tail": tail,
    "torque": torque,
    "fixed-sinusoid": fixed_sinusoid,
    "privilege": privilege,
    "imitation": imitation,
    "fastest-at-home": fastest_at_home,
    "cheapest-at-home": cheapest_at_home,
    "adapts": adapts,
}


def verdict(parts: Iterable[bool]) -> str:
    """Reproduced if all parts of a rule hold, in part if some do, else not."""
    counted = [bool(part) for part in parts]
    return {len(counted): "reproduced", 0: "not"}.get(sum(counted), "in part")


def verdicts(results: Path) -> dict[str, str]:
    """The verdict on every claim, by its id."""
    return {id: verdict(rule(results)) for id, rule in RULES.items()}


if __name__ == "__main__":
    for claim, outcome in verdicts(Path("results")).items():
        print(f"{claim}: {outcome}")
