"""Training of a gain schedule: its estimator, its file with a log beside it, and the seal of both.

`resume` seals policies in the same way. It is left alone, since its code is a part of the keys of all trainings.
"""

import json
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pandas as pd
import torch

from snakebench.files import write_file
from snakebench.gain_schedule import GainSchedule, ScheduledGait
from snakebench.learning.estimator import swims, train_estimator
from snakebench.learning.settings import Scheduling
from snakebench.store import file_digest

_SCHEDULE, _LOG, _SEAL = "schedule.json", "log.csv", "seal.json"
_TRIED = 8  # every eighth gait is used to measure the error


def learn_schedule(settings: Scheduling, gaits: Sequence[ScheduledGait], seed: int, folder: Path) -> None:
    """Write a gain schedule with a trained estimator into a folder.

    Its log has the root mean square error of the estimates [decades], in swims that were not trained on.
    """
    torch.set_num_threads(1)
    estimator = train_estimator(gaits, settings, seed, settings.estimator)
    x, y = swims(gaits[::_TRIED], settings, np.random.default_rng([seed, 1]))
    error = float(np.sqrt(np.mean((np.array([estimator(row) for row in x]) - y) ** 2)))
    schedule = GainSchedule(control_rate=settings.control_rate, gaits=gaits, estimator=estimator)
    log = pd.DataFrame({"steps": [settings.estimator], "return_mean": [None], "error": [error]})
    contents = {
        _LOG: log.to_csv(index=False, lineterminator="\n").encode(),
        _SCHEDULE: f"{schedule.model_dump_json()}\n".encode(),
    }
    write_file(folder / _SEAL, json.dumps({name: file_digest(content) for name, content in contents.items()}) + "\n")
    for name, content in contents.items():
        write_file(folder / name, content)


def read_schedule(folder: Path) -> GainSchedule | None:
    """The gain schedule in a folder; None before it is finished, and if it or its log is damaged."""
    try:
        contents = {name: (folder / name).read_bytes() for name in (_LOG, _SCHEDULE)}
        if json.loads((folder / _SEAL).read_bytes()) != {name: file_digest(contents[name]) for name in contents}:
            return None
        return GainSchedule.model_validate_json(contents[_SCHEDULE])
    except (OSError, ValueError):
        return None


def set_damaged_schedule_aside(folder: Path) -> bool:
    """Whether a finished gain schedule or its log was damaged: both are set aside, to be learned again."""
    if not (folder / _SCHEDULE).exists() or read_schedule(folder):
        return False
    for name in (_SCHEDULE, _LOG):
        if (path := folder / name).exists():
            path.replace(path.with_name(f"{name}.damaged"))
    return True
