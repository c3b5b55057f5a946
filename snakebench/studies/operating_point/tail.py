"""How far the tail moves, by the definitions that the paper's figures may have."""

from dataclasses import fields
from functools import cached_property

from snakebench import metrics
from snakebench.scenario import Scenario
from snakebench.trajectory import Trajectory
from snakebench.value import FloatArray


class _AtLastLink(Trajectory):
    """The same run with the last link's centre in the place of the tail's tip."""

    @cached_property
    def tail_tip(self) -> FloatArray:
        """Position of the last link's centre [m], shape (n_times, 2)."""
        return self.links[:, -1, :2]


def tail_amplitudes(swim: Trajectory, _: Scenario) -> dict[str, float | None]:
    """Half and full peak-to-peak of tip and last link's centre [m], each as `metrics.tail_amplitude`."""
    halves: dict[str, float | None] = {"tip": None, "link": None}
    if not swim.diverged:
        frequency = metrics.swim_frequency(swim)
        window = metrics.steady_window(swim, frequency)
        at_link = _AtLastLink(**{field.name: getattr(swim, field.name) for field in fields(swim)})
        halves = {
            place: metrics.tail_amplitude(run, window, frequency) for place, run in (("tip", swim), ("link", at_link))
        }
    return {
        f"{place}_{name}": half and factor * half
        for place, half in halves.items()
        for name, factor in (("half", 1), ("full", 2))
    }
