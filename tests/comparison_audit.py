"""A second judge of the paper's claims: it reads the tables of results with pandas and imports nothing of snakebench.

Every function follows the words of a rule in `claims.toml`, and returns whether each of its parts holds.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from functools import cache
from pathlib import Path

import numpy as np
import pandas as pd
from scipy import stats

FLUIDS = ["water", "oil1", "oil2"]
Parts = list[bool]


def table(results: Path, name: str, query: str = "") -> pd.DataFrame:
    """The rows of the table STUDY/TABLE that a query chooses."""
    (path,) = [path for end in (".csv", ".csv.gz") if (path := results / f"{name}{end}").exists()]
    rows = _read(path.resolve(), path.stat().st_mtime_ns)
    return rows.query(query) if query else rows.copy()


@cache
def _read(path: Path, _: int) -> pd.DataFrame:
    return pd.read_csv(path, low_memory=False)


def ends(values: pd.Series, error: float = 0.0) -> tuple[float, float]:
    """The 95 % interval of a mean by Student's t, wider by a bound on its error."""
    low, high = stats.t.interval(0.95, len(values) - 1, loc=values.mean(), scale=stats.sem(values))
    return low - error, high + error


def welch(values: np.ndarray, error: float) -> tuple[float, float]:
    """The 95 % interval of the mean of a comparison, rows and columns are the seeds of both sides, and a bound."""
    sides = [side for side in (values.mean(axis=1), values.mean(axis=0)) if len(side) > 1]
    squares = np.array([stats.sem(side) ** 2 for side in sides])
    degrees = squares.sum() ** 2 / sum(square**2 / (len(side) - 1) for square, side in zip(squares, sides, strict=True))
    half = np.sqrt(squares.sum()) * stats.t.ppf(0.975, degrees) + error
    return values.mean() - half, values.mean() + half


def apart(values: pd.Series, others: pd.Series) -> pd.Series:
    """Relative difference; none where it is not known."""
    return (values / others - 1).abs().fillna(0.0)


def with_errors(swims: pd.DataFrame, swim: list[str]) -> pd.DataFrame:
    """Swims at the finer step with errors of v (dv) and P (dp): their own, or the change from the coarser step."""
    fine = swims[swims["variant"] == "finer step"].set_index(swim)
    if "speed_error" in fine and fine["speed_error"].notna().any():
        errors = fine[["speed_error", "power_error"]].fillna(0.0).set_axis(["dv", "dp"], axis=1)
    else:
        coarse = swims[swims["variant"] == "coarser step"].set_index(swim).reindex(fine.index)
        errors = pd.DataFrame(
            {"dv": apart(coarse["speed"], fine["speed"]), "dp": apart(coarse["power"], fine["power"])}
        )
    return fine.join(errors.clip(upper=1.0)).reset_index()


def if_better(rows: pd.DataFrame, by: int) -> pd.DataFrame:
    """Rows as if they were faster for less power by their errors (1), slower for more (-1), or as they are (0)."""
    faster, cheaper = 1 + by * rows["dv"], 1 - by * rows["dp"]
    changed = {"speed": rows["speed"] * faster, "power": rows["power"] * cheaper}
    if "cost_of_transport" in rows:
        changed["cost_of_transport"] = rows["cost_of_transport"] * cheaper / faster
    return rows.assign(**changed)


def largest_error(comparison: Callable[[int], pd.Series | np.ndarray]) -> float:
    """By how much the mean of a comparison changes at most if errors favour one side."""
    return max(float(np.abs(comparison(by) - comparison(0)).mean()) for by in (1, -1))


def line(front: pd.DataFrame) -> np.ndarray:
    """The corners of a front, columns power and speed.

    Neighbours on it are joined where the second needs at most twice the power, across wider gaps it is a step.
    """
    best, corners = -np.inf, list[tuple[float, float]]()
    for p, v in front[["power", "speed"]].sort_values(["power", "speed"], ascending=[True, False]).to_numpy():
        if v > best:
            if corners and p > 2 * corners[-1][0]:
                corners.append((np.nextafter(p, 0), best))
            corners.append((p, v))
            best = v
    return np.array(corners)


def at(front: pd.DataFrame, power: Iterable[float]) -> tuple[np.ndarray, np.ndarray]:
    """Speeds of a front at powers, and these powers; beyond its fastest point both are those of this point."""
    powers, speeds = line(front).T
    return np.interp(power, powers, speeds, left=np.nan), np.minimum(power, powers[-1])


def of_net_power(rows: pd.DataFrame) -> pd.DataFrame:
    """Those fronts that are of P."""
    return rows[rows["currency"] == "net"] if "currency" in rows else rows


