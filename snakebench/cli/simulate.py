"""`snakebench simulate`: one gait or policy swims."""

from __future__ import annotations  # they name what is loaded on first use

import sys
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any

from cyclopts import App, Parameter

import snakebench as sb  # its names load on first use
from snakebench.cli.printing import print_table, say
from snakebench.cli.study import WHOLE
from snakebench.errors import InvalidValue
from snakebench.files import check_outputs, read_object, readable_file

_SENSED = ("angle_noise", "rate_noise", "gyro_noise", "dropouts")  # perturbations of sensors
# Those of what lies between commands and joints, or joints and sensors: a log of targets and true angles has none.
_BETWEEN = (*_SENSED, "joint_offset", "delay", "jitter", "servo_strength", "dead_joint")
_Frequency = Annotated[float, Parameter(help="Frequency f [Hz].")]
_Phase = Annotated[float, Parameter(help="Phase difference of adjacent joints ψ [rad]; positive swims head first.")]

simulate_app = App(
    name="simulate",
    help="Let one gait or policy swim and print what it achieved.",
    help_epilogue="Example: snakebench simulate sea-snake --amplitude 0.9 --frequency 0.6 --phase 0.7 --fluid oil1",
)


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class RunOptions:
    """Where a gait is tried, and what is printed and written."""

    fluid: str = "water"
    """A fluid by name, `snakebench list` shows them, or by its kinematic viscosity [m²/s] and, unless interpolated
    between the known fluids, its density [kg/m³]: 1e-3,900."""
    robot: str | None = None
    "Name of a robot, `snakebench list` shows them, or a robot file (.json). The paper's if omitted."
    diameter: float | None = None
    "Diameter of the links [m]; 0.10 if omitted."
    joints: Annotated[int | None, WHOLE] = None
    "Number of joints; the paper's robot cut into as many, of the same length and mass; 7 if omitted."
    engine: str = "pybullet"
    "What integrates the motion: pybullet, the shared evaluator, or planar."
    physics_rate: Annotated[int | None, WHOLE] = None
    "Physics steps per second [Hz], a multiple of the control rate (30); 480 in pybullet and 240 in planar if omitted."
    duration: float = 30.0
    "Length of the run, from rest [s]."
    perturb: Annotated[list[str], Parameter(consume_multiple=True, negative=())] = field(default_factory=list)
    "How the robot differs from its description: delay=1 normal_drag=1.1; docs/robustness.md describes all."
    json: Annotated[bool, Parameter(negative=())] = False
    "Print one JSON object (SI units, null where undefined) instead of a table."
    save: Path | None = None
    "Write the whole trajectory to this NumPy archive (.npz)."
    log: Path | None = None
    "Write what the robot's sensors and commands would log to this CSV file, for `identify`; without noise."
    animate: Path | None = None
    "Write a page in which the robot swims to this HTML file."


@simulate_app.command(name="sinusoidal-torque")
def simulate_sinusoidal_torque(
    *,
    amplitude: Annotated[float, Parameter(help="Torque amplitude A [N m].")],
    frequency: _Frequency,
    phase: _Phase,
    options: RunOptions = RunOptions(),
) -> None:
    """A travelling wave of command torque, u_i = A sin(2πft − (i − 1)ψ).

    Example: snakebench simulate sinusoidal-torque --amplitude 3.5 --frequency 0.70 --phase 0.84 --fluid water
    """
    _simulate(sb.SinusoidalTorque(amplitude=amplitude, frequency=frequency, phase=phase), options)


@simulate_app.command(name="sea-snake")
def simulate_sea_snake(
    *,
    amplitude: Annotated[float, Parameter(help="Target angle of the last joint A [rad].")],
    frequency: _Frequency,
    phase: _Phase,
    options: RunOptions = RunOptions(),
) -> None:
    """A travelling wave of target angles that grows towards the tail, a_i = (i/N) A sin(2πft + (N − i)ψ).

    Example: snakebench simulate sea-snake --amplitude 0.9 --frequency 0.6 --phase 0.7 --fluid oil1 --animate swim.html
    """
    _simulate(sb.SeaSnake(amplitude=amplitude, frequency=frequency, phase=phase), options)


@simulate_app.command(name="file")
def simulate_file(gait: Path, /, *, options: RunOptions = RunOptions()) -> None:
    """Any gait, read from a JSON file such as {"kind": "fourier", "frequency": 0.8, "cosine": […], "sine": […]}.

    Example: snakebench simulate file gait.json --fluid oil2

    Parameters
    ----------
    gait
        JSON object with the gait's `kind` (`snakebench list` shows them) and its fields.
    """
    from snakebench.controllers import gait_of

    _simulate(gait_of(read_object(gait, "gait", "a kind and its fields")), options, [gait])


@simulate_app.command(name="policy")
def simulate_policy(*, path: Path, preference: float | None = None, options: RunOptions = RunOptions()) -> None:
    """A trained policy in closed loop, at its own control rate, usually 30 Hz.

    Example: snakebench simulate policy --path results/learned_front/policies/student-10.safetensors --preference 0.1

    Parameters
    ----------
    path
        The policy's file, as a study leaves it.
    preference
        Price of power [1/W] of a preference-conditioned policy: a higher price gives a slower gait that needs less
        power; the lowest of its range if omitted.
    """
    policy = sb.Policy.load(readable_file(path))
    _simulate(policy if preference is None else policy.at(preference), options, [path])


