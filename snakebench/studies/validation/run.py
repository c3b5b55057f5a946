"""Validation study: errors of the engines against the limit of small steps, their cost, and energy balance (ours)."""

from collections.abc import Iterator, Mapping, Sequence
from itertools import product

import numpy as np
import pandas as pd

from snakebench.bench import swimming_cost
from snakebench.controllers import Gait, HeldTargets
from snakebench.engines import EngineName, check_resolved, load_engine
from snakebench.errors import InvalidValue
from snakebench.execution import Case, Evaluator
from snakebench.scenario import Scenario
from snakebench.simulation import check_scenario, simulate
from snakebench.studies.protocol import Load, Outcome, Row, Swim, loads_of, numerics, swim_rows
from snakebench.studies.validation.settings import ValidationConfig
from snakebench.trajectory import Trajectory
from snakebench.value import FloatArray

_CONTROL_RATE = 30  # of the adversaries [Hz]
_ADVERSARIES = 0  # seed of those that are random


def plan(config: ValidationConfig) -> list[Load]:
    """What the study evaluates; every gait must fit the robot, and have two PyBullet rates to extrapolate from."""
    for name, gait in config.gaits.items():
        try:
            stable = _stable_rates(config, gait, config.rates, config.reference_rate)
            for _, rate in stable:
                check_resolved(gait, config.robot.n_joints, rate)
            gait.commands(np.zeros(1), config.robot.n_joints)
            if [engine for engine, _ in stable].count("pybullet") < 2:
                needed = load_engine("pybullet").stable_rate(config.robot, gait.drives)
                rates = f"rates.pybullet = {list(config.rates.get('pybullet', ()))}"
                raise InvalidValue(f"{rates}: two of at least {needed:.0f} Hz are needed to extrapolate")
        except InvalidValue as error:
            raise InvalidValue(f"gait {name}: {error}") from None
        for scenario in _order_scenarios(config, gait):
            check_scenario(scenario, gait.drives)
    return loads_of(case for _, case in (*_runs(config), *_attacks(config), *_attacks(config)))


def run(config: ValidationConfig, evaluate: Evaluator) -> Outcome:
    """Simulate every gait in every fluid, engine and rate, and every adversary; time each engine."""
    attacks = list(_attacks(config))
    end_x, end_y = np.transpose(evaluate.measured(_end, [(case, ()) for _, case in attacks]))
    tables = {
        "runs": pd.DataFrame(swim_rows(evaluate, _runs(config))),
        "order": pd.DataFrame(_order(config)),
        "adversaries": pd.DataFrame(swim_rows(evaluate, attacks)).assign(end_x=end_x, end_y=end_y),
        "costs": pd.DataFrame(_costs(config)),
    }
    return Outcome(tables)


def _stable_rates(
    config: ValidationConfig, gait: Gait, rates: Mapping[EngineName, Sequence[int]], reference: int
) -> list[tuple[str, int]]:
    """Those of the engines' rates at which they are stable for a gait, and the planar reference."""
    needed = {engine: load_engine(engine).stable_rate(config.robot, gait.drives) for engine in rates}
    stable = [(engine, rate) for engine in rates for rate in rates[engine] if rate >= needed[engine]]
    return list(dict.fromkeys([*stable, ("planar", reference)]))


def _runs(config: ValidationConfig) -> Iterator[Swim]:
    for (name, gait), fluid in product(config.gaits.items(), config.fluids):
        for engine, rate in _stable_rates(config, gait, config.rates, config.reference_rate):
            scenario = _scenario(config, fluid, engine, rate, config.duration)
            yield {"gait": name, "drives": gait.drives, "fluid": fluid} | numerics(scenario), Case(gait, scenario)


def _attacks(config: ValidationConfig) -> Iterator[Swim]:
    n_steps = round(config.adversary_duration * _CONTROL_RATE)
    for kind, fluid in product(config.adversaries, config.fluids):
        targets = _adversary(kind, n_steps, config.robot.n_joints)
        gait = HeldTargets(rate=_CONTROL_RATE, targets=tuple(map(tuple, targets.tolist())))
        for engine, rates in config.adversary_rates.items():
            for rate in rates:
                scenario = _scenario(config, fluid, engine, rate, config.adversary_duration)
                yield {"adversary": kind, "fluid": fluid} | numerics(scenario), Case(gait, scenario)


def _scenario(config: ValidationConfig, fluid: str, engine: str, rate: int, duration: float) -> Scenario:
    return Scenario(
        fluid=fluid, robot=config.robot, engine=engine, physics_rate=rate, control_rate=_CONTROL_RATE, duration=duration
    )


def _end(swim: Trajectory, _: Scenario) -> list[float]:
    """Where the centre of mass is at the end of a run [m], for `Evaluator.measured`."""
    return swim.center[-1].tolist()


def _adversary(kind: str, n_steps: int, n_joints: int) -> FloatArray:
    """Target angles [rad], shape (n_steps, n_joints)."""
    random = np.random.default_rng(_ADVERSARIES)
    if kind == "random":
        return random.uniform(-1, 1, (n_steps, n_joints))
    if kind == "bang-bang":
        return random.choice([-1.0, 1.0], (n_steps, n_joints))
    return np.where(np.add.outer(np.arange(n_steps), np.arange(n_joints)) % 2, 1.0, -1.0)


def _order(config: ValidationConfig) -> Iterator[Row]:
    for name, gait in config.gaits.items():
        *scenarios, reference = _order_scenarios(config, gait)
        limit = simulate(gait, reference).joint_angle[-1]
        for scenario in scenarios:
            error = np.abs(simulate(gait, scenario).joint_angle[-1] - limit).max()
            yield {"gait": name, "drives": gait.drives, **numerics(scenario), "error": error}


def _order_scenarios(config: ValidationConfig, gait: Gait) -> list[Scenario]:
    """Where the order for a gait is observed, in the first fluid; the reference last."""
    rates = _stable_rates(config, gait, config.order_rates, config.order_reference_rate)
    return [_scenario(config, config.fluids[0], engine, rate, config.order_duration) for engine, rate in rates]


def _costs(config: ValidationConfig) -> Iterator[Row]:
    first = {gait.drives: gait for gait in reversed(config.gaits.values())}
    for drives, gait in first.items():
        for engine, rate in _stable_rates(config, gait, config.rates, config.reference_rate):
            seconds = swimming_cost(engine, gait, rate, config.robot)
            yield {"engine": engine, "drives": drives, "physics_rate": rate, "seconds_per_second": seconds}
