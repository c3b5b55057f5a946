"""Rows of tables of swims: the labels of a swim, how it was computed, and its evaluation."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping

from snakebench.execution import Case, Evaluator
from snakebench.scenario import Scenario
from snakebench.studies.planning import Load

Row = dict[str, object]
Swim = tuple[Mapping[str, object], Case]  # labels, and what is evaluated


def swim_rows(evaluate: Evaluator, swims: Iterable[Swim]) -> Iterator[Row]:
    """Evaluate swims, each with its labels, and give the row of each: its labels and its evaluation."""
    swims = list(swims)
    for (labels, _), evaluation in zip(swims, evaluate([case for _, case in swims]), strict=True):
        yield {**labels, **evaluation.row()}


def loads_of(cases: Iterable[Case]) -> list[Load]:
    """The loads of cases, of which only what the controller drives and the scenario matter."""
    times = Counter((case.controller.drives, case.scenario) for case in cases)
    return [Load(drives, scenario, count) for (drives, scenario), count in times.items()]


def numerics(scenario: Scenario) -> Row:
    """How a swim was computed: engine and physics rate [Hz]."""
    return {"engine": scenario.engine, "physics_rate": scenario.physics_rate}
