"""Speed of both engines against PyBullet's own calls: the same calls and arguments, and nothing else.

The bare loop is given the forces and torques that a swimming robot was given before, so that Bullet integrates the
same motion; it computes no fluid, no control, and records nothing. `snakebench bench` compares whole workloads.

    pytest benchmarks
"""

from __future__ import annotations

import numpy as np
import pybullet
import pytest

import snakebench as sb
from snakebench.engines import bullet

GAIT = sb.SinusoidalTorque(amplitude=3.5, frequency=0.70, phase=0.84)
RATE, ROUNDS, STEPS = 480, 15, 1000
COMMANDS = GAIT.commands(np.arange((ROUNDS + 1) * STEPS) / RATE, 7)


@pytest.fixture
def swimming():
    with bullet.open_simulation(sb.Robot(), sb.named_fluid("water"), "torque", RATE, len(COMMANDS)) as simulation:
        yield simulation


@pytest.fixture(scope="module")
def loads():
    """What Bullet was given at every step of the calibration gait."""
    with bullet.open_simulation(sb.Robot(), sb.named_fluid("water"), "torque", RATE, len(COMMANDS)) as simulation:
        return simulation.loads(COMMANDS)


def in_rounds(benchmark, work, steps=STEPS):
    """Time `work(first, last)` on consecutive pieces of the run, the first of them unmeasured."""
    pieces = iter(range(ROUNDS + 1))
    benchmark.group, benchmark.extra_info["steps"] = "physics step", steps

    def piece():
        k = next(pieces)
        return (k * STEPS, (k + 1) * STEPS), {}

    benchmark.pedantic(work, setup=piece, rounds=ROUNDS, warmup_rounds=1)


def test_bare_loop(benchmark, swimming, loads):
    in_rounds(benchmark, lambda first, last: swimming.replay(loads[first:last]))


def test_evaluator(benchmark, swimming):
    in_rounds(benchmark, lambda first, last: swimming.advance(COMMANDS[first:last]))


def test_textbook_loop(benchmark, swimming):
    """What the generalised load saves: link states read and one external force a link, still without fluid."""
    snake, client, joints = swimming._snake, swimming._client, tuple(range(7))
    nothing, torques = (0.0, 0.0, 0.0), [0.0] * 7

    def textbook(first, last):
        for _ in range(first, last):
            pybullet.getBasePositionAndOrientation(snake, client)
            pybullet.getBaseVelocity(snake, client)
            states = pybullet.getLinkStates(
                snake, joints, computeLinkVelocity=1, computeForwardKinematics=1, physicsClientId=client
            )
            for link in range(-1, 7):
                pybullet.applyExternalForce(snake, link, nothing, states[0][0], pybullet.WORLD_FRAME, client)
            pybullet.setJointMotorControlArray(
                snake, joints, pybullet.TORQUE_CONTROL, forces=torques, physicsClientId=client
            )
            pybullet.stepSimulation(client)

    in_rounds(benchmark, textbook)


@pytest.mark.parametrize("gait", [GAIT, sb.SeaSnake(amplitude=0.9, frequency=0.6, phase=0.7)], ids=["torque", "angle"])
def test_planar(benchmark, gait):
    """A batch of 64 on one thread; each step of each robot counts."""
    batch = sb.Batch([sb.Robot()] * 64, [sb.named_fluid("water")] * 64, gait.drives, 120)
    waveforms = [gait.waveform(7)] * 64
    in_rounds(benchmark, lambda _first, _last: batch.follow(waveforms, 120, every=120), steps=64 * 120)


def test_thirty_seconds_of_swimming(benchmark):
    sb.simulate(GAIT, duration=0.1)
    benchmark.pedantic(lambda: sb.evaluate(GAIT), rounds=5)
