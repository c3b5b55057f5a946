"""Who swims the courses: policies, preference-conditioned policies, and single gaits, chosen in the planar engine."""

from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from functools import partial
from itertools import product
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from snakebench.collocation.front import gait_at, of_first_bounds
from snakebench.collocation.ideal import upper_hull
from snakebench.controllers import GAITS, Gait
from snakebench.errors import InvalidValue
from snakebench.execution import Case, Evaluator
from snakebench.names import ADAPTIVE, CURRENCIES, EXTENDED, FINE, INTEGRATED
from snakebench.scenario import Scenario
from snakebench.studies.adaptation.recovery import course_swim
from snakebench.studies.adaptation.settings import AdaptationConfig
from snakebench.studies.columns import WAVEFORM
from snakebench.studies.contenders import (
    FRONTS,
    USUAL_SEEDS,
    Best,
    Contender,
    Reader,
    limit_tables,
    policy_in,
    read_contenders,
)
from snakebench.studies.protocol import STAND_INS
from snakebench.tables import Columns, fourier_gait, parametric_gait, read_table, table_file

_LEAST_POWER = 0.3  # mean power from which single gaits are tried, that from which the limit is known [W]
_DIAL: Columns = {"policy": str, "variant": str, "seed": int, "price": float, "power": float | None}
_CHOSEN = 12  # candidates of a method that swim a course in PyBullet, about


class Swimmers(NamedTuple):
    """Who is compared."""

    compared: list[Contender]  # over viscosity
    preferred: list[Contender]  # preference-conditioned policies
    tried: list[Contender]  # candidates for single gaits
    chosen: Mapping[str, list[Contender]]  # of these, by course

    def on(self, course: str) -> list[Contender]:
        """Who swims a course: policies, single gaits that were chosen, and those of methods without candidates."""
        methods = {one.method for one in self.tried}
        singles = [one for one in self.compared if one.tuned_to == INTEGRATED and one.method not in methods]
        policies = [one for one in self.compared if one.tuned_to == ADAPTIVE]
        return [*policies, *self.preferred, *singles, *self.chosen[course]]

    def further(self) -> list[Contender]:
        """Who swims courses, but not over viscosity."""
        return [*self.preferred, *dict.fromkeys(one for part in self.chosen.values() for one in part)]


def expected(config: AdaptationConfig) -> Swimmers:
    """Stand-ins for everyone; a study of other gaits counts as one space, and about a dozen gaits of it are chosen."""
    studies = config.contenders
    angle, torque = (Contender("", INTEGRATED, 0, STAND_INS[drives], "", None, 0) for drives in ("angle", "torque"))
    kinds = [torque] * bool(studies.sinusoids) + [angle] * (
        bool(studies.waveforms) + len(studies.gaits) + bool(studies.limit)
    )
    each = config.candidates * (len(config.fluids) + 1)  # of the limit, which has more viscosities, there are more
    each_power = len(config.seeds or USUAL_SEEDS) * sum(map(len, config.preferred.values()))
    policies = [angle] * (len(config.powers) * each_power)
    tried, chosen = ([one for one in kinds for _ in range(count)] for count in (each, min(each, _CHOSEN)))
    return Swimmers(config.expected(), policies, tried, dict.fromkeys(config.courses, chosen))


def preferred(config: AdaptationConfig, results: Path) -> list[Contender]:
    """Policies with an adjustable preference, at those of some mean powers P over the fluids."""
    readers = [(study, partial(_preferred, name=name)) for study, names in config.preferred.items() for name in names]
    return read_contenders(config, results, readers)


def _preferred(config: AdaptationConfig, directory: Path, manifest: Mapping[str, Any], name: str) -> Iterator[Best]:
    swims = read_table(directory / "dial.csv", _DIAL)
    swims = swims[(swims["policy"] == name) & (swims["variant"] == FINE)]
    if swims.empty:
        raise InvalidValue(f"preferred: {directory} has no policy {name} with an adjustable preference")
    means = swims.groupby(["seed", "price"])["power"].mean(skipna=False)
    there = means.index.unique("seed")
    for power, seed in product(config.powers, map(int, config.seeds or there)):
        if seed not in there:
            known = ", ".join(map(str, there)) or "none"
            raise InvalidValue(f"seeds = {seed}: {directory} has no {name} of it: {known} are there")
        policy = policy_in(directory, manifest, name, seed)
        distance = (means[seed] - power).abs().fillna(np.inf)  # diverged swims have no power
        yield f"{name}_{power:g}_W", ADAPTIVE, seed, policy.at(float(distance.idxmin()))


