"""What tuning a gait to each fluid is worth: estimated for sets of fluids and robots from the same gaits in all."""

from collections.abc import Iterator, Mapping, Sequence
from itertools import product

import numpy as np
import pandas as pd

from snakebench.collocation.ideal import LimitFront, at_power, distributed, envelope
from snakebench.execution import Case
from snakebench.fluid import named_fluid
from snakebench.names import CURRENCIES
from snakebench.studies.adaptation.settings import AdaptationConfig
from snakebench.studies.contenders import Contender
from snakebench.studies.protocol import Row, Swim
from snakebench.studies.search_settings import settled_duration
from snakebench.value import FloatArray


def worth_swims(config: AdaptationConfig, tried: Sequence[Contender]) -> Iterator[Swim]:
    """Every candidate in every fluid of the sets, on robots of every diameter, in the planar engine.

    Slow ones swim for six periods, as in searches for fronts, so that they settle.
    """
    if config.worth is None:
        return
    names = list(dict.fromkeys(name for names in config.worth.fluids for name in names))
    for diameter, name, (k, one) in product(config.worth.diameters, names, enumerate(tried)):
        robot = config.robot.but(diameter=diameter)
        here = {"robot": robot, "engine": "planar", "physics_rate": config.planar_rate}
        here["duration"] = settled_duration(one.controller, config.duration)
        scenario = config.scenario(named_fluid(name), **here)
        yield {"diameter": diameter, "fluid": name, "candidate": k}, Case(one.controller, scenario)


def worth(config: AdaptationConfig, swims: pd.DataFrame, limits: Mapping[str, LimitFront | None]) -> Iterator[Row]:
    """Mean speeds over the fluids of each set at equal mean power, of one gait for all and of the best of each.

    Both are concave envelopes: between gaits power and speed are linear. A speed is NaN outside its envelope. The limit
    is known for the robot of the study.
    """
    if config.worth is None or swims.empty:
        return
    valid = swims[(swims["status"] == "ok") & (swims["power"] > 0) & (swims["speed"] > 0)]
    for here, names, currency in product(config.worth.diameters, config.worth.fluids, CURRENCIES):
        limit = limits[currency] if here == config.robot.diameter else None
        wide = valid[valid["diameter"] == here].pivot(index="candidate", columns="fluid")
        columns = [wide.reindex(columns=[(name, fluid) for fluid in names]) for name in (CURRENCIES[currency], "speed")]
        power, speed = (column.to_numpy(float) for column in columns)
        shares = np.full(len(names), 1 / len(names))
        envelopes = [envelope(*columns) for columns in zip(power.T, speed.T, strict=True)]
        single = envelope(power.mean(axis=1), speed.mean(axis=1))
        tuned = distributed(envelopes, shares) if len(single) else single
        ideal = _limit(limit, names, shares)
        condition = {"fluids": " / ".join(names), "diameter": here, "currency": currency}
        count = int((~np.isnan(power + speed).any(axis=1)).sum())
        for watts in config.worth.powers:
            one, best = (_within(curve, watts) for curve in (single, tuned))
            speeds = {"single_speed": one, "tuned_speed": best, "limit_speed": _within(ideal, watts)}
            yield {**condition, "power": watts, "gaits": count, "gain": best / one - 1, **speeds}


def _limit(front: LimitFront | None, names: Sequence[str], shares: FloatArray) -> FloatArray:
    if front is None:
        return np.zeros((0, 2))
    viscosity = np.array([named_fluid(name).kinematic_viscosity for name in names])
    return distributed([envelope(front.power, speed) for speed in front.at(viscosity)], shares)


def _within(curve: FloatArray, power: float) -> float:
    """A curve's value at a power; NaN outside its range."""
    return float(at_power(curve, power)) if len(curve) and power <= curve[-1, 0] else np.nan