def sinusoids(results: Path, name: str, space: str = "paper") -> pd.DataFrame:
    """A front of the paper's sinusoids; errors are the engines' difference, and for v what one search may lack."""
    front = of_net_power(table(results, "pareto/fronts", f"space == '{space}' and front == '{name}'")).copy()
    worst = of_net_power(table(results, "pareto/attainment", f"space == '{space}' and surface == 'worst'"))
    attained = [worst.loc[worst["objective"] == name, ["speed", "power"]], of_grid(results, name, space)]
    lowest, _ = at(pd.concat(attained), front["power_searched"])
    gap = (1 - lowest / front["speed_searched"]).clip(lower=0.0).fillna(0.0)
    front["dv"] = (apart(front["speed"], front["speed_searched"]) + gap).clip(upper=1.0)
    front["dp"] = apart(front["power"], front["power_searched"]).clip(upper=1.0)
    return front


def of_grid(results: Path, name: str, space: str) -> pd.DataFrame:
    """The gaits of the grid that swam forwards: in a fluid, or in all fluids their means."""
    grid = table(results, "pareto/grid", f"space == '{space}' and status == 'ok' and speed > 0 and power > 0")
    if name in FLUIDS:
        return grid.loc[grid["fluid"] == name, ["speed", "power"]]
    gaits = grid.groupby(["amplitude", "frequency", "phase"])[["speed", "power"]]
    return gaits.mean()[gaits.size() == len(FLUIDS)]


def switching(results: Path, space: str = "paper") -> pd.DataFrame:
    """Ideal switching between the paper's sinusoids; errors are those of the points combined, by their share of it."""
    rows = of_net_power(table(results, "pareto/switching", f"space == '{space}'"))
    fronts = [sinusoids(results, fluid, space).set_index("point").loc[rows[f"{fluid}_point"]] for fluid in FLUIDS]
    errors = {
        error: sum((front[name] * front[error]).to_numpy() for front in fronts)
        / sum(front[name].to_numpy() for front in fronts)
        for error, name in (("dv", "speed"), ("dp", "power"))
    }
    return rows.assign(**errors)


def points(results: Path) -> pd.DataFrame:
    """The policy at the paper's power, on the robot that it was trained on."""
    swims = table(results, "operating_point/points", "as_trained and method == 'student'")
    return with_errors(swims, ["fluid", "seed"])


def by_fluid(results: Path, column: str) -> pd.DataFrame:
    """A figure of the policy at the paper's power: a row a seed, a column a fluid."""
    return points(results).pivot(index="seed", columns="fluid", values=column)[FLUIDS]


def means(swims: pd.DataFrame, by: int) -> pd.DataFrame:
    """Mean speed and mean power by seed, as errors have it."""
    return if_better(swims, by).groupby("seed")[["speed", "power"]].mean()


def faster(swims: pd.DataFrame, front: pd.DataFrame) -> bool:
    """Whether swims, in the mean over fluids one a seed, are faster than a front at their power."""

    def gains(by: int) -> pd.Series:
        own, others = means(swims, by), if_better(front, -by)
        return own["speed"] / at(others, own["power"])[0] - 1

    return ends(gains(0), largest_error(gains))[0] > 0


def beats_each_fluid(results: Path) -> Parts:
    """In every fluid faster than the front of sinusoids at its power, or at that of the front's fastest point."""
    swims = points(results)
    return [faster(swims[swims["fluid"] == fluid], sinusoids(results, fluid)) for fluid in FLUIDS]


def beats_integrated(results: Path) -> Parts:
    """Its mean speed is higher than that of the front of one sinusoid for all fluids at its mean power."""
    return [faster(points(results), sinusoids(results, "integrated"))]


def beats_switching(results: Path) -> Parts:
    """Its mean speed is higher than that of ideal switching between sinusoids at its mean power."""
    return [faster(points(results), switching(results))]


def cheaper_than_switching(results: Path) -> Parts:
    """Its mean power over its mean speed is less than that of ideal switching at its mean power."""
    swims, front = points(results), switching(results)

    def changes(by: int) -> pd.Series:
        own, others = means(swims, by), if_better(front, -by)
        speed, power = at(others, own["power"])
        return own["power"] / own["speed"] / (power / speed) - 1

    return [ends(changes(0), largest_error(changes))[1] < 0]


def sea_snake(results: Path) -> Parts:
    """It is faster, and has a higher cost of transport, than the sea snakes tuned to each fluid, every seed of both."""
    optima = with_errors(table(results, "sea_snake/optima"), ["objective", "fluid", "seed"])
    own, gaits = points(results), optima[optima["objective"] == optima["fluid"]]
    return [over_gaits(own, gaits, fluid, name)[0] > 1 for fluid in FLUIDS for name in ("speed", "cost_of_transport")]


