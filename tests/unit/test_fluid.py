"""Fluids against the paper's table, and fields at and between their knots."""

from __future__ import annotations

import math

import numpy as np
import pytest

import snakebench as sb
from snakebench import fluid as fluid_module
from snakebench.errors import InvalidValue, UnknownName
from snakebench.fluid import FLUIDS
from snakebench.physics.body import MEDIUM, immerse
from snakebench.physics.hydrodynamics import fluid_at


@pytest.mark.parametrize(
    ("name", "viscosity", "density"),
    [
        ("water", 1.14e-6, 999),
        ("oil1", 2.32e-4, 874),
        ("oil2", 4.79e-3, 900),
        ("oil2@100", 43.2e-6, 900),
        ("water@40", 0.658e-6, 999),
    ],
)
def test_named_fluids_are_the_papers(name, viscosity, density):
    fluid = sb.named_fluid(name)
    assert fluid.kinematic_viscosity == pytest.approx(viscosity, rel=1e-12)
    assert fluid.density == density


def test_three_fluids_at_three_temperatures():
    assert len(FLUIDS) == 9


def test_density_follows_the_logarithm_of_viscosity():
    between = math.sqrt(1.14e-6 * 2.32e-4)
    assert sb.Fluid(kinematic_viscosity=between).density == pytest.approx((999 + 874) / 2)
    assert sb.Fluid(kinematic_viscosity=1e-7).density == 999
    assert sb.Fluid(kinematic_viscosity=1e-2).density == 900


def test_a_changed_viscosity_brings_its_own_density_unless_one_was_given():
    assert sb.Fluid(kinematic_viscosity=1e-6).but(kinematic_viscosity=1e-2).density == 900
    assert sb.named_fluid("water").but(kinematic_viscosity=1e-2).density == 999


def test_another_known_fluid_leaves_the_density_rule_alone(monkeypatch):
    monkeypatch.setitem(fluid_module._VISCOSITIES, "glycerol", {15: 2e-3})
    monkeypatch.setitem(fluid_module._DENSITIES, "glycerol", 1260.0)
    assert sb.Fluid(kinematic_viscosity=4.79e-3).density == 900


def medium_of(field: sb.FluidField) -> np.record:
    """The record of a field, as compiled code is handed it."""
    record = np.recarray(1, MEDIUM)[0]
    immerse(record, field)
    return record


def test_a_ramp_is_linear_in_log_viscosity_and_in_density():
    field = sb.FluidField(along="time", knots=(10, 20), fluids=(sb.named_fluid("water"), sb.named_fluid("oil2")))
    table = medium_of(field)
    assert fluid_at(table, 5.0, 0.0) == pytest.approx((1.14e-6, 999))
    assert fluid_at(table, 15.0, 0.0) == pytest.approx((math.sqrt(1.14e-6 * 4.79e-3), 949.5))
    assert fluid_at(table, 25.0, 0.0) == pytest.approx((4.79e-3, 900))


def test_a_step_holds_until_the_next_knot():
    fluids = (sb.named_fluid("water"), sb.named_fluid("oil2"), sb.named_fluid("water"))
    table = medium_of(sb.FluidField(along="x", knots=(0, 1, 2), fluids=fluids, between="step"))
    seen = [fluid_at(table, 0.0, x)[0] for x in (-3.0, 0.999, 1.0, 1.999, 2.0, 9.0)]
    assert seen == pytest.approx([1.14e-6, 1.14e-6, 4.79e-3, 4.79e-3, 1.14e-6, 1.14e-6])


def test_an_unknown_fluid_is_answered_with_the_nearest():
    with pytest.raises(UnknownName, match="did you mean water"):
        sb.named_fluid("watr")


@pytest.mark.parametrize(
    "fields",
    [{"kinematic_viscosity": 0}, {"kinematic_viscosity": math.nan}, {"kinematic_viscosity": 1e-6, "density": -1}],
)
def test_impossible_fluids_are_refused(fields):
    with pytest.raises(InvalidValue, match="Fluid: "):
        sb.Fluid(**fields)


@pytest.mark.parametrize(
    ("knots", "names"), [((0, 0), ("water", "oil1")), ((1, 0), ("water", "oil1")), ((0,), ("water", "oil1"))]
)
def test_knots_must_increase_and_match_the_fluids(knots, names):
    with pytest.raises(InvalidValue, match="knots"):
        sb.FluidField(along="time", knots=knots, fluids=tuple(map(sb.named_fluid, names)))
