"""Cross-environment study: the torque of a gait in one fluid, replayed open loop in another (paper).

Beside it the same gaits and policies in closed loop, so that what the loss of feedback costs is seen apart from what
the wrong gait costs (ours).
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Literal, NamedTuple

import numpy as np
import pandas as pd

from snakebench import metrics
from snakebench.controllers import ReplayedTorque
from snakebench.execution import Case, Evaluator
from snakebench.fluid import named_fluid
from snakebench.scenario import Scenario
from snakebench.simulation import AnyController, simulate
from snakebench.store import ADAPTIVE, INTEGRATED
from snakebench.studies.config import thinning
from snakebench.studies.contenders import SINUSOIDS, Contender, contenders
from snakebench.studies.cross.settings import CrossConfig
from snakebench.studies.planning import Load
from snakebench.studies.swim_rows import Row, swim_rows
from snakebench.trajectory import Trajectory

_CYCLES = 2  # of the gait in a recorded waveform (paper)


class Entry(NamedTuple):
    """A swim of the matrix."""

    contender: Contender
    loop: Literal["open", "closed"]
    gait_of: str  # the fluid where its torque was recorded or that it was tuned to; "adaptive" for a policy itself
    controller: AnyController

    def about(self) -> Row:
        """What names it in the table."""
        one = self.contender
        return {"method": one.method, "seed": one.seed, "loop": self.loop, "gait_of": self.gait_of}


def plan(config: CrossConfig) -> list[Load]:
    """What the study evaluates; as many gaits as there are at most."""
    n, count, pilots = len(config.fluids), config.expected(), config.n_policies
    tuned = {"angle": (count["angle"] - pilots) * n // (n + 1), "torque": count["torque"] * n // (n + 1)}
    recorded = tuned["angle"] + tuned["torque"] + pilots * n
    fine = config.scenario(config.fluids[0])
    loads = [Load("angle", fine, recorded)]
    for scenario in (fine, fine.but(physics_rate=config.coarser)):
        loads.append(Load("angle", scenario, (tuned["angle"] + pilots) * n))
        loads.append(Load("torque", scenario, (tuned["torque"] + recorded) * n))
    return [load for load in loads if load.times]


def run(config: CrossConfig, evaluate: Evaluator) -> tuple[dict[str, pd.DataFrame], dict[str, Trajectory]]:
    """Record every gait where it belongs, and let every waveform and every gait swim in every fluid.

    Returns:
        Two tables and the runs that the report shows:

        - `matrix`: every gait in every fluid at two physics rates: `loop` "open" for the replayed torque of `gait_of`,
          "closed" for the controller itself, which for a gait tracks its own targets and for a policy adapts;
        - `contenders`: what was compared, and where it comes from;
        - METHOD-FLUID, replayed-GAIT-FLUID: the first policy's first seed and the paper's best sinusoids in each
          fluid, and that policy's gait of one fluid replayed in another, 30 rows a second.

    Raises:
        InvalidValue: when what is to be compared was not found yet.
    """
    compared = [one for one in contenders(config, evaluate.results) if one.tuned_to != INTEGRATED]
    entries = list(_entries(config, evaluate, compared))
    asked = [
        (
            entry.about() | {"fluid": fluid, "variant": variant, "physics_rate": scenario.physics_rate},
            Case(entry.controller, scenario.but(fluid=named_fluid(fluid))),
        )
        for variant, scenario in _variants(config).items()
        for entry in entries
        for fluid in config.fluids
    ]
    evaluate.expect(len(asked) - sum(load.times for load in plan(config)[1:]))
    tables = {
        "matrix": pd.DataFrame(swim_rows(evaluate, asked)),
        "contenders": pd.DataFrame(contender.origin() for contender in compared),
    }
    return tables, dict(_shown(config, entries))


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


def _variants(config: CrossConfig) -> dict[str, Scenario]:
    fine = config.scenario(config.fluids[0])
    return {"finer step": fine, "coarser step": fine.but(physics_rate=config.coarser)}


def _entries(config: CrossConfig, evaluate: Evaluator, compared: list[Contender]) -> Iterator[Entry]:
    """Every contender in closed loop, then its recorded torques; one without a rhythm leaves none."""
    for contender in compared:
        yield Entry(contender, "closed", contender.tuned_to, contender.controller)
    where = [
        (one, fluid) for one in compared for fluid in (config.fluids if one.tuned_to == ADAPTIVE else [one.tuned_to])
    ]
    tasks = ((one.controller, config.scenario(fluid)) for one, fluid in where)
    for (one, fluid), waveform in zip(where, evaluate.compute(_recorded, tasks), strict=True):
        if waveform is not None:
            yield Entry(one, "open", fluid, waveform)


def _recorded(controller: AnyController, scenario: Scenario) -> ReplayedTorque | None:
    """What a worker does: the waveform of a swim; None when it has no rhythm or diverged."""
    swim = simulate(controller, scenario)
    frequency = metrics.swim_frequency(swim)
    if swim.diverged or frequency is None or frequency * scenario.duration < _CYCLES:
        return None
    return replay(swim, frequency)


def _shown(config: CrossConfig, entries: list[Entry]) -> Iterator[tuple[str, Trajectory]]:
    """Swims of the first policy's first seed and of the paper's best sinusoids where they belong, and its replays."""
    policy = config.pilots[0]
    first = [entry for entry in entries if entry.contender.method == policy and entry.contender.seed == config.seeds[0]]
    sinusoids = [entry for entry in entries if entry.contender.method == SINUSOIDS[0] and entry.loop == "closed"]
    for fluid in config.fluids:
        here = config.scenario(fluid)
        for entry in [*first, *(entry for entry in sinusoids if entry.gait_of == fluid)]:
            name = (
                f"{entry.contender.method}-{fluid}" if entry.loop == "closed" else f"replayed-{entry.gait_of}-{fluid}"
            )
            yield name, simulate(entry.controller, here).thinned(2 * thinning(config.verify_rate))
