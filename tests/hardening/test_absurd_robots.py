"""However absurd a robot, its gait or its fluid: one refusal in a line, or numbers."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

import snakebench as sb
from snakebench.engines import load_engine
from snakebench.errors import InvalidValue

FASTEST = 24_000  # physics rate that is tried [Hz]
GAIT = sb.SeaSnake(amplitude=0.5, frequency=0.7, phase=0.5)
ABSURD = {
    "sizes": {"lengths": (1e-300, 1e12), "masses": (1e-300, 1e12)},
    "a hair": {"diameter": 1e-200},
    "gains": {"proportional_gain": 1e12, "derivative_gain": 1e12},
    "dust": {"lengths": (1e-9,) * 64, "masses": (1e-9,) * 64},
    "a gnat and a whale": {"lengths": (1e-4, 100.0, 1e-4), "masses": (1e-9, 1e6, 1e-9)},
}


def powers(least: float, most: float) -> st.SearchStrategy[float]:
    """Numbers of every size."""
    return st.floats(np.log10(least), np.log10(most)).map(lambda power: min(max(10.0**power, least), most))


def one_of_sizes(allowed: tuple[float, float], absurd: bool) -> st.SearchStrategy[float]:
    return st.floats() | powers(1e-300, 1e300) | powers(*allowed) if absurd else powers(*allowed)


@st.composite
def robots(draw: st.DrawFn, absurd: bool) -> dict[str, object]:
    n = draw(st.integers(2, 12) | st.just(64))
    size, mass, gain = (one_of_sizes(bounds, absurd) for bounds in ((1e-4, 1e2), (1e-9, 1e6), (1e-12, 1e6)))
    alike = draw(st.booleans())
    lengths, masses = (
        [draw(kind)] * n if alike else draw(st.lists(kind, min_size=n, max_size=n)) for kind in (size, mass)
    )
    gains = ("joint_stiffness", "joint_damping", "proportional_gain", "derivative_gain", "cover_mass")
    some = {name: draw(st.just(0.0) | gain) for name in draw(st.sets(st.sampled_from(gains)))}
    limits = ("torque_limit", "speed_limit", "angle_limit", "stop_stiffness")
    return {
        "lengths": tuple(lengths),
        "masses": tuple(masses),
        "diameter": draw(size),
        **some,
        **{name: draw(gain) for name in draw(st.sets(st.sampled_from(limits)))},
    }


def gaits() -> st.SearchStrategy[sb.Gait]:
    waves = st.fixed_dictionaries(
        {"amplitude": powers(1e-12, 1e12), "frequency": powers(1e-12, 1e12), "phase": st.floats(-1e12, 1e12)}
    )
    usual = st.just({"amplitude": 0.5, "frequency": 0.7, "phase": 0.5})
    return st.builds(
        lambda kind, wave: kind(**wave), st.sampled_from([sb.SeaSnake, sb.SinusoidalTorque]), usual | waves
    )


def fluids() -> st.SearchStrategy[sb.Fluid]:
    return st.just(sb.named_fluid("water")) | st.builds(
        lambda viscosity, density: sb.Fluid(kinematic_viscosity=viscosity, density=density),
        powers(1e-300, 1e12),
        powers(1e-300, 1e12),
    )


def told_of(robot: dict[str, object], gait: sb.Gait, engine: str, fluid: sb.Fluid) -> str:
    """Swim, at the rate that the robot needs, if that is no matter of minutes; the status, or why it is refused."""
    try:
        body = sb.Robot(**robot)
        needed = load_engine(engine).stable_rate(body, gait.drives)
        rate = min(max(240, int(np.ceil(min(needed, FASTEST) / 30)) * 30), FASTEST)
        evaluation = sb.evaluate(gait, robot=body, engine=engine, fluid=fluid, physics_rate=rate, duration=0.1)
    except InvalidValue as refused:
        told = str(refused)
    else:
        told = evaluation.status
        assert told in {"ok", "diverged", "invalid"}
    assert "\n" not in told
    return told


@pytest.mark.parametrize("engine", ["planar", "pybullet"])
@pytest.mark.parametrize("absurd", [False, True])
def test_a_robot_swims_or_is_refused_in_a_line(engine, absurd):
    told = set()

    @settings(max_examples=25)
    @example({}, sb.SeaSnake(amplitude=0.5, frequency=1.0, phase=0.7), sb.named_fluid("water"))
    @given(robots(absurd), gaits(), fluids())
    def swim(robot: dict[str, object], gait: sb.Gait, fluid: sb.Fluid) -> None:
        told.add(told_of(robot, gait, engine, fluid))

    swim()
    assert "ok" in told


@pytest.mark.parametrize("name", ABSURD)
def test_a_robot_that_cannot_be_is_refused_in_a_line(name):
    with pytest.raises(InvalidValue) as refused:
        sb.evaluate(GAIT, robot=sb.Robot(**ABSURD[name]), duration=0.1)
    assert "\n" not in str(refused.value)


def test_a_refusal_tells_the_range():
    with pytest.raises(InvalidValue, match=r"^Robot: diameter = 1e-200: allowed are 0.0001 to 100$"):
        sb.Robot(diameter=1e-200)
    with pytest.raises(InvalidValue, match=r"^Robot: lengths.1 = 1e\+30: allowed are 0.0001 to 100$"):
        sb.Robot(lengths=(1.0, 1e30), masses=(1.0, 1.0))


@pytest.mark.parametrize("scale", [0.01, 0.1, 1.0, 10.0, 30.0])
@pytest.mark.parametrize("joints", [2, 7, 30])
def test_a_robot_from_millimetres_to_tens_of_metres_swims(scale, joints):
    paper = sb.Robot.with_joints(joints)
    robot = sb.Robot(
        lengths=tuple(scale * length for length in paper.lengths),
        masses=tuple(scale**3 * mass for mass in paper.masses),
        cover_mass=scale**3 * paper.cover_mass,
        diameter=scale * paper.diameter,
    )
    assert load_engine("pybullet").stable_rate(robot, "angle") > 0
    status = sb.evaluate(GAIT, robot=robot, engine="planar", duration=0.1).status
    assert status == "ok" or (status == "diverged" and not 0.1 <= scale <= 10)
