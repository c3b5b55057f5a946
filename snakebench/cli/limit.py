"""`snakebench limit`: the fastest gait of a robot in a fluid at a power, solved anew."""

from __future__ import annotations  # they name what is loaded on first use

import json as json_module
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from cyclopts import Parameter

from snakebench.cli.printing import print_table, say
from snakebench.cli.simulate import RunOptions, scenario_of_options
from snakebench.cli.study import RESULTS, WHOLE, Results, Workers
from snakebench.errors import InvalidValue
from snakebench.files import check_outputs, write_file

if TYPE_CHECKING:
    from snakebench.studies.limit.settings import LimitConfig
    from snakebench.studies.protocol import Outcome

_USED = 0.98  # share of the allowed power that the fastest gait takes, if power bounds it
_SHOWN = {
    "optimal_speed": "speed of the optimum [m/s]",
    "speed": "speed of its simulation in PyBullet, along x [m/s]",
    "power": "power P of the simulation [W]",
    "positive_power": "positive power P+ of the simulation [W]",
    "multiplier": "dv/dP: gain of speed per additional watt [m/s/W]",
    "frequency": "frequency of the gait [Hz]",
    "tail_amplitude": "half peak-to-peak across the course [m]",
    "at_bound": "share of targets at their bounds [1]",
    "starts": "number of starts that led to an optimum, on all meshes",
    "agreeing": "number of starts that end within 1 % of the fastest",
    "change": "relative change of speed by the last refinement of the mesh [1]",
    "gap": "relative difference of speed between simulation and optimum, at equal power [1]",
    "residual": "violation of the optimality conditions (KKT), as IPOPT scales it",
}


def limit(
    *,
    power: Annotated[float, Parameter(help="Largest mean power [W].")],
    fluid: Annotated[str, Parameter(help="A fluid by name, or VISCOSITY,DENSITY [m²/s, kg/m³]: 1e-3,900.")] = "water",
    currency: Annotated[
        Literal["net", "positive"],
        Parameter(help="Power: net refunds braking (P), positive is what a battery pays (P+)."),
    ] = "net",
    bound: Annotated[float, Parameter(help="Bound of target angles [rad].")] = 1.0,
    joint_rate: Annotated[float | None, Parameter(help="Bound of joints' speed [rad/s]; none if omitted.")] = None,
    robot: Annotated[
        str | None, Parameter(help="Name of a robot or a robot file (.json); the paper's if omitted.")
    ] = None,
    diameter: Annotated[float | None, Parameter(help="Diameter of the links [m]; 0.10 if omitted.")] = None,
    joints: Annotated[int | None, WHOLE, Parameter(help="Number of joints; 7 if omitted.")] = None,
    json: Annotated[bool, Parameter(negative=(), help="Print one JSON object (SI units) instead of a table.")] = False,
    save: Annotated[Path | None, Parameter(help="Write the gait to this JSON file, for `simulate file`.")] = None,
    animate: Annotated[Path | None, Parameter(help="Write a page in which the gait swims to this HTML file.")] = None,
    results: Results = RESULTS,
    workers: Workers = None,
) -> None:
    """Find the fastest periodic gait at a power, by direct collocation; one to five minutes.

    The gait is open loop and made for its fluid. It is the best of several local optima, and is simulated in PyBullet.
    The exit code is 3 if there is no optimum. An interrupted search continues with the same command.

    Example: snakebench limit --fluid oil1 --power 5 --save fast.json --animate fast.html
    """
    from snakebench.collocation.front import limit_gait

    outputs = [path for path in (save, animate) if path is not None]
    check_outputs(outputs, [robot])
    body = scenario_of_options(RunOptions(fluid=fluid, robot=robot, diameter=diameter, joints=joints)).robot
    config = _config(power, fluid=fluid, currency=currency, robot=body, target=bound, joint_rate=joint_rate)
    outcome = _solved(config, results, workers)
    row = outcome.tables["limit"].iloc[0].to_dict()
    gait = limit_gait(outcome.tables["gaits"])
    shown = {name: row[name] for name in _SHOWN}
    if save:
        write_file(save, (gait.model_dump_json() + "\n").encode())
    if animate:
        from snakebench.simulation import simulate
        from snakebench.site import write_animation

        reached = f"{row['speed']:.3f} m/s at {row['power']:.2f} W"
        write_animation(simulate(*next(iter(outcome.swims.values()))), animate, f"limit in {fluid}", reached)
    if json:
        known = {name: number for name, number in shown.items() if number == number}  # no NaN
        print(json_module.dumps(dict.fromkeys(_SHOWN) | known, default=float))
        return
    print_table(shown, _SHOWN)
    say(*(f"written: {path}" for path in outputs))


def _config(power: float, **asked: Any) -> LimitConfig:
    """The settings of the study of the limit, for one point."""
    from snakebench.studies.config import study_path, study_settings
    from snakebench.studies.limit.settings import LimitConfig

    bounds = {name: asked.pop(name) for name in ("target", "joint_rate")}
    point = {"powers": [power], "anchors": [power], "shown": power, "bounds": {"asked": bounds}}
    point |= {"viscosities": 0, "policies": ""}
    chosen = {"fluids": [asked["fluid"]], "currencies": [asked["currency"]], "robot": asked["robot"]}
    config = LimitConfig(**study_settings(study_path("limit"), "full") | point | chosen)
    config.check_installed()
    return config


def _solved(config: LimitConfig, results: Path, workers: int | None) -> Outcome:
    """What the study finds; a line if there is no optimum, or power does not bound it."""
    from snakebench.execution import Evaluator, compile_engine
    from snakebench.progress import Work
    from snakebench.store import EvaluationCache
    from snakebench.studies.limit.run import run
    from snakebench.studies.running import study_plan, study_seconds
    from snakebench.workers import open_workers, usable_cores

    loads = study_plan(config)
    with (
        open_workers(usable_cores() if workers is None else workers) as crew,
        Work("limit", sum(load.times for load in loads)) as work,
        EvaluationCache(results, work.say) as cache,
    ):
        for engine in config.engines():
            compile_engine(engine, work.say)
        work.begin(**study_seconds(config, loads, crew.n_jobs), known=None)
        outcome = run(config, Evaluator(cache, crew, work))
    found, asked = outcome.tables["limit"], config.powers[0]
    if (used := float(found["optimal_power"].iloc[0])) < _USED * asked:
        raise InvalidValue(
            f"power = {asked:g} W: the fastest gait within these bounds takes {used:.3g} W: ask for less"
        )
    return outcome