def over_gaits(own: pd.DataFrame, gaits: pd.DataFrame, fluid: str, column: str) -> tuple[float, float]:
    """The interval of the ratio of a figure of every seed to that of every gait in a fluid."""
    swims, others = (rows[rows["fluid"] == fluid] for rows in (own, gaits))

    def ratios(by: int) -> np.ndarray:
        return np.divide.outer(if_better(swims, by)[column].to_numpy(), if_better(others, -by)[column].to_numpy())

    return welch(ratios(0), largest_error(ratios))


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
    highest = welch(np.divide.outer(symmetric.to_numpy(), teacher.to_numpy()), 0.0)[1]
    return [highest < 1, highest < 0.8]


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
    """The four parts of the rule, which no single gait passes: one gait of a method on each course, in all fluids."""
    by_errors = {by: beside_singles(results, by) for by in (0, 1, -1)}
    swims = by_errors[0]
    singles = swims[swims["tuned_to"] != "adaptive"]
    power = swims[swims["method"] == "student"].groupby("course")["power"].mean()
    chosen = pd.concat([nearest(part, power[course]) for (course, _), part in singles.groupby(["course", "method"])])
    passed = [all(crossed({0: part.assign(seed=0)})) for _, part in chosen.groupby("method")]
    return [*crossed({by: part[part["method"] == "student"] for by, part in by_errors.items()}), not any(passed)]


def crossed(swims: dict[int, pd.DataFrame]) -> Parts:
    """Back in at most 3 s, more than 1 % farther than single gaits, and more than 80 % of the limit's switching."""
    shares = {by: part.groupby("seed")[["gain", "of_limit"]].mean(skipna=False) for by, part in swims.items()}
    parts = [swims[0]["back"].max() <= 3.0]
    for name, bound in {"gain": 0.01, "of_limit": 0.8}.items():
        means = {by: part[name] for by, part in shares.items()}
        several = len(means[0]) > 1
        parts.append((ends(means[0], largest_error(means.__getitem__))[0] if several else means[0].mean()) > bound)
    return parts


def nearest(singles: pd.DataFrame, power: float) -> pd.DataFrame:
    """The gait that takes most power of those that take no more than a power, else the one that takes least."""
    ordered = singles.sort_values("power", kind="stable")
    return (ordered[ordered["power"] <= power].tail(1) if (ordered["power"] <= power).any() else ordered.head(1)).copy()


def beside_singles(results: Path, by: int, column: str = "power") -> pd.DataFrame:
    """Swims of courses: when they are back after a change, gain over single gaits at equal power, share of the limit.

    Lines that are concave join the single gaits; beyond the fastest the comparison is with this one.
    """
    names = ["course", "method", "tuned_to", "seed", "gait"]
    courses = table(results, "adaptation/courses").copy()
    courses["gait"] = courses["gait"].fillna(-1) if "gait" in courses else -1
    swims = with_errors(courses, names).copy()
    swims["distance"] = swims["distance"].where(swims["status"] == "ok")
    swims = swims[(swims["status"] == "ok") | (swims["tuned_to"] == "adaptive")].copy()
    side = by * np.where(swims["tuned_to"] == "adaptive", 1, -1)
    swims["distance"] *= 1 + side * swims["dv"]
    swims[column] *= 1 - side * swims["dp"]
    swims["of_limit"] = swims["distance"] / swims.get("ideal_net", pd.Series(index=swims.index, dtype=float))
    for _, course in swims.groupby("course"):
        corners = concave(course.loc[course["tuned_to"] != "adaptive", [column, "distance"]].to_numpy())
        best = np.interp(course[column], *corners.T, left=np.nan) if len(corners) else np.nan
        swims.loc[course.index, "gain"] = course["distance"] / best - 1
    back = recovered(results).groupby(names, dropna=False)["seconds"].max().rename("back")
    swims = swims.merge(back.reset_index(), "left", names)
    return swims.assign(back=swims["back"].where(swims["status"] == "ok", np.inf))


def concave(points: np.ndarray) -> np.ndarray:
    """The corners of the least concave function above points, up to the highest: no line between two is above them."""
    kept = []
    for k, (power, distance) in enumerate(points):
        others = np.delete(points, k, axis=0)
        if ((others[:, 0] <= power) & (others[:, 1] >= distance)).any():
            continue
        left, right = others[others[:, 0] < power], others[(others[:, 0] > power) & (others[:, 1] > distance)]
        to_left = ((distance - left[:, 1]) / (power - left[:, 0])).min(initial=np.inf)
        to_right = ((right[:, 1] - distance) / (right[:, 0] - power)).max(initial=0.0)
        if to_left > to_right:
            kept.append((power, distance))
    return np.array(sorted(kept)).reshape(-1, 2)


def recovered(results: Path) -> pd.DataFrame:
    """Seconds to the end of the first steady period, infinite without one; 1.0 counted to its beginning."""
    rows = table(results, "adaptation/recoveries").copy()
    if "loss" not in rows or rows["loss"].isna().all():
        who = ["method", "tuned_to", "seed"]
        steady = table(results, "adaptation/steady").rename(columns={"fluid": "to"}).dropna(subset=["to"])
        rows = rows.merge(steady[[*who, "to", "swim_frequency"]], "left", [*who, "to"])
        rows["seconds"] += 1 / rows["swim_frequency"]
    rows["gait"] = rows["gait"].fillna(-1) if "gait" in rows else -1
    return rows.fillna({"seconds": np.inf})


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
