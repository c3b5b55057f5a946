"""README's findings a second time: from the tables of results with pandas, importing nothing of snakebench."""

from __future__ import annotations

import json
import tomllib
from collections.abc import Callable, Iterable
from functools import partial
from itertools import product
from pathlib import Path

import numpy as np
import pandas as pd
from comparison_audit import (
    FLUIDS,
    apart,
    at,
    beside_singles,
    ends,
    if_better,
    largest_error,
    means,
    of_net_power,
    points,
    recovered,
    sinusoids,
    switching,
    table,
    verdicts,
    with_errors,
)
from scipy import stats

CURRENCIES = {"net": "power", "positive": "positive_power"}
COURSE_POWERS = (1, 3, 5, 10)  # to which policies with an adjustable preference are set in changing fluids [W]
THROUGH = {  # policies in changing fluids, by the currency of power at which they are compared with single gaits
    "net": ["student", *(f"{name}_{power}_W" for name in ("student", "imitator") for power in COURSE_POWERS)],
    "positive": [
        "student",
        *(f"student_{power}_W" for power in COURSE_POWERS),
        *(f"imitator_positive_{power}_W" for power in COURSE_POWERS[1:]),  # at 1 W, some need less than any gait
    ],
}
OWN = {"speed": ".3f", "power": ".1f"}  # what is told of the student
ABLATED = [10, 11, 12]  # seeds of most ablations
EARNING = ("teacher", "asymmetric_critic", "symmetric", "symmetric_long")  # policies whose returns are told
TASKS = ["known", "unknown", "changing", "robust"]
POWER = 5.0  # at which preference-conditioned students are compared [W]


def findings(results: Path) -> list[str]:
    """The values of the table of findings, in its order."""
    fronts = {name: sinusoids(results, name) for name in FLUIDS}
    at_paper, returns = points(results), recovered(results).query("method == 'student'").groupby("seed")["seconds"]

    def own(fluid: str, by: int) -> pd.DataFrame:
        students = bounded_swims(results, "student")
        return if_better(students[students["fluid"] == fluid], by)

    def gain(fluid: str, by: int) -> np.ndarray:
        return over(own(fluid, by), if_better(fronts[fluid], -by))

    def preference(fluid: str, by: int) -> np.ndarray:
        return preferred(results, fluid, by=by)[:, 0] / at(if_better(fronts[fluid], -by), [POWER])[0][0] - 1

    def as_paper(fluid: str, by: int) -> np.ndarray:
        return over(if_better(at_paper[at_paper["fluid"] == fluid], by), if_better(fronts[fluid], -by))

    def over_switching(by: int) -> np.ndarray:
        return over(means(at_paper, by), if_better(switching(results), -by))

    def share(fluid: str, by: int) -> np.ndarray:
        return 100 * preferred(results, fluid, by=by)[:, 0] / limit(results, fluid)

    gains = {by: beyond_sinusoids(results, by) for by in (0, 1, -1)}
    courses = {name: {by: beyond_singles(results, name, by) for by in (0, 1, -1)} for name in CURRENCIES}
    return [
        *(bounded(lambda by, of=fluid: own(of, by)["speed"], ".3f", "m/s") for fluid in FLUIDS),
        *(percent(partial(part, fluid)) for part in (gain, preference, as_paper) for fluid in FLUIDS),
        percent(over_switching),
        *(percent(lambda by, k=k: gains[by][k]) for k in range(len(gains[0]))),
        *(bounded(lambda _, part=seconds: part, ".1f", "s") for seconds in (returns.mean(), returns.max())),
        *(bounded(partial(share, fluid), ".1f", "%") for fluid in FLUIDS),
        *(
            bounded(lambda by, of=(fluid, which): imitating(results, *of, by=by), ".1f", "%")
            for which, fluid in product(CURRENCIES, FLUIDS)
        ),
        *(
            bounded(lambda by, known=courses[name], of=policy: 100 * known[by][of], "+.1f", "%")
            for name, policies in THROUGH.items()
            for policy in policies
        ),
        *(bounded(lambda _, of=policy: earned(results, of), ".1f", "") for policy in EARNING),
        *(bounded(partial(limited, results, fluid), "+.1f", "%") for fluid in FLUIDS),
    ]


