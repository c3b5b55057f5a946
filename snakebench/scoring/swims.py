"""A scored swim: its speed over the limit's at the same power."""

from collections.abc import Mapping
from typing import Any, Literal

from pydantic import Field

from snakebench.fluid import FluidField
from snakebench.names import CURRENCIES
from snakebench.scoring.tasks import Draw, Tasks
from snakebench.scoring.yardstick import Yardstick
from snakebench.value import Value


class Swim(Value):
    """A scored swim; what is not defined is None."""

    task: str
    where: str = Field(description="a fluid or a course")
    perturbation: str = Field("", description="that the robot has, if it has one")
    value: float | None = Field(None, description="of the perturbation")
    setting: str = Field("", description="of an entry that has several")
    target: float | None = Field(None, description="power that the entry is set to, as near as it can be [W]")
    status: Literal["ok", "diverged", "invalid", "off course"]
    speed: float | None = Field(None, description="mean along x [m/s]")
    power: float | None = Field(None, description="mean, P [W]")
    positive_power: float | None = Field(None, description="mean of the joints that drive, P+ [W]")
    course: float | None = Field(None, description="direction of the mean motion, from x [degrees]")
    limit: float | None = Field(None, description="speed of the limit at the same P+ [m/s]")
    score: float = Field(description="at P+")
    net_score: float = Field(description="at P")
    places: tuple[float, ...] = Field((), description="of the centre of mass along x, at every second of a course [m]")

    @property
    def label(self) -> tuple[Any, ...]:
        """What identifies it among the swims of an entry."""
        return self.task, self.where, self.perturbation, self.value, self.setting


def scored(
    tasks: Tasks, draw: Draw, measured: Mapping[str, Any], yardsticks: Mapping[str, Yardstick], **labels: Any
) -> Swim:
    """A measured swim with its scores: 0 unless it is valid, swims forward and keeps its course."""
    numbers, scores, limits = dict(measured), dict.fromkeys(CURRENCIES, 0.0), dict[str, float]()
    if numbers["status"] == "ok" and abs(numbers["course"]) > tasks.deviation:
        numbers["status"] = "off course"
    if numbers["status"] == "ok":
        for currency, column in CURRENCIES.items():
            limits[currency], error = _limit(tasks, draw, numbers[column], yardsticks[currency])
            scores[currency] = min(numbers["speed"] / limits[currency], 1 + error)
    where = {"task": draw.task, "where": draw.where, "perturbation": draw.perturbation, "value": draw.value}
    results = {"limit": limits.get("positive"), "score": scores["positive"], "net_score": scores["net"]}
    return Swim(**where, **labels, **numbers, **results)


def _limit(tasks: Tasks, draw: Draw, power: float, yardstick: Yardstick) -> tuple[float, float]:
    if isinstance(draw.fluid, FluidField):
        return yardstick.through(draw.fluid, power, tasks.changing.duration)
    return yardstick.at(draw.fluid, power)
