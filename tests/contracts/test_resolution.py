"""Gaits that the physics steps cannot resolve are refused: sampled too rarely, they would swim as slower ones do."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest

import snakebench as sb
from snakebench.engines.planar import Batch
from snakebench.errors import InvalidValue
from snakebench.fluid import named_fluid
from snakebench.studies.config import study_path, study_settings
from snakebench.studies.running import study_config

ENGINES = ("pybullet", "planar")
WAVE = tuple((np.sin(2 * np.pi * k / 16),) * 7 for k in range(16))
HIGH = ((0.0,) * 7,) * 9 + ((0.1,) * 7,)


@dataclass
class Own:
    """A gait that is no waveform, as of a plug-in."""

    frequency: float
    drives = "torque"

    def commands(self, times, n_joints):
        return np.sin(2 * np.pi * self.frequency * times[:, None] - np.arange(n_joints))

    def digest(self):
        return f"own {self.frequency}"


GAITS = {
    "sinusoidal torque": lambda f: sb.SinusoidalTorque(amplitude=3.5, frequency=f, phase=0.84),
    "sea snake": lambda f: sb.SeaSnake(amplitude=0.1, frequency=f, phase=0.7),
    "tenth harmonic": lambda f: sb.Fourier(frequency=f / 10, cosine=HIGH, sine=HIGH),
    "replayed torque": lambda f: sb.ReplayedTorque(period=1 / f, torque=WAVE),
    "own": Own,
}


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("make", GAITS.values(), ids=GAITS)
def test_a_gait_that_would_alias_is_refused(make, engine):
    rate = 480
    assert sb.evaluate(make(rate / 10), engine=engine, physics_rate=rate, duration=0.1).status == "ok"
    for frequency in (1.01 * rate / 10, rate + 0.7, 1e9):
        with pytest.raises(InvalidValue, match="10 steps in a period"):
            sb.evaluate(make(frequency), engine=engine, physics_rate=rate, duration=0.1)


@pytest.mark.parametrize("engine", ENGINES)
def test_held_targets_that_steps_would_skip_are_refused(engine):
    targets = ((0.1,) * 7, (-0.1,) * 7)
    held = sb.HeldTargets(rate=480.0, targets=targets)
    assert sb.evaluate(held, engine=engine, physics_rate=480, duration=0.1).status == "ok"
    with pytest.raises(InvalidValue, match="too low for a gait as fast"):
        sb.evaluate(held.but(rate=481.0), engine=engine, physics_rate=480, duration=0.1)


def test_a_batch_refuses_them_too():
    batch = Batch([sb.Robot()], [named_fluid("water")], "torque", 240)
    batch.follow([GAITS["sinusoidal torque"](24.0).waveform(7)], 10)
    with pytest.raises(InvalidValue, match="10 steps in a period"):
        batch.follow([GAITS["sinusoidal torque"](240.7).waveform(7)], 10)


def test_a_recorded_torque_is_replayed_at_half_the_rate_of_its_record():
    run = sb.simulate(sb.SeaSnake(amplitude=0.9, frequency=0.6, phase=0.7), physics_rate=960, duration=5.0)
    torque = run.command_torque[-3200:-1:1]
    replayed = sb.ReplayedTorque(period=len(torque) / 960, torque=tuple(map(tuple, torque.tolist())))
    assert sb.evaluate(replayed, physics_rate=480, duration=1.0).status == "ok"


@pytest.mark.parametrize(
    ("study", "change"),
    [
        ("pareto", {"spaces": {"wide": {"frequency": [0.1, 100.0]}}}),
        ("sea_snake", {"space": {"frequency": [0.1, 100.0]}}),
        ("fourier", {"frequency": [0.1, 100.0]}),
    ],
)
def test_a_search_for_such_gaits_is_refused_before_it_begins(study, change):
    with pytest.raises(InvalidValue, match="10 steps in a period"):
        study_config(study_settings(study_path(study)) | change)
