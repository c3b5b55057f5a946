"""Rows of tables of swims: what a swim is called by, how it was computed, and its evaluation."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping

from snakebench.execution import Case, Evaluator
from snakebench.scenario import Scenario

Row = dict[str, object]
LabelledCase = tuple[Mapping[str, object], Case]


def swim_rows(evaluate: Evaluator, swims: Iterable[LabelledCase]) -> Iterator[Row]:
    """Evaluate swims, each with its labels, and give the row of each: its labels and its evaluation."""
    asked = list(swims)
    evaluations = evaluate([case for _, case in asked])
    for (labels, _), evaluation in zip(asked, evaluations, strict=True):
        yield {**labels, **evaluation.row()}


def numerics(scenario: Scenario) -> Row:
    """How a swim was computed: engine and physics rate [Hz]."""
    return {"engine": scenario.engine, "physics_rate": scenario.physics_rate}
