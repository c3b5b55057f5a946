"""The bounds that every evaluation states on its error hold: against the planar engine's limit of small steps."""

from __future__ import annotations

import tomllib
from collections.abc import Iterable, Iterator
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from adversaries import targets

import snakebench as sb
from snakebench.accuracy import LARGEST_ERROR
from snakebench.controllers import gait_of

GAITS = tomllib.loads((Path(__file__).parents[2] / "studies" / "validation.toml").read_text())["gaits"]
FLUIDS = ("water", "oil1", "oil2", "water@100", "oil1@40", "oil2@100")


@cache
def limit(gait: sb.Gait, fluid: str, duration: float) -> sb.Evaluation:
    return sb.evaluate(gait, fluid, engine="planar", physics_rate=1920, duration=duration)


def check_bounds(swims: Iterable[tuple[sb.Gait, str]], engine: str, rate: int, duration: float = 30.0) -> None:
    """Make sure that the bounds hold; at most every fifth swim may be measured unlike its limit, and says nothing."""
    told = [beyond(gait, fluid, engine, rate, duration) for gait, fluid in swims]
    compared = [lines for lines in told if lines is not None]
    assert len(compared) >= 0.8 * len(told) > 0
    assert not [line for lines in compared for line in lines]


def beyond(gait: sb.Gait, fluid: str, engine: str, rate: int, duration: float) -> list[str] | None:
    """What is further from the limit than its bound says; None where the two were not measured alike."""
    found = sb.evaluate(gait, fluid, engine=engine, physics_rate=rate, duration=duration)
    true = limit(gait, fluid, duration)
    if found.status != "ok" or found.steady != true.steady:
        return None
    errors = {
        "v": (abs(found.speed / true.speed - 1), found.speed_error),
        "P": (abs(found.power / true.power - 1), found.power_error),
    }
    return [
        f"{gait} in {fluid}: {name} {error:.2e} above {bound:.2e}"
        for name, (error, bound) in errors.items()
        if not error <= bound
    ]


def random_gait(kind: int, rng: np.random.Generator) -> sb.Gait:
    """One of the searches' spaces, or free target angles of up to three harmonics."""
    if kind < 2:
        gait = (sb.SeaSnake, sb.SinusoidalTorque)[kind]
        return gait(**{name: float(rng.uniform(*bounds)) for name, bounds in gait.SPACE.items()})
    harmonics = int(rng.integers(1, 4))
    cosine, sine = rng.uniform(0.1, 0.8) / harmonics * rng.normal(size=(2, harmonics, 7))
    return sb.Fourier(
        frequency=float(rng.uniform(0.2, 1.2)),
        cosine=tuple(map(tuple, cosine.tolist())),
        sine=tuple(map(tuple, sine.tolist())),
    )


def random_gaits(count: int) -> Iterator[tuple[sb.Gait, str]]:
    rng = np.random.default_rng(8)
    for i in range(count):
        yield random_gait(i % 3, rng), FLUIDS[i // 3 % len(FLUIDS)]


@pytest.mark.parametrize(("engine", "rate"), [("pybullet", 480), ("planar", 240)])
@pytest.mark.parametrize("name", ["calibration", "short-sea", "fourier-two"])
def test_the_bounds_hold(name, engine, rate):
    check_bounds([(gait_of(GAITS[name]), "oil2")], engine, rate)


def test_the_bounds_hold_for_commands_made_to_break_them():
    check_bounds([(targets("alternating", 10), "oil1")], "pybullet", 480, 10.0)


def test_a_gait_that_hardly_swims_is_flagged():
    """It drives and brakes almost equally, so that its power is a small difference of large ones."""
    found = sb.evaluate(targets("alternating", 10), "oil1", duration=10.0)
    assert found.power_error > LARGEST_ERROR
    assert found.uncertain["power"] == found.power_error
    assert not sb.evaluate(gait_of(GAITS["calibration"]), "oil1").uncertain


def test_bounds_fall_with_the_square_of_the_step():
    gait = gait_of(GAITS["sea-snake"])
    coarse, fine = (sb.evaluate(gait, "oil1", physics_rate=rate) for rate in (480, 960))
    assert coarse.speed_error / fine.speed_error == pytest.approx(4, rel=0.05)
    assert coarse.power_error / fine.power_error == pytest.approx(4, rel=0.1)


def test_a_robot_at_rest_has_no_bounds():
    found = sb.evaluate(sb.SeaSnake(amplitude=0.0, frequency=0.5, phase=0.7), duration=2.0)
    assert (found.speed_error, found.power_error) == (None, None)


@pytest.mark.slow
@pytest.mark.parametrize(("engine", "rate"), [("pybullet", 480), ("pybullet", 960), ("planar", 240)])
def test_the_bounds_hold_for_all_gaits_of_the_validation_study(engine, rate):
    check_bounds([(gait_of(gait), fluid) for gait in GAITS.values() for fluid in FLUIDS[:3]], engine, rate)


@pytest.mark.slow
@pytest.mark.parametrize(("engine", "rate"), [("pybullet", 480), ("pybullet", 960), ("planar", 240)])
@pytest.mark.parametrize("kind", ["random", "bang-bang", "alternating"])
def test_the_bounds_hold_for_all_adversaries(kind, engine, rate):
    check_bounds([(targets(kind, 10), fluid) for fluid in FLUIDS[:3]], engine, rate, 10.0)


@pytest.mark.slow
def test_the_bounds_hold_for_300_random_gaits_in_six_fluids():
    check_bounds(random_gaits(300), "pybullet", 480)