def _simulate(controller: sb.Gait | sb.Policy, options: RunOptions, inputs: Sequence[Path] = ()) -> None:
    """Let a controller swim, print its evaluation, and write what the options ask for; `inputs` stay untouched."""
    from snakebench.execution import compile_engine
    from snakebench.simulation import check_scenario

    scenario = scenario_of_options(options, controller.card.control_rate if isinstance(controller, sb.Policy) else None)
    rate, perturbations = scenario.control_rate, _perturbations(options.perturb)
    _check_perturbations(perturbations, controller, scenario, logged=options.log is not None)
    swimmer, scenario = sb.perturbed(controller, scenario, perturbations)
    outputs = [path for path in (options.save, options.log, options.animate) if path is not None]
    check_outputs(outputs, [*inputs, options.robot])
    check_scenario(scenario, swimmer.drives)
    compile_engine(scenario.engine, lambda text: print(text, file=sys.stderr))
    trajectory = sb.simulate(swimmer, scenario)
    evaluation = sb.measure(trajectory, rate)
    if options.save:
        trajectory.save(options.save)
    if options.log:
        from snakebench.identification.log import write_log

        write_log(options.log, trajectory)
    if options.animate:
        from snakebench.site import write_animation

        write_animation(trajectory, options.animate, *_page_head(controller, options, evaluation))
    if options.json:
        print(evaluation.model_dump_json())
        return
    print_table(evaluation.model_dump(), _descriptions(evaluation))
    for name, error in evaluation.uncertain.items():
        say(f"uncertain: {name} may be wrong by {_percent(error)}: a higher --physics-rate makes it more exact")
    say(*(f"written: {path}" for path in outputs))


def _perturbations(words: Sequence[str]) -> sb.Perturbations:
    """Perturbations written as NAME=VALUE."""
    from snakebench.perturbation import known_perturbation

    values: dict[str, Any] = {}
    for word in words:
        name, _, value = word.partition("=")
        whole = name == "seed" or known_perturbation(name) == "dead_joint"
        if name in values:
            raise InvalidValue(f"--perturb {word}: {name} is given twice")
        try:
            values[name] = int(value) if whole else float(value)
        except ValueError:
            example = "dead_joint=4, a whole number" if whole else "delay=1"
            raise InvalidValue(f"--perturb {word}: NAME=VALUE is needed, such as {example}") from None
    if values.keys() == {"seed"}:
        raise InvalidValue("--perturb seed: it has no effect here: name what is random as well")
    return sb.Perturbations(**values)


def _check_perturbations(
    perturbations: sb.Perturbations, controller: sb.Gait | sb.Policy, scenario: sb.Scenario, logged: bool
) -> None:
    """Make sure that each has an effect, and that a log tells of all."""
    for name, value in perturbations.active.items():
        alone = sb.Perturbations(**{name: value})
        unused = name == "joint_offset" and controller.drives == "torque"
        if unused or sb.perturbed(controller, scenario, alone) == (controller, scenario):
            why = ": a gait does without sensors" if name in _SENSED else ""
            raise InvalidValue(f"--perturb {name}: it has no effect here{why}")
        if logged and name in _BETWEEN:
            raise InvalidValue(f"--log: a log does not show {name}: leave out --log or {name}")


def scenario_of_options(options: RunOptions, control_rate: int | None = None) -> sb.Scenario:
    """The scenario that options describe, with another control rate than usual if given; errors as of its parts."""
    from snakebench.scenario import scenario_of

    shape = {"joints": options.joints, "diameter": options.diameter}
    given: dict[str, Any] = {name: value for name, value in shape.items() if value is not None}
    if options.robot is not None and given:
        raise InvalidValue("--robot excludes --joints and --diameter: name a robot or describe one")
    robot = sb.Robot.with_joints(**{"joints": 7} | given) if options.robot is None else options.robot
    settings = {"engine": options.engine, "physics_rate": options.physics_rate, "duration": options.duration}
    return scenario_of(options.fluid, None, robot=robot, control_rate=control_rate, **settings)


def _descriptions(evaluation: sb.Evaluation) -> dict[str, str | None]:
    """What each number is, by the name that it is shown under."""
    own = {field.alias or name: field.description for name, field in type(evaluation).model_fields.items()}
    for name, error in (("speed", evaluation.speed_error), ("power", evaluation.power_error)):
        if error is not None:
            own[name] = f"{own[name]}, within {_percent(error)}"
    return own | {name: (metric.__doc__ or "").partition("\n")[0] for name, metric in sb.METRICS.items()}


def _percent(share: float) -> str:
    return f"{100 * share:.2g} %" if share < 0.995 else f"{100 * share:.0f} %"


def _page_head(controller: sb.Gait | sb.Policy, options: RunOptions, evaluation: sb.Evaluation) -> tuple[str, str]:
    fluid = options.fluid
    if isinstance(controller, sb.Policy):
        kind, fields = "policy", controller.card.origin
    else:
        kind, fields = controller.kind, controller.model_dump(exclude={"kind"})
    where = fluid if fluid in sb.FLUIDS else f"ν = {sb.named_fluid(fluid).kinematic_viscosity:g} m²/s"
    settings = [
        f"{name} {value if isinstance(value, str) else format(value, 'g')}"
        for name, value in fields.items()
        if isinstance(value, str | int | float)
    ]
    settings += [word.replace("=", " ") for word in options.perturb]
    swam = evaluation.status == "ok"
    reached = f"{evaluation.speed:.3f} m/s at {evaluation.power:.2f} W" if swam else evaluation.status
    return f"{kind} in {where}", f"{', '.join(settings)}: {reached}"
