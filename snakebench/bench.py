"""What this machine makes of the engines: their speeds side by side in one run, and the error at that speed."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from functools import cache
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pandas as pd

from snakebench import metrics
from snakebench.controllers import Gait, HeldTargets, SinusoidalTorque, WaveformGait
from snakebench.engines import ENGINES, load_engine
from snakebench.engines.planar import MOST_THREADS, Batch
from snakebench.execution import compile_engine
from snakebench.fluid import named_fluid
from snakebench.progress import Work, timed
from snakebench.publication import alone, check_results, publish
from snakebench.robot import Robot
from snakebench.simulation import simulate
from snakebench.store import provenance
from snakebench.workers import check_workers, usable_cores

CONTROL_RATE = 30  # [Hz]
BATCH = 64  # robots
_PIECE = 10.0  # of swimming in one measurement of a single robot [s]
_ROUNDS = 15  # the workloads take turns and each counts by its best: a machine's other tenants only ever slow it
_FLUIDS = ("water", "oil1", "oil2")
_REFERENCE_RATE = 1920  # of the planar engine, whose error there is far below any shown [Hz]

TORQUES = SinusoidalTorque(amplitude=3.5, frequency=0.70, phase=0.84)
# A swimming policy: target angles of a travelling wave at 1 Hz, held between control steps.
_WAVE = 0.6 * np.sin(2 * np.pi * np.arange(30 * CONTROL_RATE)[:, None] / CONTROL_RATE - 0.84 * np.arange(7))
TARGETS = HeldTargets(rate=CONTROL_RATE, targets=tuple(map(tuple, _WAVE.tolist())))


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
    """Measure this machine with batches on up to `threads` threads; returns the directory of the table, `bench.csv`.

    Raises:
        InvalidValue: when there are not that many cores.
        StoreError: when the table cannot be written.
    """
    check_workers(threads, "threads", most=min(usable_cores(), MOST_THREADS))
    directory = check_results(results / "bench")
    workloads = list(_workloads(threads))
    with Work("bench", len(workloads) * (_ROUNDS + 1)) as work:
        for engine in ENGINES:
            compile_engine(engine, work.say)
        table = time_workloads(workloads, work.advance)
        work.say("bench: compiling the planar engine from nothing")
        seconds = compile_seconds()
    about = {"study": "bench", "config": {"method": "bench", "threads": threads}}
    measured = {"compile_seconds": round(seconds, 1), "scaling": _scaling(table)}
    with alone(directory):
        publish(directory, {"bench": table}, {}, about | measured | provenance())
    return directory


def time_workloads(workloads: Sequence[Workload], on_done: Callable[[], object]) -> pd.DataFrame:
    """Time every workload in turns and add the error of its engine, rate and gait.

    Returns:
        One row a workload: its description; `steps_per_second`, `simulated` (seconds per second) and, under target
        angles, `control_steps_per_second`, of all its robots together; `times_evaluator`, its simulated seconds per
        second over those of PyBullet at 480 Hz under the same gait; `times_bare_loop`, its steps per second over those
        of PyBullet's own calls; `speed_error` and `power_error`, the largest over three fluids [1].
    """
    best = [np.inf] * len(workloads)
    for round_ in range(_ROUNDS + 1):  # the first is not counted
        for i, workload in enumerate(workloads):
            seconds = timed(workload.call)
            best[i] = min(best[i], seconds) if round_ else np.inf
            on_done()
    rows = []
    for workload, seconds in zip(workloads, best, strict=True):
        drives = workload.gait.drives
        errors = _errors(workload.engine, workload.gait, workload.physics_rate)
        simulated = workload.robots * workload.seconds / seconds
        about = {"workload": workload.name, "engine": workload.engine, "drives": drives}
        size = {"physics_rate": workload.physics_rate, "robots": workload.robots, "threads": workload.threads}
        speed = {"steps_per_second": simulated * workload.physics_rate, "simulated": simulated}
        control = {"control_steps_per_second": simulated * CONTROL_RATE if drives == "angle" else None}
        rows.append(about | size | speed | control | dict(zip(("speed_error", "power_error"), errors, strict=True)))
    table = pd.DataFrame(rows)
    evaluator = table[table["workload"] == "evaluator"].set_index("drives")["simulated"]
    bare = table.loc[table["workload"] == "bare loop", "steps_per_second"].iloc[0]
    return table.assign(
        times_evaluator=table["simulated"] / table["drives"].map(evaluator),
        times_bare_loop=table["steps_per_second"] / bare,
    )


def swimming_cost(engine: str, gait: Gait, physics_rate: int, robot: Robot) -> float:
    """Seconds that one robot takes for a simulated second, on one core: the best of three."""
    return min(timed(_swim(engine, gait, physics_rate, robot)) for _ in range(3)) / _PIECE


def compile_seconds() -> float:
    """How long the planar engine takes to its first step on a machine that has never run it [s]."""
    script = "import snakebench as sb; sb.simulate(sb.SinusoidalTorque(amplitude=1.0, frequency=1.0, phase=0.8)"
    with tempfile.TemporaryDirectory() as empty:
        environment = os.environ | {"NUMBA_CACHE_DIR": empty}
        started = time.perf_counter()
        subprocess.run([sys.executable, "-c", f"{script}, engine='planar', duration=0.1)"], env=environment, check=True)
        return time.perf_counter() - started


def _workloads(threads: int) -> Iterator[Workload]:
    yield Workload("bare loop", "pybullet", TORQUES, 480, 1, 1, _PIECE, _bare_loop(480))
    for gait in (TORQUES, TARGETS):
        yield Workload("evaluator", "pybullet", gait, 480, 1, 1, _PIECE, _swim("pybullet", gait, 480))
        for rate in (90, 120, 240):
            yield Workload("one robot", "planar", gait, rate, 1, 1, _PIECE, _swim("planar", gait, rate))
        for rate in (90, 120):
            for n in sorted({1, threads}):
                yield Workload("batch", "planar", gait, rate, BATCH, n, 1.0, _swim_together(gait, rate, n))


def _swim(engine: str, gait: Gait, physics_rate: int, robot: Robot | None = None) -> Callable[[], object]:
    steps, robot, water = round(_PIECE * physics_rate), robot or Robot(), named_fluid("water")

    def swim() -> None:
        with load_engine(engine).open_simulation(robot, water, gait.drives, physics_rate, steps) as simulation:
            simulation.follow(gait, steps)

    return swim


def _swim_together(gait: WaveformGait, physics_rate: int, threads: int) -> Callable[[], object]:
    """A second of a batch in three fluids: whole waveforms of torque, or actions that arrive at the control rate."""
    media = [named_fluid(_FLUIDS[b % len(_FLUIDS)]) for b in range(BATCH)]
    batch = Batch([Robot()] * BATCH, media, gait.drives, physics_rate, threads)
    waveforms = [gait.waveform(batch.n_joints)] * BATCH
    actions = [np.tile(action, (BATCH, 1)) for action in _WAVE[:CONTROL_RATE]]

    def swim() -> None:
        if gait.drives == "torque":
            batch.follow(waveforms, physics_rate, every=physics_rate)
        else:
            for action in actions:
                batch.advance(action, physics_rate // CONTROL_RATE)

    return swim


def _bare_loop(physics_rate: int) -> Callable[[], object]:
    """PyBullet's own calls in a run of the calibration gait, with the loads of an earlier one."""
    from snakebench.engines.bullet import BulletSimulation  # all else works without PyBullet

    steps, robot, water = round(_PIECE * physics_rate), Robot(), named_fluid("water")
    with BulletSimulation(robot, water, "torque", physics_rate, steps) as swimming:
        loads = swimming.loads(TORQUES.commands(np.arange(steps) / physics_rate, robot.n_joints))

    def replay() -> None:
        with BulletSimulation(robot, water, "torque", physics_rate, 0) as bare:
            bare.replay(loads)

    return replay