def sentences(results: Path) -> list[str]:
    """Parts of the sentences below the table."""
    water, oil1, oil2 = (f"{slower_below(results, fluid):.1f} W in {fluid}" for fluid in FLUIDS)
    own = swims(results, "student").groupby("fluid", sort=False)[["speed", "power"]].mean()
    speeds, powers = ([f"{own[name][fluid]:{form}}" for fluid in FLUIDS] for name, form in OWN.items())
    entry = swims(results, "student").query("seed == 10").set_index("fluid")["positive_power"]
    paid = [f"{entry[fluid]:.0f}" for fluid in FLUIDS]
    told = list(verdicts(results).values())
    counts = [told.count(verdict) for verdict in ("reproduced", "in part", "not")]
    thrifty = [f"{np.mean(imitating(results, fluid, 'positive', 3.0)):.0f}" for fluid in FLUIDS]
    gains = {name: 100 * beyond_singles(results, name).groupby("method").mean() for name in CURRENCIES}
    farther = [f"{gains['net'][f'imitator_{power}_W']:.0f}" for power in COURSE_POWERS[1:]]
    imitators = [f"imitator_positive_{power}_W" for power in COURSE_POWERS[1:]]
    at_positive = "{:.0f}, {:.0f} and {:.0f}".format(*gains["positive"][imitators])
    longest = recovered(results).groupby(["method", "seed"])["seconds"].max().groupby("method").mean()
    back = [f"{longest[f'{name}_5_W']:.1f} s" for name in ("imitator", "student")]
    rewarded, losses = (
        sorted(gains[currency][name] for name in THROUGH[currency] if name.startswith("student"))
        for currency in CURRENCIES
    )
    swum = table(results, "adaptation/courses", "variant == 'finer step'").groupby("method")["positive_power"].mean()
    paid_for = "{:.0f}, {:.0f} and {:.0f}".format(*swum[imitators])
    return [
        f"swim {farther[0]}, {farther[1]} and {farther[2]} % farther than the best tested fixed gait",
        f"gain {at_positive} % at about {paid_for} W of it",
        f"between {-rewarded[0]:.0f} % less far and {rewarded[-1]:.0f} % farther",
        f"{-losses[-1]:.0f} to {-losses[0]:.0f} % less far at equal positive power",
        f"reaches {speeds[0]} m/s at {powers[0]} W in water, {speeds[1]} at {powers[1]} in oil1 and {speeds[2]} at"
        f" {powers[2]} in oil2",
        f"the student at {paid[0]} W of P⁺ in water, {paid[1]} W in oil1 and {paid[2]} W in oil2",
        f"Of {len(told)} claims of the paper, {counts[0]} are reproduced",
        f"{counts[1]} in part (some hold) and {counts[2]} not",
        f"Below {water}, {oil1} and {oil2}, sinusoids are faster than the preference-conditioned student.",
        f"at 3 W of P⁺ those for P⁺ reach {thrifty[0]}, {thrifty[1]} and {thrifty[2]} % of the limit",
        f"those for P is {back[0]}, that of the preference-conditioned student {back[1]}",
    ]


