"""Cross-environment study: the torque of a gait in one fluid, replayed open loop in another (paper).

Beside it the same gaits and policies in closed loop, so that what the loss of feedback costs is seen apart from what
the wrong gait costs (ours).
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from itertools import product
from typing import Literal, NamedTuple

import numpy as np
import pandas as pd

from snakebench import metrics
from snakebench.controllers import ReplayedTorque
from snakebench.execution import Case, Evaluator
from snakebench.scenario import Scenario
from snakebench.simulation import AnyController, simulate
from snakebench.store import ADAPTIVE, INTEGRATED
from snakebench.studies.config import thinning
from snakebench.studies.contenders import SINUSOIDS, Contender, contenders
from snakebench.studies.cross.settings import CrossConfig
from snakebench.studies.outcome import Outcome
from snakebench.studies.planning import STAND_INS, Load
from snakebench.studies.swim_rows import Swim, loads_of, swim_rows
from snakebench.trajectory import Trajectory

_CYCLES = 2  # of the gait in a recorded waveform (paper)


class Entry(NamedTuple):
    """A controller of the matrix: a contender itself, or its torque recorded in a fluid."""

    method: str
    seed: int
    loop: Literal["open", "closed"]
    gait_of: str  # the fluid where its torque was recorded or that it was tuned to; "adaptive" for a policy itself
    controller: AnyController


def plan(config: CrossConfig) -> list[Load]:
    """What the study evaluates; as many gaits as there are at most."""
    expected = [one for one in config.expected() if one.tuned_to != INTEGRATED]
    recordings = _recordings(config, expected)
    entries = _entries(expected, recordings, [STAND_INS["torque"] for _ in recordings])
    return loads_of([*(case for *_, case in recordings), *(case for _, case in _swims(config, entries))])


def run(config: CrossConfig, evaluate: Evaluator) -> Outcome:
    """Record every gait where it belongs, and let every waveform and every gait swim in every fluid.

    Returns:
        Two tables and swims:

        - `matrix`: every gait in every fluid at two physics rates: `loop` "open" for the replayed torque of `gait_of`,
          "closed" for the controller itself, which for a gait tracks its own targets and for a policy adapts;
        - `contenders`: what was compared, and where it comes from;
        - METHOD-FLUID, replayed-GAIT-FLUID: the first policy's first seed and the paper's best sinusoids in each
          fluid, and that policy's gait of one fluid replayed in another, 30 rows a second.

    Raises:
        InvalidValue: when the results of a study to be compared are missing.
    """
    compared = [one for one in contenders(config, evaluate.results) if one.tuned_to != INTEGRATED]
    recordings = _recordings(config, compared)
    entries = _entries(compared, recordings, evaluate.compute(_recorded, [case for *_, case in recordings]))
    swims = list(_swims(config, entries))
    evaluate.work.expect(len(recordings) + len(swims) - sum(load.times for load in plan(config)))
    tables = {
        "matrix": pd.DataFrame(swim_rows(evaluate, swims)),
        "contenders": pd.DataFrame(contender.origin() for contender in compared),
    }
    return Outcome(tables, dict(_shown(config, entries)))


def replay(trajectory: Trajectory, frequency: float) -> ReplayedTorque:
    """The command torque of the last two gait periods of a run as a periodic waveform, resampled at its own rate.

    Args:
        trajectory: of a gait that has settled, at the engine's physics rate.
        frequency: of the gait [Hz].
    """
    period = _CYCLES / frequency
    n = max(round(period * trajectory.rate), 2)
    last = trajectory.time[-1] - 1 / trajectory.rate  # the torque of the last row was never held
    times = last - period + np.arange(n) * period / n
    torque = [np.interp(times, trajectory.time, joint) for joint in trajectory.command_torque.T]
    return ReplayedTorque(period=period, torque=tuple(map(tuple, np.transpose(torque).tolist())))


def _recordings(config: CrossConfig, compared: Sequence[Contender]) -> list[tuple[Contender, str, Case]]:
    """The swims whose torque is recorded, and in which fluid: a policy's in every one, a gait's where it belongs."""
    return [
        (one, fluid, Case(one.controller, config.scenario(fluid)))
        for one, fluid in product(compared, config.fluids)
        if one.tuned_to in (ADAPTIVE, fluid)
    ]


def _entries(
    compared: Sequence[Contender],
    recordings: Sequence[tuple[Contender, str, Case]],
    waveforms: Iterable[AnyController | None],
) -> list[Entry]:
    """Every contender in closed loop, then its recorded torques; a swim without a rhythm leaves none."""
    entries = [Entry(one.method, one.seed, "closed", one.tuned_to, one.controller) for one in compared]
    for (one, fluid, _), waveform in zip(recordings, waveforms, strict=True):
        if waveform is not None:
            entries.append(Entry(one.method, one.seed, "open", fluid, waveform))
    return entries


def _swims(config: CrossConfig, entries: Sequence[Entry]) -> Iterator[Swim]:
    rates = {"finer step": config.verify_rate, "coarser step": config.coarser}
    for (variant, rate), entry, fluid in product(rates.items(), entries, config.fluids):
        labels = entry._asdict() | {"fluid": fluid, "variant": variant, "physics_rate": rate}
        yield labels, Case(labels.pop("controller"), config.scenario(fluid, physics_rate=rate))


def _recorded(controller: AnyController, scenario: Scenario) -> ReplayedTorque | None:
    """What a worker does: the waveform of a swim; None when it has no rhythm or diverged."""
    swim = simulate(controller, scenario)
    frequency = metrics.swim_frequency(swim)
    if swim.diverged or frequency is None or frequency * scenario.duration < _CYCLES:
        return None
    return replay(swim, frequency)


def _shown(config: CrossConfig, entries: list[Entry]) -> Iterator[tuple[str, Trajectory]]:
    """Swims of the first policy's first seed and of the paper's best sinusoids where they belong, and its replays."""
    policy = config.pilots[0], config.seeds[0]
    for fluid, entry in product(config.fluids, entries):
        itself = entry.loop == "closed"
        of_sinusoids = entry.method == SINUSOIDS[0] and itself and entry.gait_of == fluid
        if of_sinusoids or (entry.method, entry.seed) == policy:
            name = f"{entry.method}-{fluid}" if itself else f"replayed-{entry.gait_of}-{fluid}"
            swim = simulate(entry.controller, config.scenario(fluid))
            yield name, swim.thinned(2 * thinning(config.verify_rate))
