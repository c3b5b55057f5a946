"""Speed of the shared evaluator against the bare PyBullet loop: the same calls and arguments, and nothing else.

The bare loop is given the forces and torques that a swimming robot was given before, so that Bullet integrates the
same motion; it computes no fluid, no control, and records nothing.

    pytest benchmarks
"""

from __future__ import annotations

import numpy as np
import pybullet
import pytest

import snakebench as sb
from snakebench.engines import bullet
from snakebench.engines.swimmer import command

GAIT = sb.SinusoidalTorque(amplitude=3.5, frequency=0.70, phase=0.84)
RATE, ROUNDS, STEPS = 480, 15, 1000
COMMANDS = GAIT.commands(np.arange((ROUNDS + 1) * STEPS) / RATE, 7)


@pytest.fixture
def swimming():
    with bullet.open_simulation(sb.Robot(), sb.named_fluid("water"), "torque", RATE, len(COMMANDS)) as simulation:
        yield simulation


@pytest.fixture(scope="module")
def drives():
    """What Bullet was given at every step of the calibration gait: force x, y and moment on the head, joint torques."""
    given = []
    with bullet.open_simulation(sb.Robot(), sb.named_fluid("water"), "torque", RATE, len(COMMANDS)) as simulation:
        for i in range(len(COMMANDS)):
            command(simulation._swimmer, simulation._rows, simulation._step, COMMANDS, i)
            given.append(simulation._swimmer["drive"][0, :10].tolist())
            simulation.advance(COMMANDS[i : i + 1])
    return given


def in_rounds(benchmark, work):
    """Time `work(first, last)` on consecutive pieces of the run, the first of them unmeasured."""
    pieces = iter(range(ROUNDS + 1))
    benchmark.group, benchmark.extra_info["steps"] = "physics step", STEPS

    def piece():
        k = next(pieces)
        return (k * STEPS, (k + 1) * STEPS), {}

    benchmark.pedantic(work, setup=piece, rounds=ROUNDS, warmup_rounds=1)


def test_bare_loop(benchmark, swimming, drives):
    snake, client, joints = swimming._snake, swimming._client, tuple(range(7))

    def bare(first, last):
        position, _ = pybullet.getBasePositionAndOrientation(snake, client)
        for force_x, force_y, moment, *torques in drives[first:last]:
            pybullet.applyExternalForce(snake, -1, (force_x, force_y, 0.0), position, pybullet.WORLD_FRAME, client)
            pybullet.applyExternalTorque(snake, -1, (0.0, 0.0, moment), pybullet.WORLD_FRAME, client)
            pybullet.setJointMotorControlArray(
                snake, joints, pybullet.TORQUE_CONTROL, forces=torques, physicsClientId=client
            )
            pybullet.stepSimulation(client)
            position, _ = pybullet.getBasePositionAndOrientation(snake, client)
            pybullet.getJointStates(snake, joints, client)

    in_rounds(benchmark, bare)


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


def test_thirty_seconds_of_swimming(benchmark):
    sb.simulate(GAIT, duration=0.1)
    benchmark.pedantic(lambda: sb.evaluate(GAIT), rounds=5)
