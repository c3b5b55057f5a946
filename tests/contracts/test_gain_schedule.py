"""Gain scheduling: the estimator finds the viscosity, the schedule chooses the gait and keeps the phase."""

import numpy as np
import pytest

import snakebench as sb
from snakebench.errors import InvalidValue
from snakebench.gain_schedule import GainSchedule, Memory, ScheduledGait
from snakebench.learning.estimator import train_estimator
from snakebench.learning.settings import Swimming
from snakebench.scoring.entry import read_entry

SMALL = sb.Robot(lengths=(0.28, 0.44, 0.44, 0.32), masses=(1.0, 1.5, 1.5, 1.2))


def wave(viscosity, price, steps, amplitude, late=0):
    times = (np.arange(steps) + late)[:, None] / steps * 2 * np.pi
    targets = amplitude * np.sin(times - 0.9 * np.arange(3))
    return ScheduledGait(viscosity=viscosity, price=price, targets=targets.tolist())


@pytest.fixture(scope="module")
def gaits():
    return [
        wave(1e-6, 0.1, 30, 0.9), wave(1e-6, 1.0, 40, 0.5, late=7), wave(1e-3, 0.1, 50, 1.0), wave(1e-3, 1.0, 80, 0.6)
    ]  # fmt: skip


@pytest.fixture(scope="module")
def schedule(gaits):
    estimator = train_estimator(gaits, Swimming(robot=SMALL), seed=0, steps=1500)
    return GainSchedule(gaits=gaits, estimator=estimator, price=0.1)


@pytest.mark.parametrize(("fluid", "gait"), [("water", 0), ("oil2", 2)])
def test_the_gait_of_the_fluid_is_found_in_a_few_seconds(schedule, fluid, gait):
    swim = sb.simulate(schedule, fluid, robot=SMALL, engine="planar", duration=10.0)
    steps = np.array(schedule.gaits[gait].targets)
    last = swim.command[:-1:8][-len(steps) :]
    apart = [np.abs(np.roll(steps, k, axis=0) - last).max() for k in range(len(steps))]
    assert min(apart) < 1e-9


@pytest.mark.parametrize("viscosity", [3e-7, 1e-5, 2e-4, 5e-3])
def test_the_estimate_of_viscosity_is_right_to_a_third_of_a_decade(schedule, viscosity, monkeypatch):
    estimates, act = [], GainSchedule.act

    def watched(self, observation, memory):
        target, after = act(self, observation, memory)
        estimates.append(after.estimate)
        return target, after

    monkeypatch.setattr(GainSchedule, "act", watched)
    fluid = sb.Fluid(kinematic_viscosity=viscosity)
    sb.simulate(schedule, fluid, robot=SMALL, engine="planar", duration=10.0)
    assert np.mean(estimates[150:]) == pytest.approx(np.log10(viscosity), abs=1 / 3)


def test_what_never_changed_in_training_does_not_count(schedule, gaits):
    """In the plane the head never turns about x and y; a real one does."""
    first = np.array(schedule.estimator.weights[0])
    assert np.abs(first).max() < 1e3 and (first == 0).any()
    ones = train_estimator(gaits[:1], Swimming(robot=SMALL), seed=0, steps=1)
    assert np.isfinite(np.array(ones.weights[0])).all() and np.abs(ones.weights[0]).max() < 1e4


def test_a_change_of_the_gait_keeps_the_phase(schedule):
    for share in np.arange(0.0, 1.0, 0.1):
        at = []
        for k, amplitude in ((0, 0.9), (1, 0.5)):
            memory = Memory(share, k, -6.0, ())
            at.append(schedule.at(schedule.gaits[k].price).act(np.zeros(60, np.float32), memory)[0] / amplitude)
        assert np.abs(at[0] - at[1]).max() < 0.35  # a step of the coarser gait


def test_a_higher_price_chooses_the_thriftier_gait(schedule):
    costs = [sb.evaluate(schedule.at(price), "water", robot=SMALL, engine="planar").power for price in (0.1, 1.0)]
    assert costs[1] < 0.7 * costs[0]


def test_it_is_written_and_read(schedule):
    again = GainSchedule.model_validate_json(schedule.model_dump_json())
    assert again.digest() == schedule.digest() != schedule.at(0.5).digest()


def test_it_is_made_for_a_robot(schedule):
    with pytest.raises(InvalidValue, match="made for 3 joints"):
        schedule.begin(sb.Robot(), 30)


def test_gaits_of_several_robots_are_refused(schedule, gaits):
    mixed = [gaits[0].model_dump(), {"viscosity": 1e-6, "price": 1.0, "targets": [[0.0], [1.0]]}]
    with pytest.raises(InvalidValue, match="equally many joints"):
        GainSchedule(gaits=mixed, estimator=schedule.estimator)


def test_a_file_of_it_is_an_entry_at_several_prices(gaits, tmp_path):
    wide = [{**one.model_dump(), "targets": np.resize(one.targets, (len(one.targets), 7)).tolist()} for one in gaits]
    estimator = {"weights": [np.zeros((1, 58)).tolist()], "biases": [[-4.0]]}
    path = tmp_path / "schedule.json"
    path.write_text(GainSchedule(gaits=wide, estimator=estimator).model_dump_json())
    entry = read_entry(path)
    assert entry.information == "sensors"
    assert [entry.settings[k].controller.price for k in (0, -1)] == pytest.approx([0.1, 1.0])
