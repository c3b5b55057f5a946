"""What this machine makes of the engines: their speeds side by side in one run, and the error at that speed."""

import os
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator, Sequence
from functools import cache, partial
from pathlib import Path
from subprocess import DEVNULL
from typing import NamedTuple

import numpy as np
import pandas as pd

from snakebench import metrics
from snakebench.controllers import Gait, HeldTargets, SinusoidalTorque, WaveformGait
from snakebench.engines import ENGINES, load_engine
from snakebench.engines.planar import MOST_THREADS, Batch
from snakebench.errors import InvalidValue, StoreError
from snakebench.execution import compile_engine
from snakebench.fluid import PAPERS, named_fluid
from snakebench.manifest import provenance
from snakebench.progress import Work, timed
from snakebench.publication import check_results, locked, publish
from snakebench.robot import Robot
from snakebench.simulation import simulate
from snakebench.value import FloatArray
from snakebench.workers import usable_cores

_CONTROL_RATE = 30  # [Hz]
_BATCH = 64  # robots
_PIECE = 10.0  # of swimming in one measurement of a single robot [s]
_ROUNDS = 15  # the workloads take turns and each counts by its best: a machine's other tenants only ever slow it
_REFERENCE = ("planar", 1920)  # engine and rate [Hz] whose error is far below any shown
_TORQUES = SinusoidalTorque(amplitude=3.5, frequency=0.70, phase=0.84)
# A swimming policy: target angles of a travelling wave at 1 Hz, held between control steps.
_WAVE = 0.6 * np.sin(2 * np.pi * np.arange(30 * _CONTROL_RATE)[:, None] / _CONTROL_RATE - 0.84 * np.arange(7))
_TARGETS = HeldTargets(rate=_CONTROL_RATE, targets=tuple(map(tuple, _WAVE.tolist())))


class Workload(NamedTuple):
    """Something to be timed."""

    name: str
    engine: str
    gait: WaveformGait
    physics_rate: int  # [Hz]
    robots: int
    threads: int
    seconds: float  # simulated in one call, by each robot
    call: Callable[[], object]


def run_bench(results: Path, threads: int) -> Path:
    """Measure this machine with batches on up to `threads` threads; returns the directory of the table, `bench.csv`."""
    most = min(usable_cores(), MOST_THREADS)
    if not 1 <= threads <= most:
        raise InvalidValue(f"threads = {threads}: allowed are 1 to {most}")
    directory = check_results(results / "bench")
    with locked(directory), Work("bench", 0) as work:
        for engine in ENGINES:
            compile_engine(engine, work.say)
        workloads = list(_workloads(threads))
        work.expect(len(workloads) * (_ROUNDS + 1))
        table = _time_workloads(workloads, work.advance)
        work.say("bench: compiling the planar engine from nothing")
        seconds = compile_seconds()
        study = {"study": "bench", "config": {"method": "bench", "threads": threads}}
        measured = {"compile_seconds": round(seconds, 1), "scaling": _scaling(table)}
        publish(directory, {"bench": table}, {}, study | measured | provenance())
    return directory


def _time_workloads(workloads: Sequence[Workload], on_done: Callable[[], object]) -> pd.DataFrame:
    """The speed of each workload, of all its robots together, and its largest error over the fluids [1].

    `times_evaluator` compares with PyBullet at 480 Hz under the same gait, `times_bare_loop` with PyBullet's own calls.
    """
    seconds = []
    for workload in [*workloads] * (_ROUNDS + 1):
        seconds.append(timed(workload.call))
        on_done()
    best = np.reshape(seconds, (-1, len(workloads)))[1:].min(axis=0)  # the first round is not counted
    table = pd.DataFrame(workloads).rename(columns={"name": "workload"})
    table["drives"] = [workload.gait.drives for workload in workloads]
    figures = np.array([_figures(workload.gait, workload.engine, workload.physics_rate) for workload in workloads])
    limits = np.array([_figures(workload.gait, *_REFERENCE) for workload in workloads])
    errors = np.abs(figures / limits - 1).max(axis=1)
    simulated = table["robots"] * table["seconds"] / best
    steps = simulated * table["physics_rate"]
    evaluator = simulated.set_axis(table["drives"])[(table["workload"] == "evaluator").to_numpy()]
    return table[["workload", "engine", "drives", "physics_rate", "robots", "threads"]].assign(
        steps_per_second=steps,
        simulated=simulated,
        control_steps_per_second=(simulated * _CONTROL_RATE).where(table["drives"] == "angle"),
        speed_error=errors[:, 0],
        power_error=errors[:, 1],
        times_evaluator=simulated / table["drives"].map(evaluator),
        times_bare_loop=steps / steps[table["workload"] == "bare loop"].iloc[0],
    )


