"""The logs of trainings, read while they are written."""

from __future__ import annotations

import threading
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

import pandas as pd

from snakebench.execution import Evaluator

if TYPE_CHECKING:
    from snakebench.studies.training_jobs import Key, TrainingJob  # which imports this

_SECONDS_BETWEEN_LOOKS = 2.0


def log_in(folder: Path) -> pd.DataFrame:
    """The log of a training's folder, empty before its first row."""
    try:
        return pd.read_csv(folder / "log.csv")
    except (OSError, ValueError):
        return pd.DataFrame()


@contextmanager
def logs_followed(jobs: Sequence[TrainingJob], folders: Mapping[Key, Path], evaluate: Evaluator) -> Iterator[None]:
    """Report every new row of a log meanwhile; what an earlier run has learned is only counted."""
    over, whole = threading.Event(), sum(job.seconds for job in jobs)
    rows: dict[TrainingJob, int] = {}

    def follow() -> None:
        ended = False
        while not ended:
            ended = over.wait(_SECONDS_BETWEEN_LOOKS)  # and a last look
            for job in [job for job in jobs if job.key in folders]:
                log, before = log_in(folders[job.key]), rows.get(job)
                if len(log) != before:
                    rows[job] = len(log)
                    done = sum(count / job.settings.checkpoints * job.seconds for job, count in rows.items())
                    evaluate.work.reached("learning", done / whole, before is None)
                    if before is not None:
                        progress = f"{job}: {len(log) / job.settings.checkpoints:.0%}{_last_row(log)}"
                        evaluate.work.say("; ".join(filter(None, (progress, evaluate.work.left()))))

    watcher = threading.Thread(target=follow, daemon=True)
    watcher.start()
    try:
        yield
    finally:
        over.set()
        watcher.join()


def _last_row(log: pd.DataFrame) -> str:
    last = log.iloc[-1]
    speeds = [f"{name.removeprefix('speed_')} {last[name]:.3f}" for name in map(str, log) if name.startswith("speed_")]
    earned = "" if pd.isna(last["return_mean"]) else f", return {last['return_mean']:.1f}"
    return f"{earned}, m/s in {', '.join(speeds)}" if speeds else earned
