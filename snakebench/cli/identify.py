"""`snakebench identify`: the parameters of a real robot, from logs of its swims."""

from __future__ import annotations  # they name what is loaded on first use

import json as json_module
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from cyclopts import Parameter

from snakebench.cli.printing import print_rows, say
from snakebench.cli.simulate import RunOptions, scenario_of_options
from snakebench.cli.study import WHOLE
from snakebench.errors import InvalidValue
from snakebench.files import check_outputs, write_file

if TYPE_CHECKING:
    from snakebench.identification.fit import Identified

Fitted = Literal[
    "diameter",
    "joint_stiffness",
    "joint_damping",
    "proportional_gain",
    "derivative_gain",
    "pressure_drag",
    "viscous_drag",
    "normal_drag",
    "head_drag",
    "tail_drag",
]
_UNITS = {
    "diameter": "m",
    "joint_stiffness": "N m/rad",
    "joint_damping": "N m s/rad",
    "proportional_gain": "N m/rad",
    "derivative_gain": "N m s/rad",
    "angle": "rad",
    "gyro": "rad/s",
    "position": "m",
}


def identify(
    logs: Annotated[list[Path], Parameter(help="Logs of swims, CSV files.")],
    /,
    *,
    fit: Annotated[
        list[Fitted], Parameter(consume_multiple=True, negative=(), help="What is fitted; the rest is as assumed.")
    ] = ["diameter", "joint_stiffness", "joint_damping"],  # noqa: B006
    fluid: Annotated[str, Parameter(help="A fluid by name, or VISCOSITY,DENSITY [m²/s, kg/m³]: 1e-3,900.")] = "water",
    robot: Annotated[str | None, Parameter(help="The robot assumed: a name or a robot file; else the paper's.")] = None,
    diameter: Annotated[float | None, Parameter(help="Diameter assumed [m]; 0.10 if omitted.")] = None,
    joints: Annotated[int | None, WHOLE, Parameter(help="Number of joints; 7 if omitted.")] = None,
    hold: Annotated[
        bool, Parameter(negative=(), help="Commands are held from row to row, as by a digital controller.")
    ] = False,
    json: Annotated[bool, Parameter(negative=(), help="Print one JSON object (SI units) instead of a table.")] = False,
    save: Annotated[Path | None, Parameter(help="Write the robot to this JSON file, for --robot.")] = None,
) -> None:
    """Fit a robot to logs of its swims by least squares, with 95 % intervals; seconds to minutes.

    Columns of a log: time [s], angle_1 … [rad], gyro_1 [rad/s] (of link 1, the head; gyro_3 of link 3), target_1 …
    [rad] or torque_1 … [N m], and if tracked, head_x and head_y or center_x and center_y [m].

    Example: snakebench identify swim-1.csv swim-2.csv --fluid water --save my-robot.json
    """
    from snakebench.execution import compile_engine
    from snakebench.identification.fit import identify as identified
    from snakebench.identification.log import read_log

    if save is not None:
        if save.suffix != ".json":
            raise InvalidValue(f"--save {save}: a name that ends with .json is needed, by which --robot knows a file")
        check_outputs([save], [*logs, robot])
    scenario = scenario_of_options(RunOptions(fluid=fluid, robot=robot, diameter=diameter, joints=joints))
    swims = [read_log(path) for path in logs]
    compile_engine("planar", lambda text: print(text, file=sys.stderr))
    found = identified(swims, scenario.fluid, scenario.robot, fit, hold)
    if save is not None:
        write_file(save, found.robot.model_dump_json(indent=2) + "\n")
    if json:
        parameters = {p.name: {"value": p.value, "low": p.low, "high": p.high} for p in found.parameters}
        content = {"parameters": parameters, "perturbations": found.drag.active, "noise": found.noise}
        print(json_module.dumps(content | {"remarks": found.remarks}))
        return
    _print(found)
    if save is not None:
        say(f"written: {save}")


def _print(found: Identified) -> None:
    """The parameters with their intervals, the noise of the sensors, and what casts doubt on them."""
    rows = [
        [p.name, *(f"{number:.5g}" for number in (p.assumed, p.value, p.low, p.high)), _UNITS.get(p.name, "1")]
        for p in found.parameters
    ]
    noise = [[f"noise of {kind}", "", f"{value:.3g}", "", "", _UNITS[kind]] for kind, value in found.noise.items()]
    print_rows(["", "assumed", "fitted", "95 % from", "to", "unit"], rows + noise)
    say(*(f"note: {remark}" for remark in found.remarks))
    if drag := found.drag.active:
        factors = " ".join(f"{name}={value:.5g}" for name, value in drag.items())
        say(f"note: a robot file has no factors of the drag: add --perturb {factors}, or sb.Perturbations in Python")
