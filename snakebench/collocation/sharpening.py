"""Optima with less smoothing: nearer to the kinks of the force law, where a solution from afar would not get (ours).

In viscous fluids the fastest gaits move links as little across themselves as they can, since the viscous drag along a
link grows with the root of the velocity across it. There smoothing adds drag: at 1 mm/s up to 3 % of the speed.
"""

from collections.abc import Mapping, Sequence
from typing import Any

from snakebench.collocation.solver import Goal, _solved
from snakebench.collocation.transcription import Mesh
from snakebench.robot import Robot
from snakebench.sources import code_digest

CODE = code_digest(
    "collocation.equations", "collocation.sharpening", "collocation.solver", "collocation.transcription"
)  # of what `sharpen` computes


def sharpen(
    robot: Mapping[str, Any], goal: Sequence[Any], mesh: Sequence[int], start: Mapping[str, Any], smoothing: float
) -> Any:
    """The `Optimum` of a goal on a mesh from the cycle `start` of one with more smoothing; all are plain values."""
    return _solved(Robot(**robot), Goal(*goal), Mesh(*mesh), start, smoothing, near=True)
