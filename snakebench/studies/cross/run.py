"""Cross-environment study: the torque of a gait in one fluid, replayed open loop in another (paper)."""

from collections.abc import Iterable, Iterator, Sequence
from itertools import product

import pandas as pd

from snakebench.execution import Case, Evaluator
from snakebench.names import ADAPTIVE, COARSE, FINE, INTEGRATED
from snakebench.simulation import AnyController
from snakebench.studies.contenders import SINUSOIDS, Contender, contenders
from snakebench.studies.cross.settings import CrossConfig
from snakebench.studies.protocol import STAND_INS, Load, Outcome, Swim, loads_of, swim_rows
from snakebench.studies.replays import recorded

Entry = tuple[str, Contender]  # the loop, and a contender ("closed") or its torque in the fluid of `tuned_to` ("open")


def plan(config: CrossConfig) -> list[Load]:
    """What the study evaluates; as many gaits as there are at most."""
    expected = [one for one in config.expected() if one.tuned_to != INTEGRATED]
    recordings = _recordings(config, expected)
    entries = _entries(expected, recordings, [STAND_INS["torque"]] * len(recordings))
    return loads_of([*_recorded_swims(config, recordings), *(case for _, case in _swims(config, entries))])


def run(config: CrossConfig, evaluate: Evaluator) -> Outcome:
    """Record the torque of every gait, and evaluate every recording and every gait itself in every fluid."""
    compared = [one for one in contenders(config, evaluate.results) if one.tuned_to != INTEGRATED]
    recordings = _recordings(config, compared)
    entries = _entries(compared, recordings, evaluate.compute(recorded, _recorded_swims(config, recordings)))
    swims = list(_swims(config, entries))
    evaluate.work.expect(len(recordings) + len(swims) - sum(load.times for load in plan(config)))
    matrix, origins = pd.DataFrame(swim_rows(evaluate, swims)), pd.DataFrame(one.origin() for one in compared)
    return Outcome({"matrix": matrix, "contenders": origins}, dict(_shown(config, entries)))


def _recordings(config: CrossConfig, compared: Sequence[Contender]) -> list[Contender]:
    """Whose torque is recorded in the fluid of `tuned_to`: a policy's in every fluid, a gait's where it belongs."""
    pairs = product(compared, config.fluids)
    return [one._replace(tuned_to=fluid) for one, fluid in pairs if one.tuned_to in (ADAPTIVE, fluid)]


def _recorded_swims(config: CrossConfig, recordings: Iterable[Contender]) -> list[Case]:
    return [Case(one.controller, config.scenario(one.tuned_to)) for one in recordings]


def _entries(
    compared: Iterable[Contender], recordings: Iterable[Contender], waveforms: Iterable[AnyController | None]
) -> list[Entry]:
    """Every contender in closed loop, then its recorded torques; a swim without a rhythm leaves none."""
    pairs = list(zip(recordings, waveforms, strict=True))
    replays = [("open", one._replace(controller=waveform)) for one, waveform in pairs if waveform is not None]
    return [*(("closed", one) for one in compared), *replays]


def _swims(config: CrossConfig, entries: Sequence[Entry]) -> Iterator[Swim]:
    rates = {FINE: config.verify_rate, COARSE: config.verify_rate // 2}
    for (variant, rate), (loop, one), fluid in product(rates.items(), entries, config.fluids):
        gait = {"method": one.method, "seed": one.seed, "loop": loop, "gait_of": one.tuned_to}
        labels = gait | {"fluid": fluid, "variant": variant, "physics_rate": rate}
        yield labels, Case(one.controller, config.scenario(fluid, physics_rate=rate))


def _shown(config: CrossConfig, entries: Sequence[Entry]) -> Iterator[tuple[str, Case]]:
    """Swims of the first seed of the first of the pilots and of its replays, and of each fluid's best sinusoid."""
    first = min((one.seed for _, one in entries if one.method == config.pilots[0]), default=None)
    for fluid, (loop, one) in product(config.fluids, entries):
        best_sinusoid = loop == "closed" and (one.method, one.tuned_to) == (SINUSOIDS[0], fluid)
        if best_sinusoid or (one.method, one.seed) == (config.pilots[0], first):
            name = f"{one.method}-{fluid}" if loop == "closed" else f"replayed-{one.tuned_to}-{fluid}"
            yield name, Case(one.controller, config.scenario(fluid))
