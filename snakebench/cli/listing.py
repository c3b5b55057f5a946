"""`snakebench list`: what may be called by name."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from snakebench.cli.printing import said


def list_names() -> None:
    """List the studies, fluids, gaits, robots, samplers, metrics and engines there are; a plus marks those of plug-ins.

    Example: snakebench list
    """
    for what, lines in _catalogue():
        print("\n".join([what, *lines]))


def _catalogue() -> Iterator[tuple[str, list[str]]]:
    from snakebench.controllers import GAITS
    from snakebench.engines import PHYSICS_RATES
    from snakebench.evaluation import METRICS
    from snakebench.fluid import FLUIDS, Fluid
    from snakebench.registry import Registry
    from snakebench.robot import ROBOTS, Robot
    from snakebench.studies.config import LIBRARY, study_names, study_profiles
    from snakebench.studies.samplers import SAMPLERS

    def about(thing: object) -> str:
        if isinstance(thing, Fluid):
            return f"viscosity {thing.kinematic_viscosity:.3g} m²/s, density {thing.density:g} kg/m³"
        if isinstance(thing, Robot):
            return f"{thing.n_joints} joints, {thing.link_lengths.sum():.3g} m, {thing.total_mass:.3g} kg"
        return said((thing.__doc__ or "").strip().partition("\n")[0])

    def lines(registry: Registry[Any]) -> list[str]:
        return [
            f"{' ' if name in registry.own else '+'} {said(name):20} {about(registry[name])}".rstrip()
            for name in registry
        ]

    profiles = {name: ", ".join(study_profiles(LIBRARY / f"{name}.toml")) for name in study_names()}
    yield "studies", [f"  {said(name):20} profiles: {said(text)}" for name, text in profiles.items()]
    for what, registry in (("fluids", FLUIDS), ("gaits", GAITS), ("robots", ROBOTS), ("samplers", SAMPLERS)):
        yield what, lines(registry)
    yield "metrics of plug-ins", lines(METRICS) or ["  none"]
    yield "engines", [f"  {name:20} {rate} Hz unless told otherwise" for name, rate in PHYSICS_RATES.items()]