def candidates(config: AdaptationConfig, results: Path) -> list[Contender]:
    """Gaits of the fronts of each fluid and of all, from each at most `config.candidates`, spread over the powers.

    Those of the limit are of all its viscosities. They are numbered within their method; each gait is one of them once.
    """
    studies = config.contenders
    readers: list[tuple[str, Reader]] = [
        (studies.sinusoids, partial(_on_fronts, spaces=[EXTENDED])),
        (studies.waveforms, _on_fronts),
        *((study, _on_fronts) for study in studies.gaits),
        (studies.limit, _of_the_limit),
    ]
    once, numbers = dict[str, Contender](), Counter[str]()
    for one in read_contenders(config, results, readers):
        once.setdefault(one.controller.digest(), one)
    for digest, one in once.items():
        once[digest] = one._replace(gait=numbers[one.method])
        numbers[one.method] += 1
    return list(once.values())


def _on_fronts(
    config: AdaptationConfig, directory: Path, manifest: Mapping[str, Any], spaces: Sequence[str] = ()
) -> Iterator[Best]:
    fronts = read_table(directory / "fronts.csv", FRONTS)
    usable = fronts[(fronts["power"] >= _LEAST_POWER) & (fronts["power"] < config.reference[1])]
    gait = _gaits_of(directory, manifest)
    for (space, front, _), part in usable.groupby(["space", "front", "currency"], sort=False):
        if not spaces or space in spaces:
            for _, row in _spread(part, config.candidates).iterrows():
                yield str(space), str(front), 0, gait(row)


def _of_the_limit(config: AdaptationConfig, directory: Path, manifest: Mapping[str, Any]) -> Iterator[Best]:
    """Gaits of the limit under its first bounds."""
    limit, gaits = (of_first_bounds(table, manifest["config"]) for table in limit_tables(directory))
    usable = limit[(limit["power"] >= _LEAST_POWER) & (limit["power"] < config.reference[1])]
    for (viscosity, _), part in usable.groupby(["viscosity", "currency"], sort=False):
        for _, row in _spread(part, config.candidates).iterrows():
            tuned_to = row["fluid"] if isinstance(row["fluid"], str) else f"{viscosity:.3g} m²/s"
            yield "limit", tuned_to, 0, gait_at(gaits, row)


def _gaits_of(directory: Path, manifest: Mapping[str, Any]) -> Callable[[pd.Series], Gait]:
    """How the gait of a row of a front is made: of its parameters, or of the coefficients that its search found."""
    if not table_file(directory / "gaits.csv").exists():
        return partial(parametric_gait, GAITS.named(manifest["config"]["gait"]))
    gaits = read_table(directory / "gaits.csv")
    search = list(WAVEFORM)
    by_search = {_cells(key): rows for key, rows in gaits.groupby(search, dropna=False)}
    return lambda row: fourier_gait(by_search[_cells(row[name] for name in search)])


def _cells(values: Iterable[Any]) -> tuple[str, ...]:
    """Cells of a row as text; whole numbers as others, and all that are not known alike."""
    return tuple(value if isinstance(value, str) else str(float(value)) for value in values)


def _spread(front: pd.DataFrame, count: int) -> pd.DataFrame:
    """So many rows of a front at most, with equal ratios of their powers as far as there are rows."""
    ordered = front.sort_values("power", kind="stable")
    powers = ordered["power"].to_numpy(float)
    wanted = np.searchsorted(powers, np.geomspace(powers[0], powers[-1], count))
    return ordered.iloc[np.unique(np.minimum(wanted, len(powers) - 1))]


def chosen(evaluate: Evaluator, tried: Sequence[Contender], places: dict[str, Scenario]) -> dict[str, list[Contender]]:
    """Of each course the candidates that are a corner of their method's envelope there, in either currency.

    All of them swim it; `places` are the courses in the planar engine.
    """
    nothing = (False, list[Any]())  # neither traces nor recoveries
    asked = [(Case(one.controller, place), nothing) for place, one in product(places.values(), tried)]
    totals = pd.DataFrame([swim["totals"] for swim in evaluate.measured(course_swim, asked)])
    parts = {name: totals[k * len(tried) : (k + 1) * len(tried)] for k, name in enumerate(places)}
    return {name: [tried[place] for place in _corners(part, tried)] for name, part in parts.items()}


def _corners(swims: pd.DataFrame, tried: Sequence[Contender]) -> list[int]:
    places = set[int]()
    for method in dict.fromkeys(one.method for one in tried):
        own = np.array([k for k, one in enumerate(tried) if one.method == method])
        rows = swims.iloc[own]
        valid = rows["distance"].where((rows["status"] == "ok") & (rows["distance"] > 0)).to_numpy(float)
        for column in CURRENCIES.values():
            places |= set(own[upper_hull(rows[column].to_numpy(float), valid)].tolist())
    return sorted(places)
