"""A batch of robots: each member swims as it would alone, whatever the threads and the others do."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import snakebench as sb
from snakebench.engines import load_engine
from snakebench.engines.planar import MOST_THREADS, Batch
from snakebench.errors import InvalidValue, UnknownName, UnstableRate

FLUIDS = [sb.named_fluid(name) for name in ("water", "oil1", "oil2")]
FIELD = sb.FluidField(along="x", knots=(-1.0, 1.0), fluids=(FLUIDS[0], FLUIDS[2]))
GAITS = [
    sb.SinusoidalTorque(amplitude=3.5, frequency=0.7, phase=0.84),
    sb.SinusoidalTorque(amplitude=2.0, frequency=0.4, phase=1.0),
    sb.ReplayedTorque(period=1.5, torque=tuple((a, -a, a, -a, a, -a, a) for a in (0.0, 0.5, 1.0, 0.2))),
    sb.SinusoidalTorque(amplitude=1.0, frequency=1.3, phase=0.3),
]
ROBOTS = [sb.Robot(), sb.Robot(diameter=0.07), sb.Robot(joint_stiffness=3.0), sb.Robot(torque_limit=0.5)]


def swimming(threads=1, robots=ROBOTS, media=(*FLUIDS, FIELD)):
    batch = Batch(robots, media, "torque", 120, threads)
    batch.follow([gait.waveform(7) for gait in GAITS], 360)
    return batch


@pytest.mark.parametrize("threads", [1, pytest.param(2, marks=pytest.mark.slow)])
def test_each_member_swims_as_it_would_alone_to_the_last_bit(threads):
    batch = swimming(threads)
    assert len(batch._work) == min(threads, MOST_THREADS)
    for b, (robot, medium, gait) in enumerate(zip(ROBOTS, (*FLUIDS, FIELD), GAITS, strict=True)):
        alone = sb.simulate(gait, robot=robot, fluid=medium, engine="planar", physics_rate=120, duration=3.0)
        together = batch.trajectory(b)
        for name in ("head", "joint_angle", "center", "torque", "energy"):
            assert np.array_equal(getattr(together, name), getattr(alone, name)), name
        assert sb.measure(together) == sb.measure(alone)


def test_a_diverging_member_is_marked_and_frozen_and_the_others_are_untouched():
    mad = [GAITS[0], sb.SinusoidalTorque(amplitude=1e4, frequency=1.0, phase=0.5), *GAITS[2:]]
    batch = Batch(ROBOTS, [*FLUIDS, FIELD], "torque", 120, threads=2)
    batch.follow([gait.waveform(7) for gait in mad], 360)
    assert batch.alive.tolist() == [True, False, True, True]
    assert batch.trajectory(1).diverged and len(batch.trajectory(1).time) < 361
    calm = swimming()
    for b in (0, 2, 3):
        assert np.array_equal(batch.trajectory(b).center, calm.trajectory(b).center)
    end, steps = batch.trajectory(1).center[-1], int(batch.steps[1])
    now = batch.follow([gait.waveform(7) for gait in GAITS], 12, every=6)
    assert np.array_equal(now.center[1], end, equal_nan=True) and batch.steps.tolist() == [372, steps, 372, 372]
    assert np.array_equal(batch.rows[1, 0], batch.rows[1, 2], equal_nan=True)
    batch.restart([1])
    assert batch.alive.all() and batch.now.head[1].tolist() == [-0.14, 0.0, 0.0]


def test_divergence_is_seen_at_once_however_few_rows_are_kept():
    mad = sb.SinusoidalTorque(amplitude=1e4, frequency=1.0, phase=0.5).waveform(7)
    ends = []
    for every in (1, 120):
        batch = Batch([sb.Robot()], FLUIDS[:1], "torque", 120)
        batch.follow([mad], 120, every=every)
        ends.append((int(batch.steps[0]), batch.alive[0], batch.now.center[0].tolist()))
    assert ends[0] == ends[1] and not ends[0][1]


def test_the_present_is_known_before_the_first_step():
    now = Batch([sb.Robot(), sb.Robot.with_joints(7, 0.05)], FLUIDS[:2], "angle", 120).now
    assert now.head.tolist() == [[-0.14, 0.0, 0.0]] * 2
    assert now.center[:, 0] == pytest.approx([sb.simulate(GAITS[0], duration=0.1).center[0, 0]] * 2)


def test_a_restarted_member_swims_as_a_new_one():
    batch = Batch([sb.Robot()] * 2, [FLUIDS[0]] * 2, "angle", 120)
    actions = 0.5 * np.sin(np.arange(60)[:, None, None] / 5 - np.arange(7)) * np.ones((1, 2, 1))
    for action in actions:
        batch.advance(action, 4)
    batch.restart([1], [FLUIDS[2]])
    for action in actions:
        now = batch.advance(action, 4)
    fresh = Batch([sb.Robot()], [FLUIDS[2]], "angle", 120)
    for action in actions:
        expected = fresh.advance(action[:1], 4)
    assert np.array_equal(now.center[1], expected.center[0]) and np.array_equal(now.energy[1], expected.energy[0])
    assert batch.steps.tolist() == [480, 240]


def test_actions_that_arrive_one_by_one_are_a_gait_of_held_targets():
    actions = np.random.default_rng(2).uniform(-0.5, 0.5, (60, 7))
    batch = Batch([sb.Robot()], [FLUIDS[1]], "angle", 240)
    for action in actions:
        now = batch.advance(action[None], 8)
    from snakebench.controllers import HeldTargets

    gait = HeldTargets(rate=30, targets=tuple(map(tuple, actions.tolist())))
    run = sb.simulate(gait, fluid=FLUIDS[1], engine="planar", physics_rate=240, duration=2.0)
    assert np.array_equal(now.center[0], run.center[-1]) and np.array_equal(now.energy[0], run.energy[-1])
    assert np.array_equal(now.command_torque[0], run.command_torque[-1])


def test_a_gait_from_outside_the_package_is_sampled_at_half_steps():
    class Paddle:
        drives = "torque"

        def commands(self, times, n_joints):
            return GAITS[0].commands(times, n_joints)

        def digest(self):
            return "paddle"

    inside, outside = (sb.simulate(gait, engine="planar", duration=3.0) for gait in (GAITS[0], Paddle()))
    assert outside.center == pytest.approx(inside.center, abs=1e-9)


def test_commands_that_are_not_finite_are_refused_by_environment_and_joint():
    batch = Batch([sb.Robot()] * 3, [FLUIDS[0]] * 3, "angle", 120)
    actions = np.zeros((3, 7))
    actions[2, 4] = np.nan
    with pytest.raises(InvalidValue, match="environment 2, joint 5: the command is nan: a finite number is needed"):
        batch.advance(actions, 4)
    assert batch.steps.tolist() == [0, 0, 0]


@pytest.mark.parametrize("engine", ["pybullet", "planar"])
def test_a_simulation_refuses_commands_that_are_not_finite(engine):
    commands = np.zeros((10, 7))
    commands[3, 0] = np.inf
    with load_engine(engine).open_simulation(sb.Robot(), FLUIDS[0], "torque", 480, 10) as run:
        with pytest.raises(InvalidValue, match="step 3, joint 1: the command is inf"):
            run.advance(commands)
        for shape in ((11, 7), (10, 6)):
            with pytest.raises(InvalidValue, match="at most 10 x 7 fit here"):
                run.advance(np.zeros(shape))
        with pytest.raises(InvalidValue, match="at most 10"):
            run.follow(GAITS[0], 25)
        run.follow(GAITS[0], 10)
        with pytest.raises(InvalidValue, match="at most 0"):
            run.follow(GAITS[0], 1)


@pytest.mark.parametrize("shape", [(2, 7), (3, 6)])
def test_actions_of_another_shape_are_refused(shape):
    batch = Batch([sb.Robot()] * 3, [FLUIDS[0]] * 3, "angle", 120)
    with pytest.raises(InvalidValue, match=r"\(3, 7\) is needed"):
        batch.advance(np.zeros(shape), 4)


def test_unequal_robots_are_refused():
    with pytest.raises(InvalidValue, match="with equal joints"):
        Batch([sb.Robot(), sb.Robot.with_joints(5)], FLUIDS[:2], "angle", 120)
    with pytest.raises(InvalidValue, match="1 robots in 2 media"):
        Batch([sb.Robot()], FLUIDS[:2], "angle", 120)


def test_impossible_batches_and_steps_are_refused():
    with pytest.raises(InvalidValue, match="threads = 0, physics_rate = 120: at least 1"):
        Batch([sb.Robot()], FLUIDS[:1], "angle", 120, threads=0)
    with pytest.raises(InvalidValue, match="physics_rate = 0: at least 1"):
        Batch([sb.Robot()], FLUIDS[:1], "angle", 0)
    with pytest.raises(UnknownName, match="did you mean angle"):
        Batch([sb.Robot()], FLUIDS[:1], "angles", 120)
    with pytest.raises(UnstableRate, match="in planar: at least 45 Hz is needed, such as 60"):
        Batch([sb.Robot()], FLUIDS[:1], "torque", 30)
    batch = Batch([sb.Robot()], FLUIDS[:1], "torque", 120)
    with pytest.raises(InvalidValue, match="n_steps = 0"):
        batch.advance(np.zeros((1, 7)), 0)
    with pytest.raises(InvalidValue, match="every = 7: it must divide the 120 steps"):
        batch.follow([GAITS[0].waveform(7)], 120, every=7)
    with pytest.raises(InvalidValue, match="2 waveforms for 1 robots"):
        batch.follow([GAITS[0].waveform(7)] * 2, 120)
    for joints in (1, 5):
        with pytest.raises(InvalidValue, match="7 joints are needed"):
            batch.follow([GAITS[0].waveform(joints)], 120)
    with pytest.raises(InvalidValue, match="a finite rate is needed"):
        batch.follow([sb.ReplayedTorque(period=1e-310, torque=((0.0,) * 7,) * 2).waveform(7)], 120)
    with pytest.raises(InvalidValue, match="1 media for 2 members"):
        Batch([sb.Robot()] * 2, FLUIDS[:2], "angle", 120).restart([0, 1], FLUIDS[:1])
    assert batch.advance([[0.1] * 7], 4).command[0, 0] == 0.1  # a list will do


def test_what_was_handed_out_stays_as_it_was():
    batch = Batch([sb.Robot()] * 2, FLUIDS[:2], "angle", 120)
    now, alive, steps = batch.advance(np.full((2, 7), 0.3), 4), batch.alive, batch.steps
    before = now.joint_angle.copy()
    batch.restart([0])
    assert np.array_equal(now.joint_angle, before) and before.all()
    assert alive.all() and steps.tolist() == [4, 4] and batch.steps.tolist() == [0, 4]
    assert batch.now.joint_angle[0].tolist() == [0.0] * 7 and np.array_equal(batch.now.joint_angle[1], before[1])


def test_a_trajectory_needs_every_step_from_rest():
    batch = Batch([sb.Robot()], FLUIDS[:1], "torque", 120)
    wave = [GAITS[0].waveform(7)]
    batch.follow(wave, 120, every=4)
    with pytest.raises(InvalidValue, match="no trajectory"):
        batch.trajectory(0)
    batch.restart([0])
    batch.follow(wave, 120)
    assert batch.trajectory(0).time[-1] == 1.0
    batch.follow(wave, 120)
    with pytest.raises(InvalidValue, match="no trajectory"):
        batch.trajectory(0)


@pytest.mark.parametrize("engine", ["pybullet", "planar"])
def test_advancing_in_pieces_changes_nothing(engine):
    open_simulation = load_engine(engine).open_simulation
    commands = sb.SeaSnake(amplitude=0.8, frequency=0.6, phase=0.7).commands(np.arange(240) / 240, 7)
    with (
        open_simulation(sb.Robot(), FLUIDS[0], "angle", 240, 240) as whole,
        open_simulation(sb.Robot(), FLUIDS[0], "angle", 240, 240) as pieces,
    ):
        whole.advance(commands)
        for k in range(0, 240, 16):
            pieces.advance(commands[k : k + 16])
        one, other = whole.trajectory(), pieces.trajectory()
    assert np.array_equal(one.center, other.center) and np.array_equal(one.energy, other.energy)
    assert np.array_equal(one.torque[:-1], other.torque[:-1])


@pytest.mark.slow
@pytest.mark.skipif(not Path("/proc/self/status").exists(), reason="asks Linux")
def test_four_thousand_robots_fit_into_a_gigabyte():
    script = """
from pathlib import Path
import numpy as np
import snakebench as sb
from snakebench.engines.planar import Batch, MOST_THREADS
media = [sb.Fluid(kinematic_viscosity=10.0 ** -(2 + b % 5)) for b in range(4096)]
batch = Batch([sb.Robot()] * 4096, media, "angle", 120, threads=2)
for k in range(3):
    batch.advance(np.full((4096, 7), 0.1), 4)
batch.follow([sb.SeaSnake(amplitude=0.5, frequency=0.5, phase=0.01 * b).waveform(7) for b in range(4096)], 120, every=4)
assert batch.alive.all()
print(Path("/proc/self/status").read_text().split("VmHWM:")[1].split()[0])
"""
    answer = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert float(answer.stdout) < 1e6  # kB at its highest, Python and its libraries included