def swimming_cost(engine: str, gait: Gait, physics_rate: int, robot: Robot) -> float:
    """Seconds that one robot takes for a simulated second, on one core: the best of three."""
    return min(timed(_swim(engine, gait, physics_rate, robot)) for _ in range(3)) / _PIECE


def compile_seconds() -> float:
    """How long the planar engine takes to its first step on a machine that has never run it [s]."""
    script = "import snakebench as sb; sb.simulate(sb.SinusoidalTorque(amplitude=1.0, frequency=1.0, phase=0.8)"
    words = [sys.executable, "-c", f"{script}, engine='planar', duration=0.1)"]
    with tempfile.TemporaryDirectory() as empty:
        run = partial(subprocess.run, words, env=os.environ | {"NUMBA_CACHE_DIR": empty}, check=True, stderr=DEVNULL)
        try:
            return timed(run)
        except subprocess.CalledProcessError as error:
            raise StoreError(f"the planar engine cannot be compiled anew: exit code {error.returncode}") from None


def _workloads(threads: int) -> Iterator[Workload]:
    yield Workload("bare loop", "pybullet", _TORQUES, 480, 1, 1, _PIECE, _bare_loop())
    for gait in (_TORQUES, _TARGETS):
        yield Workload("evaluator", "pybullet", gait, 480, 1, 1, _PIECE, _swim("pybullet", gait, 480))
        for rate in (90, 120, 240):
            yield Workload("one robot", "planar", gait, rate, 1, 1, _PIECE, _swim("planar", gait, rate))
        for rate in (90, 120):
            for n in sorted({1, threads}):
                yield Workload("batch", "planar", gait, rate, _BATCH, n, 1.0, _swim_together(gait, rate, n))


def _swim(engine: str, gait: Gait, physics_rate: int, robot: Robot | None = None) -> Callable[[], object]:
    steps, robot, water = round(_PIECE * physics_rate), robot or Robot(), named_fluid("water")

    def swim() -> None:
        with load_engine(engine).open_simulation(robot, water, gait.drives, physics_rate, steps) as simulation:
            simulation.follow(gait, steps)

    return swim


def _swim_together(gait: WaveformGait, physics_rate: int, threads: int) -> Callable[[], object]:
    """A second of a batch in three fluids: whole waveforms of torque, or actions at the control rate."""
    media = [named_fluid(PAPERS[b % len(PAPERS)]) for b in range(_BATCH)]
    batch = Batch([Robot()] * _BATCH, media, gait.drives, physics_rate, threads)
    waveforms = [gait.waveform(batch.n_joints)] * _BATCH
    actions = [np.tile(action, (_BATCH, 1)) for action in _WAVE[:_CONTROL_RATE]]

    def swim() -> None:
        if gait.drives == "torque":
            batch.follow(waveforms, physics_rate, every=physics_rate)
        else:
            for action in actions:
                batch.advance(action, physics_rate // _CONTROL_RATE)

    return swim


def _bare_loop() -> Callable[[], object]:
    """PyBullet's own calls in a run of the calibration gait at 480 Hz, with the loads of an earlier one."""
    from snakebench.engines.bullet import BulletSimulation  # all else works without PyBullet

    steps, simulation = round(_PIECE * 480), partial(BulletSimulation, Robot(), named_fluid("water"), "torque", 480)
    with simulation(steps) as swimming:
        loads = swimming.loads(_TORQUES.commands(np.arange(steps) / 480, Robot().n_joints))

    def replay() -> None:
        with simulation(0) as bare:
            bare.replay(loads)

    return replay


@cache
def _figures(gait: Gait, engine: str, physics_rate: int) -> FloatArray:
    """Speed [m/s] and power [W] in each fluid, over the last twenty of thirty seconds."""
    whole = 20.0 if gait.drives == "angle" else 14 / _TORQUES.frequency  # periods
    window = metrics.Window(30.0 - whole, 30.0, steady=True)
    runs = [simulate(gait, fluid=fluid, engine=engine, physics_rate=physics_rate) for fluid in PAPERS]
    return np.array([(metrics.speed(run, window), metrics.power(run, window)) for run in runs])


def _scaling(table: pd.DataFrame) -> float | None:
    """How many times as fast a batch swims on all threads as on one, at least; None for one thread."""
    batch, most = table[table["workload"] == "batch"], table["threads"].max()
    simulated = batch.pivot(index=["drives", "physics_rate"], columns="threads", values="simulated")
    return round(float((simulated[most] / simulated[1]).min()), 2) if most > 1 else None
