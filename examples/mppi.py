"""Model predictive control by sampling, told fluid and state: python examples/mppi.py --fluid oil1.

It is model predictive path integral control (Williams et al., ICRA 2017) with noise that is correlated in time. The
model is the planar engine: at every control step, many robots start from the present state and swim the plan with
noise; the plan becomes the mean of theirs, weighted by the exponential of what they reach. What counts is the share of
the limit's speed at the same power, over the last seconds and the plan, and of the old plan, the best and the mean the
best is kept (ours): a plan is never worse in the model than the one that it came from. The first plan is a travelling
wave. With a gain schedule, the fluid is what the schedule's estimator says. The result is no entry, since it needs a
simulator: it is a reference of what feedback can reach.
"""

import argparse
import time
from collections import deque
from pathlib import Path

import numpy as np

import snakebench as sb
from snakebench.engines.planar import Batch
from snakebench.errors import InvalidValue
from snakebench.gain_schedule import GainSchedule
from snakebench.physics.joints import Drives
from snakebench.scoring.tasks import load_tasks
from snakebench.scoring.yardstick import Yardstick
from snakebench.value import digest

RATE, EVERY = 30, 3  # control steps in a second; physics steps in a control step of the model


class Model(Batch):
    """Robots in the planar engine that can be put into any state."""

    def place(self, now, fluid):
        """Put all robots into the state of one robot, and into a fluid."""
        self.restart(range(len(self)), [fluid] * len(self))
        links = [np.concatenate([[head], joints]) for head, joints in ((now.head[2], now.joint_angle),
                                                                       (now.head_rate[2], now.joint_rate))]  # fmt: skip
        self._places[:] = np.concatenate([now.center, np.cumsum(links[0])])
        self._rates[:] = np.concatenate([now.center_rate, np.cumsum(links[1])])

    def swim(self, plans):
        """Distances along x [m] and positive work [J] of plans, shape (robots, steps, n_joints), from that state on."""
        begin = self._places[:, 0].copy()
        for step in range(plans.shape[1]):
            now = self.advance(plans[:, step], EVERY)
        lost = np.where(self.alive, 0.0, np.inf)
        return now.center[:, 0] - begin - lost, now.energy[:, 1]


class Mppi:
    """The controller, in closed loop.

    Args:
        samples: how many robots try a plan.
        horizon: control steps of a plan.
        past: control steps before the present that count as well.
        noise: standard deviation of the noise of targets [rad].
        correlation: of the noise from one control step to the next.
        temperature: of the weights, over the spread of what the samples reach.
        wave: amplitude [rad], frequency [Hz] and lag from joint to joint [rad] of the first plan.
        seed: of the noise.
        schedule: a gain schedule whose estimate of the viscosity takes the place of the true one; None to be told it.
    """

    drives: Drives = "angle"

    def __init__(self, samples=96, horizon=45, past=60, noise=0.25, correlation=0.9, temperature=0.3,
                 wave=(0.9, 0.7, 0.8), seed=0, schedule=None):  # fmt: skip
        self.samples, self.horizon, self.past, self.noise = samples, horizon, past, noise
        self.correlation, self.temperature, self.wave, self.seed = correlation, temperature, wave, seed
        self.schedule = schedule

    def digest(self):
        """A hash of the settings and of this file."""
        settings = vars(self) | {"schedule": self.schedule and self.schedule.digest()}
        return digest([Path(__file__).read_text(encoding="utf-8"), sorted(settings.items())])

    def begin(self, robot, control_rate):
        """What tells the target angles of each control step."""
        if control_rate != RATE:
            raise InvalidValue(f"control_rate = {control_rate} Hz: the plan is made for {RATE} Hz")
        return Planner(self, robot)


