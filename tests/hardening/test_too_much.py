"""Counts that no machine has room for are refused in one line, within seconds and before anything is allocated."""

from __future__ import annotations

import math
import tracemalloc

import numpy as np
import pytest

from snakebench import memory
from snakebench.errors import InvalidValue
from snakebench.studies.config import study_path, study_settings
from snakebench.studies.running import study_config, study_plan
from snakebench.workers import check_workers

HUGE = 10**11
COUNTS = {
    "grid": {"grid": [400, 400, 400]},
    "a long axis": {"grid": [3, HUGE, 3]},
    "nsga2": {"search": "nsga2", "population": HUGE, "generations": HUGE},
}


@pytest.mark.parametrize("workers", [["--workers", "100000000"], ["--workers", "100000000", "--executor", "dask"]])
def test_workers_that_do_not_fit_into_memory_are_refused(snakebench_command, tmp_path, workers):
    code, out, err = snakebench_command("pareto", "--profile", "smoke", *workers)
    assert (code, out, err.count("\n")) == (2, "", 1)
    assert "workers = 100000000, of 180 MB each: needs 18000000.0 GB of memory" in err
    assert not (tmp_path / "results").exists()


def test_workers_are_as_many_as_fit_into_memory(monkeypatch):
    monkeypatch.setattr(memory, "available_memory", lambda: 1e9)
    check_workers(5)
    with pytest.raises(InvalidValue, match=r"workers = 6, of 180 MB each: needs 1.1 GB of memory, 1.0 GB"):
        check_workers(6)


@pytest.mark.parametrize("counts", COUNTS.values(), ids=COUNTS)
def test_a_search_that_does_not_fit_is_refused_before_it_takes_memory(counts):
    config = study_config(study_settings(study_path("pareto"), "smoke") | counts)
    study_plan(study_config(study_settings(study_path("pareto"), "smoke")))  # what is loaded for any
    tracemalloc.start()
    with pytest.raises(InvalidValue, match=r"^pareto-smoke, .*e\+\d+ evaluations: needs \d+\.\d GB of memory"):
        study_plan(config)
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert peak < 20e6


@pytest.mark.parametrize(
    ("study", "counts"),
    [
        ("sea_snake", {"trials": HUGE}),
        ("fourier", {"trials": HUGE}),
        ("fourier", {"trials": 3 * HUGE, "price_trials": 3 * HUGE, "population": HUGE}),
        ("sensitivity", {"grid": [400, 400, 400]}),
    ],
)
def test_trials_that_do_not_fit_are_refused(study, counts):
    with pytest.raises(InvalidValue, match=rf"^{study}-smoke, .* evaluations: needs"):
        study_plan(study_config(study_settings(study_path(study), "smoke") | counts))


@pytest.mark.parametrize(
    ("study", "name"),
    [("adaptation", "viscosities"), ("teacher_student", "viscosities"), ("learned_front", "positions")],
)
def test_places_are_at_most_ten_thousand(study, name):
    with pytest.raises(InvalidValue, match=rf"{name} = {HUGE}: .* less than or equal to 10000"):
        study_config(study_settings(study_path(study), "smoke") | {name: HUGE})


def test_a_grid_is_counted_and_timed_as_if_each_gait_were_looked_at():
    config = study_config(study_settings(study_path("pareto"), "smoke", grid=[4, 30, 5]))
    loads = study_plan(config)[:-1]
    assert sum(load.times for load in loads) == len(config.spaces) * 4 * 30 * 5 * 3
    seconds = [max(config.duration, math.ceil(1 / frequency)) for frequency in np.linspace(0.1, 0.8, 30)]
    assert loads[0].scenario.duration == pytest.approx(np.mean(seconds))
