"""What may be registered, and what a gait or a metric that is none of ours may tell."""

from __future__ import annotations

from typing import ClassVar, Literal

import numpy as np
import pytest

import snakebench as sb
from snakebench.errors import InvalidValue

ZEROS = {
    "too few rows": (lambda times, n: np.zeros((3, n)), "commands of shape (3, 7) and type float64"),
    "complex": (lambda times, n: np.zeros((len(times), n), complex), "type complex128"),
    "ragged": (lambda times, n: [[0.0], [0.0, 0.0]], "commands of list"),
    "nothing": (lambda times, n: None, "commands of NoneType"),
    "not finite": (lambda times, n: np.full((len(times), n), np.nan), "step 0, joint 1: the command is nan"),
}


class Told(sb.Gait):
    """A gait that tells what a test wants."""

    SPACE: ClassVar = {"amplitude": (0.0, 1.0)}

    kind: Literal["told"] = "told"
    what: str
    amplitude: float = 0.0

    @property
    def drives(self) -> Literal["angle"]:
        return "angle"

    def commands(self, times, n_joints):
        return [[0.1] * n_joints] * len(times) if self.what == "list" else ZEROS[self.what][0](times, n_joints)


class Reversed(Told):
    SPACE: ClassVar = {"amplitude": (1.0, 0.0)}


class Strange(Told):
    SPACE: ClassVar = {"lag": (0.0, 1.0)}


@pytest.mark.parametrize(
    ("registry", "name", "thing", "complaint"),
    [
        (sb.GAITS, "mine", len, "is no class derived from Gait"),
        (sb.GAITS, "mine", sb.SeaSnake, "its kind is 'sea-snake': the two must be the same"),
        (sb.GAITS, "told", Strange, "gait 'told': SPACE has bounds of lag, which it has no field for"),
        (sb.GAITS, "told", Reversed, "SPACE has amplitude = (1.0, 0.0): the first bound must be below the second"),
        (sb.FLUIDS, "water", sb.Fluid(kinematic_viscosity=1e-5), "fluid 'water' is there already"),
        (sb.FLUIDS, "1e-2", sb.Fluid(kinematic_viscosity=1e-3), "fluid '1e-2': it must begin with a letter"),
        (
            sb.FLUIDS,
            "a/b",
            sb.Fluid(kinematic_viscosity=1e-3),
            "fluid 'a/b': a name of letters, digits and _ . , @ + -",
        ),
        (sb.ROBOTS, "mine", sb.Robot, "is no Robot"),
        (sb.METRICS, "mine", 3, "metric 'mine': 3 cannot be called"),
        (sb.METRICS, "return", len, "metric 'return': there is a column of that name already"),
        (sb.METRICS, "phase", len, "metric 'phase': there is a column of that name already"),
        (sb.METRICS, "my-own", len, "metric 'my-own': a name of letters, digits and _ is needed"),
    ],
)
def test_what_could_not_be_used_is_refused_where_it_is_registered(registry, name, thing, complaint):
    before = dict(registry)
    with pytest.raises(InvalidValue) as refused:
        registry[name] = thing
    assert complaint in str(refused.value) and "\n" not in str(refused.value)
    assert dict(registry) == before


@pytest.mark.parametrize("engine", ["pybullet", "planar"])
@pytest.mark.parametrize("what", ZEROS)
def test_a_gait_that_tells_no_commands_is_refused_in_a_line(engine, what):
    with pytest.raises(InvalidValue) as refused:
        sb.simulate(Told(what=what), duration=0.5, engine=engine, physics_rate=480)
    assert ZEROS[what][1] in str(refused.value) and "\n" not in str(refused.value)


def test_commands_may_be_lists():
    assert not sb.simulate(Told(what="list"), duration=0.5).diverged


@pytest.mark.parametrize("value", ["fast", [1.0, 2.0], np.zeros(3)])
def test_a_metric_that_is_no_number_is_refused_in_a_line(value):
    sb.METRICS["mine"] = lambda trajectory, window: value
    try:
        with pytest.raises(InvalidValue, match=r"metric 'mine': .* is no number"):
            sb.evaluate(sb.SeaSnake(amplitude=0.5, frequency=1.0, phase=0.7), engine="planar", duration=3.0)
    finally:
        del sb.METRICS["mine"]
