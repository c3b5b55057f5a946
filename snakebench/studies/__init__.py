"""Studies: each asks a question, proposes controllers, has them evaluated and writes tidy tables."""

from __future__ import annotations

import time
from importlib import import_module
from pathlib import Path
from typing import Any

from snakebench.errors import UnknownName
from snakebench.execution import Evaluator, check_workers, compile_engine
from snakebench.progress import Work
from snakebench.store import EvaluationCache, check_results, provenance, publish
from snakebench.studies.config import SeaSnakeConfig, ValidationConfig

Config = SeaSnakeConfig | ValidationConfig
# Method: its configuration and the module that has `check`, `n_evaluations` and `run`.
METHODS: dict[str, tuple[type[Config], str]] = {
    "sea_snake": (SeaSnakeConfig, "snakebench.studies.sea_snake"),
    "validation": (ValidationConfig, "snakebench.studies.validation"),
}


def study_config(settings: dict[str, Any]) -> Config:
    """The checked configuration of a study from the settings of `config.study_settings`.

    Raises:
        InvalidValue: for an unknown method or a wrong, missing or unknown setting.
    """
    method = str(settings.get("method"))
    if method not in METHODS:
        raise UnknownName.among("method", method, METHODS)
    return METHODS[method][0](**settings)


def run_study(config: Config, results: Path, workers: int) -> Path:
    """Run a study and return the directory of its tables; run again after an interruption, it continues.

    Results are published together at the end; until then older results stay as they are.

    Raises:
        InvalidValue: when the study cannot be run with these settings, which is found out before anything is run.
        StoreError: when the results cannot be written, or were written in another format.
    """
    method = import_module(METHODS[config.method][1])
    method.check(config)
    check_workers(workers)
    directory = check_results(results / config.name)
    here, total, started = provenance(), method.n_evaluations(config), time.monotonic()
    cache = EvaluationCache(results)
    try:
        with Work(config.name, total) as work:
            work.say(f"{config.name}: {total} evaluations, {workers} at a time")
            for engine in config.engines():
                compile_engine(engine, work.say)
            evaluator = Evaluator(cache, workers, work.advance)
            tables, trajectories = method.run(config, evaluator)
    finally:
        cache.close()
    effort = {"evaluations": total, "computed": evaluator.computed, "seconds": round(time.monotonic() - started, 1)}
    about = {"study": config.name, "config": config.model_dump(mode="json")}
    publish(directory, tables, trajectories, about | effort | {"workers": workers} | here)
    return directory