class Planner:
    """A run of the controller: its plan, and how far and at which cost the robot has come."""

    def __init__(self, mppi, robot):
        self.mppi, self.joints, self.step = mppi, robot.n_joints, 0
        water = sb.named_fluid("water")  # until robots are placed
        self.model, self.single = (Model([robot] * n, [water] * n, "angle", RATE * EVERY) for n in (mppi.samples, 1))
        self.estimating = mppi.schedule and mppi.schedule.begin(robot, RATE)
        self.rng, self.limit = np.random.default_rng(mppi.seed), Yardstick(load_tasks("v1"), "positive")
        self.plan, self.past = np.array([self.first(k) for k in range(mppi.horizon)]), deque(maxlen=mppi.past + 1)

    def first(self, step):
        """Target angles of the first plan [rad]."""
        amplitude, frequency, lag = self.mppi.wave
        return amplitude * np.sin(2 * np.pi * frequency * step / RATE - lag * np.arange(self.joints))

    def __call__(self, now, viscosity):
        """Target angles [rad], from the present and the viscosity at the head [m^2/s]."""
        if self.estimating:
            self.estimating(now, viscosity)
            viscosity = 10**self.estimating._memory.estimate
        self.past.append((now.center[0], now.energy[1]))
        self.plan = self.better(now, viscosity, self.plan)
        target, self.step = self.plan[0], self.step + 1
        if self.estimating:
            self.estimating._target = target  # what it did, not what the schedule would have done
        change = self.plan[-1] - self.first(self.step + self.mppi.horizon - 2)  # from the first plan, kept
        following = self.first(self.step + self.mppi.horizon - 1) + change * self.mppi.correlation
        self.plan = np.clip(np.vstack([self.plan[1:], following]), -1.0, 1.0)
        return target

    def better(self, now, viscosity, plan):
        """The best of the plan, its noisy copies and their weighted mean."""
        plans = np.clip(plan + self.noises(), -1.0, 1.0)
        plans[0] = plan
        found = np.maximum(self.shares(self.model, now, viscosity, plans), -1.0)  # a robot that diverges is at -inf
        weights = np.exp((found - found.max()) / (self.mppi.temperature * found.std() + 1e-12))
        mean = np.tensordot(weights / weights.sum(), plans, 1)
        reached = self.shares(self.single, now, viscosity, mean[None])[0]
        return mean if reached >= found.max() else plans[found.argmax()]

    def noises(self):
        """Noise of the plans [rad], shape (samples, horizon, n_joints), correlated in time."""
        mppi, kept = self.mppi, self.mppi.correlation
        noise = mppi.noise * self.rng.normal(size=(mppi.samples, mppi.horizon, self.joints))
        for k in range(1, mppi.horizon):
            noise[:, k] = kept * noise[:, k - 1] + np.sqrt(1 - kept**2) * noise[:, k]
        return noise

    def shares(self, model, now, viscosity, plans):
        """The share of the limit that each plan reaches, over the past that counts and the plan."""
        model.place(now, sb.Fluid(kinematic_viscosity=viscosity))
        distance, work = model.swim(plans)
        x, energy = np.array(self.past[-1]) - np.array(self.past[0])
        seconds = (len(self.past) - 1 + len(plans[0])) / RATE
        power = np.maximum((energy + work) / seconds, 1e-9)
        return (x + distance) / seconds / self.limit.speeds(np.full(len(power), viscosity), power)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--fluid", default="water")
    parser.add_argument("--schedule", type=Path, help="gain schedule, a file, whose estimator tells the fluid")
    parser.add_argument("--seconds", type=float, default=30.0, help="of the swim")
    parser.add_argument("--samples", type=int, default=96)
    parser.add_argument("--horizon", type=int, default=45, help="control steps of a plan")
    parser.add_argument("--engine", choices=("planar", "pybullet"), default="planar", help="of the robot")
    parser.add_argument("--seed", type=int, default=0)
    asked = parser.parse_args()
    begun = time.monotonic()
    schedule = GainSchedule.model_validate_json(asked.schedule.read_text()) if asked.schedule else None
    mppi = Mppi(samples=asked.samples, horizon=asked.horizon, seed=asked.seed, schedule=schedule)
    swim = sb.simulate(mppi, asked.fluid, engine=asked.engine, duration=asked.seconds)
    half = len(swim.time) // 2
    seconds = swim.time[-1] - swim.time[half]
    speed = (swim.center[-1, 0] - swim.center[half, 0]) / seconds
    power = (swim.positive_work[-1] - swim.positive_work[half]) / seconds
    limit = Yardstick(load_tasks("v1"), "positive").at(sb.named_fluid(asked.fluid), power)[0]
    print(f"{asked.fluid}: {speed:.3f} m/s at P+ {power:.2f} W, {speed / limit:.3f} of the limit")
    print(f"{time.monotonic() - begun:.0f} s for {asked.seconds:g} s of swimming")