def leaderboard(directory: Path) -> list[str]:
    """The rows of the leaderboard, from the scores of all swims: the best first, without those that have no place."""
    rows = []
    for path in directory.glob("*/score.json"):
        card = tomllib.loads((path.parent / "card.toml").read_text(encoding="utf-8"))
        swims = pd.DataFrame(json.loads(path.read_text(encoding="utf-8"))["swims"])
        of_tasks = [swims.loc[swims["task"] == task, "score"].to_numpy() for task in TASKS]
        if card["information"] != "privileged" and all(len(part) for part in of_tasks):
            means, half = [part.mean() for part in of_tasks], np.hypot.reduce([drawn(part) for part in of_tasks[1:]])
            cells = [card["name"], card["information"], *(f"{mean:.3f}" for mean in (*means, np.mean(means)))]
            rows.append((np.mean(means), f"| {' | '.join(cells)} ± {half / len(TASKS):.3f} |"))
    return [row for _, row in sorted(rows, reverse=True)]


def drawn(scores: np.ndarray) -> float:
    """Half the 95 % interval of a mean over draws, one of each part of a range: neighbours differ by their draws."""
    differences = np.array([second - first for first, second in zip(scores[::2], scores[1::2], strict=False)])
    n = len(differences)
    return stats.t.ppf(0.975, n) * np.sqrt((differences**2).sum()) / (2 * n)


def earned(results: Path, policy: str) -> pd.Series:
    """The return of a policy over the viscosities, by seed of ablations."""
    study = "ablations" if policy in ("asymmetric_critic", "symmetric_long") else "teacher_student"
    rows = table(results, f"{study}/range", f"policy == '{policy}' and seed in {ABLATED}")
    return rows.groupby("seed")["return"].mean()


def limited(results: Path, fluid: str, by: int) -> pd.Series:
    """How much faster students with limited torque are in a fluid than usual ones of the same seeds [%]."""
    own = with_errors(table(results, "ablations/evaluations", "policy == 'limited_student'"), ["fluid", "seed"])
    usual = bounded_swims(results, "student")
    own, usual = (part[part["fluid"] == fluid].set_index("seed").loc[ABLATED] for part in (own, usual))
    return 100 * (if_better(own, by)["speed"] / if_better(usual, -by)["speed"] - 1)


def percent(gains: Callable[[int], pd.Series | np.ndarray]) -> str:
    """The mean of gains, with half its interval and the largest effect of errors."""
    return bounded(lambda by: 100 * np.asarray(gains(by)), "+.0f", "%")


def bounded(values: Callable[[int], pd.Series | np.ndarray], form: str, unit: str) -> str:
    """The mean of values, one a seed, with half its interval, wider by the largest effect of errors (1, -1)."""
    known = pd.Series(np.ravel(values(0)))
    error = largest_error(lambda by: np.ravel(values(by)))
    half = error + (ends(known)[1] - known.mean() if len(known) > 1 else 0.0)
    return f"{known.mean():{form}} ± {half:{form.removeprefix('+')}} {unit}".strip()


def bounded_swims(results: Path, policy: str) -> pd.DataFrame:
    """The published swims of a policy in the three fluids, with their errors."""
    return with_errors(table(results, "teacher_student/evaluations", f"policy == '{policy}'"), ["fluid", "seed"])


def swims(results: Path, policy: str) -> pd.DataFrame:
    """The published swims of a policy in the three fluids."""
    return table(results, "teacher_student/evaluations", f"variant == 'finer step' and policy == '{policy}'")


def over(own: pd.DataFrame, front: pd.DataFrame) -> np.ndarray:
    """Gains in speed over a front at the same power."""
    return own["speed"].to_numpy() / at(front, own["power"])[0] - 1


def preferred(results: Path, fluid: str, powers: Iterable[float] = (POWER,), by: int = 0) -> np.ndarray:
    """Speeds of the preference-conditioned students, a row a seed, a column a power."""
    fronts = of_net_power(table(results, "learned_front/fronts", f"front == '{fluid}'"))
    own = if_better(between_engines(fronts[fronts["space"].str.startswith("student")]), by)
    return np.array([at(front, powers)[0] for _, front in own.groupby("space")])


def between_engines(front: pd.DataFrame) -> pd.DataFrame:
    """A front with the differences of its points to the engine in which they were searched as errors."""
    errors = {
        "dv": apart(front["speed"], front["speed_searched"]),
        "dp": apart(front["power"], front["power_searched"]),
    }
    return front.assign(**{name: error.clip(upper=1.0) for name, error in errors.items()})


