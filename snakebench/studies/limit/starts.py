"""Where the search starts: cycles of gaits, of random travelling waves, and of policies, in each fluid."""

from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from snakebench.collocation.search import BASE, Point
from snakebench.collocation.solver import plain
from snakebench.collocation.starts import steady_cycle
from snakebench.controllers import SeaSnake
from snakebench.errors import InvalidValue
from snakebench.fluid import Fluid
from snakebench.names import ADAPTIVE
from snakebench.policy import Policy
from snakebench.simulation import AnyController
from snakebench.studies.contenders import Best, read_contenders
from snakebench.studies.limit.settings import LimitConfig
from snakebench.workers import in_one_thread

_WAVES = {"amplitude": (0.4, 1.2), "frequency": (0.15, 1.2), "phase": (0.3, 1.0)}  # of random ones [rad, Hz, rad]


def starts(config: LimitConfig, points: Iterable[Point], results: Path) -> dict[Point, dict[str, Any]]:
    """The cycles that swim, by their names, at the points of the first bounds at the anchors."""
    anchors = set(map(config.powers.index, config.anchors))
    swimmers: dict[str, AnyController] = {**config.starts, **dict(_waves(config)), **dict(_policies(config, results))}
    cycles = [dict(_cycles(config, fluid, swimmers)) for _, fluid in config.media()]
    return {point: cycles[point.medium] for point in points if point.power in anchors and point.bound == 0}


def _cycles(
    config: LimitConfig, fluid: Fluid, swimmers: Mapping[str, AnyController]
) -> Iterator[tuple[str, Mapping[str, Any]]]:
    bound = next(iter(config.bounds.values())).target
    for name, swimmer in swimmers.items():
        try:
            yield name, plain(in_one_thread(steady_cycle, swimmer, config.robot, fluid, BASE, bound))
        except InvalidValue:  # it does not swim here
            continue


def _waves(config: LimitConfig) -> Iterator[tuple[str, SeaSnake]]:
    """Sea-snake gaits with random parameters, of frequencies and amplitudes whose logarithms are uniform."""
    random = np.random.default_rng(config.seed)
    for k in range(config.waves):
        values = {name: float(np.exp(random.uniform(*np.log(ends)))) for name, ends in _WAVES.items()}
        yield f"random wave {k + 1}", SeaSnake(**values)


def _policies(config: LimitConfig, results: Path) -> Iterator[tuple[str, AnyController]]:
    for one in read_contenders(config, results, [(config.policies, _at_its_ends)]):
        yield one.method, one.controller


def _at_its_ends(_config: LimitConfig, directory: Path, _manifest: Mapping[str, Any]) -> Iterator[Best]:
    """The first policy of a study; a preference-conditioned one at the lowest and at the highest price of power."""
    path = min((directory / "policies").glob("*.safetensors"), default=None)
    if path is None:
        raise InvalidValue(f"{directory} has no policy: choose another study for `policies`, or none")
    policy = Policy.load(path)
    if policy.card.prices is None:
        yield path.stem, ADAPTIVE, 0, policy
    for price in policy.card.prices or ():
        yield f"{path.stem} at {price:g}/W", ADAPTIVE, 0, policy.at(price)
