"""The force law against the paper's numbers and the second law of thermodynamics."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import snakebench as sb
from snakebench.physics.body import BODY, describe
from snakebench.physics.hydrodynamics import (
    added_mass,
    drag_coefficient,
    normal_resistance,
    tangential_resistance,
)

LINK = {"length": 0.148, "diameter": 0.10}
WATER = {"viscosity": 1.14e-6, "density": 999.0}


def tangential_force(v_t: float, v_n: float, *fluid: float, **given: float) -> float:
    """Along a link [N]."""
    return -tangential_resistance(v_t, v_n, *fluid, **given) * v_t


def normal_force(v_n: float, *fluid: float, **given: float) -> float:
    """Across a link [N]."""
    return -normal_resistance(v_n, *fluid, **given) * v_n


velocities = st.floats(-5, 5)
viscosities = st.floats(1e-7, 1e-2)


def test_both_forms_of_the_drag_coefficient_meet_at_reynolds_1e_6():
    fit = drag_coefficient(1e-6)
    lamb = drag_coefficient(math.nextafter(1e-6, 0))
    assert fit == pytest.approx(89_186, rel=1e-5)
    assert lamb == pytest.approx(89_186, rel=1e-4)


def test_lamb_form_below_reynolds_1e_6():
    reynolds = 1e-9
    printed = 1.36759 / (reynolds * (0.5 - 0.57722 - math.log(reynolds / 8))) + 2.72646e3
    assert drag_coefficient(reynolds) == pytest.approx(printed, rel=1e-12)


def test_a_cylinder_at_reynolds_1000_has_a_drag_coefficient_near_one():
    assert drag_coefficient(1e3) == pytest.approx(10 ** (0.039276 * 9 - 0.43683 * 3 + 0.91538), rel=1e-12)
    assert 0.8 < drag_coefficient(1e3) < 1.2  # smooth cylinder in steady flow


def test_normal_drag_of_a_middle_link_in_water():
    # 0.5 C_D rho d l v^2 with Re = 0.1 * 0.1 / 1.14e-6
    coefficient = drag_coefficient(0.1 * 0.1 / 1.14e-6)
    expected = -0.5 * coefficient * 999.0 * 0.10 * 0.148 * 0.1**2
    assert normal_force(0.1, shape=1.0, **WATER, **LINK) == pytest.approx(expected, rel=1e-12)


def test_tangential_force_without_crossflow():
    pressure = 0.5 * 0.022556 * 999.0 * math.pi * 0.10 * 0.148 * 0.3**2
    viscous = 0.31584 * 999.0 * math.pi * 0.10 * math.sqrt(1.14e-6 * 0.148) * 0.3 * math.sqrt(0.3)
    assert tangential_force(0.3, 0.0, **WATER, **LINK) == pytest.approx(-(pressure + viscous), rel=1e-12)


def test_crossflow_thins_the_boundary_layer():
    thinning = 1.0612 * 999.0 * math.pi * 0.10 * math.sqrt(1.14e-6 * 0.148) * 0.3 * math.sqrt(0.2)
    without, with_crossflow = (tangential_force(0.3, v_n, **WATER, **LINK) for v_n in (0.0, 0.2))
    assert without - with_crossflow == pytest.approx(thinning, rel=1e-9)


def test_added_mass_of_a_middle_link():
    assert added_mass(999.0, **LINK) == pytest.approx(math.pi * 0.01 / 4 * 0.011514 * 999.0 * 0.148, rel=1e-12)


def test_head_and_tail_meet_the_papers_multiples_of_the_normal_drag():
    body = np.recarray(1, BODY)[0]
    describe(body, sb.Robot(), "angle")
    assert body.drag_multiple[:8].tolist() == [2.9302, 1, 1, 1, 1, 1, 1, 2.8501]


def test_no_drag_at_rest():
    assert normal_force(0.0, shape=1.0, **WATER, **LINK) == 0.0
    assert tangential_force(0.0, 0.0, **WATER, **LINK) == 0.0


@given(v_t=velocities, v_n=velocities, viscosity=viscosities, density=st.floats(1, 2000))
def test_drag_never_adds_energy(v_t, v_n, viscosity, density):
    along = tangential_force(v_t, v_n, viscosity, density, **LINK)
    across = normal_force(v_n, viscosity, density, **LINK, shape=2.9)
    assert along * v_t <= 0 and across * v_n <= 0
    assert math.isfinite(along) and math.isfinite(across)


@given(v_t=velocities, v_n=velocities, viscosity=viscosities)
def test_opposite_motion_meets_opposite_drag(v_t, v_n, viscosity):
    forward = (
        tangential_force(v_t, v_n, viscosity, 900.0, **LINK),
        normal_force(v_n, viscosity, 900.0, **LINK, shape=1.0),
    )
    backward = (
        tangential_force(-v_t, -v_n, viscosity, 900.0, **LINK),
        normal_force(-v_n, viscosity, 900.0, **LINK, shape=1.0),
    )
    assert forward == (-backward[0], -backward[1])


@given(v_n=st.floats(1e-200, 1e-3))
def test_drag_vanishes_smoothly_with_the_velocity(v_n):
    assert abs(normal_force(v_n, shape=1.0, **WATER, **LINK)) <= 20 * v_n