def imitating(
    results: Path, fluid: str, currency: str, power: float = POWER, by: int = 0, study: str = "imitation"
) -> np.ndarray:
    """Speeds of the policies that use the limit's gaits of a currency, as shares of the limit [%]."""
    policy = {"imitation": "imitator", "gain_schedule": "schedule"}[study] + "_positive" * (currency == "positive")
    where = f"front == '{fluid}' and currency == '{currency}' and method == '{policy}'"
    fronts = table(results, f"{study}/fronts", where)
    fronts["power"], fronts["power_searched"] = (fronts[f"{CURRENCIES[currency]}{end}"] for end in ("", "_searched"))
    fronts = if_better(between_engines(fronts), by)
    speeds = [at(front, [power])[0][0] for _, front in fronts.groupby("seed")]
    return 100 * np.array(speeds) / limit(results, fluid, currency, power)


def limit(results: Path, fluid: str, currency: str = "net", power: float = POWER) -> float:
    """The limit's speed at a power."""
    rows = table(results, "limit/limit", f"bounds == 'policies' and currency == '{currency}' and fluid == '{fluid}'")
    rows = rows.sort_values(CURRENCIES[currency])
    return float(np.interp(np.log(power), np.log(rows[CURRENCIES[currency]]), rows["speed"]))


def slower_below(results: Path, fluid: str) -> float:
    """Power from which on preference-conditioned students are faster than sinusoids, in the mean over the seeds [W]."""
    powers = np.arange(0.1, 6.0, 0.01)
    faster = np.mean(preferred(results, fluid, powers), axis=0) > at(sinusoids(results, fluid), powers)[0]
    return float(powers[~faster].max())


def beyond_sinusoids(results: Path, by: int) -> list[np.ndarray]:
    """Gains in mean speed over ideal switching among the paper's sinusoids, at the student's mean power, by seed."""
    own = {policy: means(bounded_swims(results, policy), by) for policy in ("teacher", "student")}
    power = [own["student"]["power"].mean()]
    wider = if_better(switching(results, "extended"), by)
    names = ["tuned_to", "harmonics", "objective", "price"]
    optima = table(results, "fourier/optima", "status == 'ok'")
    optima = if_better(with_errors(optima.fillna({"price": -1.0}), [*names, "fluid", "seed"]), by)
    free = [at(switched(part), power)[0][0] for _, part in optima.groupby("seed")]
    singles = optima[optima["tuned_to"] == "integrated"].groupby(["seed", *names])[["speed", "power"]].mean()
    single = [at(part, power)[0][0] for _, part in singles.groupby("seed")]
    compared = at(wider, power)[0], free, own["teacher"]["speed"], own["student"]["speed"], single
    paper = at(if_better(switching(results), -by), power)[0][0]
    return [np.array(speeds) / paper - 1 for speeds in compared]


def switched(optima: pd.DataFrame) -> pd.DataFrame:
    """Ideal switching of the waveforms tuned to each fluid: all combinations, of the better ones."""
    fronts = []
    for fluid in FLUIDS:
        own = optima[(optima["tuned_to"] == fluid) & (optima["fluid"] == fluid)].sort_values("power")
        fronts.append(own[own["speed"] > own["speed"].cummax().shift(fill_value=-1.0)][["speed", "power"]].to_numpy())
    return pd.DataFrame([np.mean(part, axis=0) for part in product(*fronts)], columns=["speed", "power"])


def beyond_singles(results: Path, currency: str = "net", by: int = 0) -> pd.Series:
    """Gains of policies over the best single gait at equal power, means over the courses, by method and seed."""
    gains = beside_singles(results, by, CURRENCIES[currency])
    return gains[gains["tuned_to"] == "adaptive"].groupby(["method", "seed"])["gain"].mean()
