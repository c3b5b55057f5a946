"""Operating point: preference-conditioned policies at the powers at which the paper's policy swims.

The paper lowers the weight of speed during training; its policy takes less power than one trained on its table of
weights. So its claims about gaits are judged at the power of its own policy in each fluid, P = CoT m g v.
"""

from collections.abc import Iterable, Iterator, Sequence
from itertools import product
from typing import NamedTuple

import pandas as pd

from snakebench.errors import InvalidValue
from snakebench.execution import Case, Evaluator
from snakebench.names import ADAPTIVE, COARSE, FINE
from snakebench.policy import Policy
from snakebench.report import paper
from snakebench.scenario import Scenario
from snakebench.simulation import AnyController
from snakebench.studies.contenders import Contender, contenders
from snakebench.studies.operating_point.preference import ROUNDS, Search, Solution, solve
from snakebench.studies.operating_point.settings import OperatingPointConfig
from snakebench.studies.operating_point.tail import tail_amplitudes
from snakebench.studies.protocol import STAND_INS, Load, Outcome, Row, Swim, loads_of, numerics, swim_rows, variants
from snakebench.studies.replays import recorded


class Place(NamedTuple):
    """Where one policy is to take the paper's power: on a robot, in a fluid."""

    pilot: Contender
    diameter: float  # of the robot [m]
    fluid: str

    def labels(self, config: OperatingPointConfig) -> Row:
        """The cells of a table that identify the policy and the robot."""
        robot = {"diameter": self.diameter, "as_trained": self.diameter == config.robot.diameter}
        return {"method": self.pilot.method, "seed": self.pilot.seed} | robot

    def scenario(self, config: OperatingPointConfig, fluid: str | None = None) -> Scenario:
        """There, or in another fluid, in PyBullet with the finer step."""
        return config.scenario(fluid or self.fluid, robot=config.robot.but(diameter=self.diameter))


def plan(config: OperatingPointConfig) -> list[Load]:
    """What the study evaluates, with as many evaluations a search as it takes at most."""
    places = _places(config, [one for one in config.expected() if one.tuned_to == ADAPTIVE])
    gait, replayed = STAND_INS["angle"], STAND_INS["torque"]
    searched = [Case(gait, _planar(config, place)) for place in places for _ in range(ROUNDS)]
    swims = _points(config, places, [Solution(price=1.0, match="", searches=0)] * len(places), [gait] * len(places))
    replays = _replays(config, places, [replayed] * len(places))
    recordings = [Case(gait, place.scenario(config)) for place in places]
    fixed = [case for _, case in _fixed(config) for _ in range(2)]  # swum, and its tail measured
    return loads_of([*searched, *(case for _, case in (*swims, *replays)), *recordings, *fixed])


def run(config: OperatingPointConfig, evaluate: Evaluator) -> Outcome:
    """Solve the preference of every policy, evaluate it there, and replay its gaits in every fluid."""
    pilots = [one for one in contenders(config, evaluate.results) if one.tuned_to == ADAPTIVE]
    places = _places(config, pilots)
    searches = [_search(config, place) for place in places]
    solutions = solve(searches, evaluate, config.tolerance)
    evaluate.work.expect(sum(one.searches for one in solutions) - ROUNDS * len(places))
    solved = [search.policy.at(one.price) for search, one in zip(searches, solutions, strict=True)]
    at_home = [Case(policy, place.scenario(config)) for place, policy in zip(places, solved, strict=True)]
    waveforms = list(evaluate.compute(recorded, at_home))
    evaluate.work.expect(-2 * len(config.fluids) * sum(waveform is None for waveform in waveforms))
    tables = {
        "points": pd.DataFrame(swim_rows(evaluate, _points(config, places, solutions, solved))),
        "matrix": pd.DataFrame(swim_rows(evaluate, _replays(config, places, waveforms))),
        "sinusoid": _sinusoid(config, evaluate),
        "contenders": pd.DataFrame(one.origin() for one in pilots),
    }
    return Outcome(tables, _shown(config, places, at_home))


def _places(config: OperatingPointConfig, pilots: Iterable[Contender]) -> list[Place]:
    return [Place(*place) for place in product(pilots, config.diameters, config.fluids)]


def _search(config: OperatingPointConfig, place: Place) -> Search:
    policy, study = place.pilot.controller, place.pilot.study
    if not isinstance(policy, Policy) or policy.card.prices is None:
        raise InvalidValue(f"{place.pilot.method} of {study} has no preference: those of learned_front have one")
    return Search(
        policy=policy, prices=policy.card.prices, scenario=_planar(config, place), power=_power(config, place)
    )


def _power(config: OperatingPointConfig, place: Place) -> float:
    """At which the paper's policy swims in that fluid [W]."""
    return paper.POLICY[place.fluid].power(config.robot.total_mass)


def _planar(config: OperatingPointConfig, place: Place) -> Scenario:
    return place.scenario(config).but(engine="planar", physics_rate=config.search_rate)


def _points(
    config: OperatingPointConfig,
    places: Sequence[Place],
    solutions: Iterable[Solution],
    solved: Iterable[AnyController],
) -> Iterator[Swim]:
    """Every policy at its preference, with both steps of PyBullet and in planar."""
    for place, solution, policy in zip(places, solutions, solved, strict=True):
        found = {"preference": solution.price, "target_power": _power(config, place), "match": solution.match}
        labels = place.labels(config) | {"fluid": place.fluid} | found | {"searches": solution.searches}
        for variant, here in variants(place.scenario(config), config.search_rate).items():
            yield labels | {"variant": variant} | numerics(here), Case(policy, here)


def _replays(
    config: OperatingPointConfig, places: Sequence[Place], waveforms: Iterable[AnyController | None]
) -> Iterator[Swim]:
    """The torque of every gait in every fluid; a swim without a rhythm left none."""
    rates = {FINE: config.verify_rate, COARSE: config.verify_rate // 2}
    for place, waveform in zip(places, waveforms, strict=True):
        for (variant, rate), fluid in product(rates.items(), config.fluids):
            labels = {"gait_of": place.fluid, "fluid": fluid, "variant": variant, "physics_rate": rate}
            here = place.scenario(config, fluid).but(physics_rate=rate)
            if waveform is not None:
                yield place.labels(config) | labels, Case(waveform, here)


def _fixed(config: OperatingPointConfig) -> Iterator[Swim]:
    """The paper's fixed gait in every fluid, with robots of all diameters."""
    for diameter, fluid in product(config.sinusoid_diameters, config.fluids):
        here = config.scenario(fluid, robot=config.robot.but(diameter=diameter))
        labels = {"diameter": diameter, "fluid": fluid, "physics_rate": here.physics_rate}
        yield labels, Case(paper.SINUSOID, here)


def _sinusoid(config: OperatingPointConfig, evaluate: Evaluator) -> pd.DataFrame:
    swims = list(_fixed(config))
    amplitudes = evaluate.measured(tail_amplitudes, [(case, ()) for _, case in swims])
    labelled = [({**labels, **found}, case) for (labels, case), found in zip(swims, amplitudes, strict=True)]
    return pd.DataFrame(swim_rows(evaluate, labelled))


def _shown(config: OperatingPointConfig, places: Sequence[Place], at_home: Sequence[Case]) -> dict[str, Case]:
    """The first policy on the first robot, in every fluid."""
    first = zip(places[: len(config.fluids)], at_home, strict=False)
    return {f"{place.pilot.method}-{place.fluid}": case for place, case in first}