def _errors(engine: str, gait: Gait, physics_rate: int) -> tuple[float, float]:
    """Largest relative error of speed and power over the fluids [1]."""
    worst = np.zeros(2)
    for fluid in _FLUIDS:
        found, limit = (_figures(gait, fluid, *at) for at in ((engine, physics_rate), ("planar", _REFERENCE_RATE)))
        worst = np.maximum(worst, np.abs(np.divide(found, limit) - 1))
    return float(worst[0]), float(worst[1])


@cache
def _figures(gait: Gait, fluid: str, engine: str, physics_rate: int) -> tuple[float, float]:
    """Speed [m/s] and power [W] over the last twenty of thirty seconds."""
    whole = 20.0 if gait.drives == "angle" else 14 / TORQUES.frequency  # periods
    window = metrics.Window(30.0 - whole, 30.0, steady=True)
    run = simulate(gait, fluid=fluid, engine=engine, physics_rate=physics_rate)
    return metrics.speed(run, window), metrics.power(run, window)


def _scaling(table: pd.DataFrame) -> float | None:
    """How many times as fast a batch swims on all threads as on one: the least over its workloads; None for one."""
    batch = table[table["workload"] == "batch"].set_index(["drives", "physics_rate"])
    most = batch["threads"].max()
    ratio = batch[batch["threads"] == most]["simulated"] / batch[batch["threads"] == 1]["simulated"]
    return None if most == 1 else round(float(ratio.min()), 2)
