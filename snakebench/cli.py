"""The command line: parse, call one function, print where the result is."""

from __future__ import annotations

import os
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import App, CycloptsError, Parameter

from snakebench.errors import InvalidValue, SnakebenchError

if TYPE_CHECKING:
    from snakebench.controllers import Gait
    from snakebench.evaluation import Evaluation

app = App(
    name="snakebench",
    help="Benchmark of swimming snake robots: fixed gaits against adaptive policies in unknown fluids.",
    help_epilogue="""Examples:

    snakebench run-study quickstart

    snakebench run-study validation --profile quick

    snakebench simulate sea-snake --amplitude 0.9 --frequency 0.6 --phase 0.7 --fluid oil1

    snakebench list""",
    help_format="markdown",
    version_flags=["--version"],
    suppress_keyboard_interrupt=False,
)
simulate_app = App(
    name="simulate",
    help="Let one gait swim and print what it achieved.",
    help_epilogue="Example: snakebench simulate sea-snake --amplitude 0.9 --frequency 0.6 --phase 0.7 --fluid oil1",
)
app.command(simulate_app)


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class RunOptions:
    """Where a gait is tried and what is kept of it."""

    fluid: str | None = None
    "Name of a fluid; `snakebench list` shows them. Water if neither this nor --viscosity is given."
    viscosity: float | None = None
    "Kinematic viscosity [m²/s], in place of a named fluid."
    density: float | None = None
    "Density [kg/m³] to go with --viscosity; interpolated between the known fluids if omitted."
    diameter: float = 0.10
    "Diameter of the links [m]."
    joints: int = 7
    "Number of joints; the robot's length and mass stay the same."
    engine: str = "pybullet"
    "What integrates the motion: pybullet, the shared evaluator, or planar."
    physics_rate: int | None = None
    "Physics steps per second [Hz], a multiple of 30; 480 in pybullet and 240 in planar if omitted."
    duration: float = 30.0
    "Length of the run, from rest [s]."
    json: Annotated[bool, Parameter(negative=())] = False
    "Print one JSON object (SI units, null where undefined) instead of a table."
    save: Path | None = None
    "Write the whole trajectory to this NumPy archive (.npz)."
    animate: Path | None = None
    "Write a page in which the robot swims to this HTML file."


@simulate_app.command(name="sinusoidal-torque")
def simulate_sinusoidal_torque(
    *, amplitude: float, frequency: float, phase: float, options: RunOptions = RunOptions()
) -> None:
    """A travelling wave of command torque, u_i = A sin(2πft − (i − 1)ψ).

    Example: snakebench simulate sinusoidal-torque --amplitude 3.5 --frequency 0.70 --phase 0.84 --fluid water

    Parameters
    ----------
    amplitude
        Torque amplitude A [N m].
    frequency
        Frequency f [Hz].
    phase
        Phase difference between adjacent joints ψ [rad]; positive swims head first.
    """
    from snakebench.controllers import SinusoidalTorque

    _simulate(SinusoidalTorque(amplitude=amplitude, frequency=frequency, phase=phase), options)


@simulate_app.command(name="sea-snake")
def simulate_sea_snake(*, amplitude: float, frequency: float, phase: float, options: RunOptions = RunOptions()) -> None:
    """A travelling wave of target angles that grows towards the tail, a_i = (i/N) A sin(2πft + (N − i)ψ).

    Example: snakebench simulate sea-snake --amplitude 0.9 --frequency 0.6 --phase 0.7 --fluid oil1 --animate swim.html

    Parameters
    ----------
    amplitude
        Target angle of the last joint A [rad].
    frequency
        Frequency f [Hz].
    phase
        Phase difference between adjacent joints ψ [rad]; positive swims head first.
    """
    from snakebench.controllers import SeaSnake

    _simulate(SeaSnake(amplitude=amplitude, frequency=frequency, phase=phase), options)


@simulate_app.command(name="file")
def simulate_file(gait: Path, /, *, options: RunOptions = RunOptions()) -> None:
    """Any gait, read from a JSON file such as {"kind": "fourier", "frequency": 0.8, "cosine": […], "sine": […]}.

    Example: snakebench simulate file gait.json --fluid oil2

    Parameters
    ----------
    gait
        JSON object with the gait's `kind` (`snakebench list` shows them) and its fields.
    """
    _simulate(_gait_in(gait), options)


@app.command
def run_study(
    study: str,
    /,
    *,
    profile: str | None = None,
    seeds: Annotated[list[int] | None, Parameter(consume_multiple=True, negative=())] = None,
    engine: str | None = None,
    workers: int | None = None,
    results: Path = Path("results"),
    reports: Path = Path("reports"),
) -> None:
    """Run a study to its report; interrupted, the same command continues it.

    Example: snakebench run-study sea_snake --profile quick --seeds 0 1 2 --workers 2

    Parameters
    ----------
    study
        Name of a study (`snakebench list` shows them) or path of a TOML file.
    profile
        Which budget of the study: smoke takes seconds, quick minutes, full is the published one.
    seeds
        Seeds of the searches, instead of the study's own.
    engine
        What integrates the motion, instead of the study's own engine; at that engine's own physics rate.
    workers
        Worker processes; all cores if omitted. They change the time, never the result.
    results
        Directory of result tables and of the evaluation cache.
    reports
        Directory of generated pages.
    """
    from snakebench import studies
    from snakebench.execution import usable_cores
    from snakebench.files import writable_directory
    from snakebench.studies.config import study_path, study_settings

    settings = study_settings(study_path(study), profile, seeds=seeds, engine=engine)
    config = studies.study_config(settings)
    writable_directory(reports)
    directory = studies.run_study(config, results, usable_cores() if workers is None else workers)
    from snakebench.reporting.page import write_report

    page = write_report(directory, reports)
    print(f"results: {directory}\nreport:  {page}")


@app.command
def bench(
    *,
    threads: int | None = None,
    results: Path = Path("results"),
    reports: Path = Path("reports"),
) -> None:
    """Measure this machine: the speed of each engine, side by side, and its error at that speed; about two minutes.

    Example: snakebench bench --threads 2

    Parameters
    ----------
    threads
        Most threads for a batch of robots; all cores if omitted.
    results
        Directory for the table, in `bench/`; validation pages show the last one.
    reports
        Directory of generated pages.
    """
    from snakebench.bench import run_bench
    from snakebench.execution import usable_cores
    from snakebench.files import writable_directory

    writable_directory(reports)
    directory = run_bench(results, usable_cores() if threads is None else threads)
    from snakebench.reporting.page import write_report
    from snakebench.reporting.validation import bench_table
    from snakebench.store import read_manifest, read_table

    table = bench_table(read_table(directory / "bench.csv"))
    _print_rows(table.head, table.rows)
    print(f"{table.caption}\nresults: {directory}\nreport:  {write_report(directory, reports)}")
    for path in sorted(results.glob("*/manifest.json")):
        if read_manifest(path.parent)["config"]["method"] == "validation":
            print(f"report:  {write_report(path.parent, reports)}")


@app.command
def report(*, results: Path = Path("results"), reports: Path = Path("reports")) -> None:
    """Write the pages of all studies again, from their stored results; nothing is simulated.

    Example: snakebench report --results results --reports reports

    Parameters
    ----------
    results
        Directory of result tables.
    reports
        Directory of generated pages.
    """
    from snakebench.reporting.page import write_report

    directories = sorted(path.parent for path in results.glob("*/manifest.json"))
    if not directories:
        raise InvalidValue(f"{results} holds no results: run a study first, such as snakebench run-study quickstart")
    for directory in directories:
        print(f"report: {write_report(directory, reports)}")


@app.command(name="list")
def list_names() -> None:
    """List the studies, fluids, gaits and engines there are.

    Example: snakebench list
    """
    from snakebench.controllers import GAITS
    from snakebench.engines import PHYSICS_RATES
    from snakebench.fluid import fluid_names, named_fluid
    from snakebench.studies.config import LIBRARY, study_names, study_profiles

    print("studies")
    for name in study_names():
        print(f"  {name:20} profiles: {', '.join(study_profiles(LIBRARY / f'{name}.toml'))}")
    print("fluids")
    for name in fluid_names():
        fluid = named_fluid(name)
        print(f"  {name:20} viscosity {fluid.kinematic_viscosity:.3g} m²/s, density {fluid.density:g} kg/m³")
    print("gaits")
    for kind, gait in GAITS.items():
        print(f"  {kind:20} {str(gait.__doc__).splitlines()[0]}")
    print("engines")
    for name, rate in PHYSICS_RATES.items():
        print(f"  {name:20} {rate} Hz unless told otherwise")


def main() -> None:
    """Entry point: runs the command and ends with its exit code; 2 for anything refused, 130 when interrupted."""
    try:
        app(sys.argv[1:], exit_on_error=False, print_error=False)
        sys.stdout.flush()
    except (SnakebenchError, CycloptsError) as error:
        message = " ".join(line.strip() for line in str(error).splitlines() if line.strip())
        print(f"snakebench: {message}", file=sys.stderr)
        sys.exit(2)
    except KeyboardInterrupt:
        kept = "; what was evaluated is kept, the same command continues" if "run-study" in sys.argv else ""
        print(f"snakebench: interrupted{kept}", file=sys.stderr)
        sys.exit(130)
    except BrokenPipeError:  # the reader, such as head, has seen enough
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def _gait_in(path: Path) -> Gait:
    import json

    from snakebench.controllers import gait_class

    try:
        content = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise InvalidValue(f"cannot read the gait {path}: {error}") from None
    if not isinstance(content, dict) or "kind" not in content:
        raise InvalidValue(f"{path} is no gait: a JSON object with a kind and its fields is needed")
    return gait_class(str(content["kind"]))(**content)


def _simulate(gait: Gait, options: RunOptions) -> None:
    from snakebench.evaluation import Scenario, check_rate, measure, simulate
    from snakebench.execution import compile_engine
    from snakebench.files import writable_file
    from snakebench.fluid import Fluid, named_fluid
    from snakebench.robot import Robot

    if options.fluid is not None and options.viscosity is not None:
        raise InvalidValue("--fluid and --viscosity exclude each other: name a fluid or describe one")
    if options.density is not None and options.viscosity is None:
        raise InvalidValue("--density describes a fluid only together with --viscosity")
    described = {"kinematic_viscosity": options.viscosity, "density": options.density}
    scenario = Scenario(
        fluid=named_fluid("water" if options.fluid is None else options.fluid)
        if options.viscosity is None
        else Fluid(**{name: value for name, value in described.items() if value is not None}),
        robot=Robot.with_joints(options.joints, options.diameter),
        engine=options.engine,
        duration=options.duration,
        **({} if options.physics_rate is None else {"physics_rate": options.physics_rate}),
    )
    outputs = [path for path in (options.save, options.animate) if path is not None]
    if len({writable_file(path) for path in outputs}) < len(outputs):
        raise InvalidValue(f"--save and --animate name the same file: {options.save}")
    check_rate(scenario, gait.drives)
    compile_engine(scenario.engine, lambda text: print(text, file=sys.stderr))
    trajectory = simulate(gait, scenario)
    evaluation = measure(trajectory, scenario.control_rate)
    if options.save:
        trajectory.save(options.save)
    if options.animate:
        from snakebench.reporting.page import write_animation

        write_animation(trajectory, options.animate, *_described(gait, options, evaluation))
    if options.json:
        print(evaluation.model_dump_json())
        return
    _print_table(evaluation.model_dump(), type(evaluation).model_fields)
    for path in outputs:
        print(f"written: {path}")


def _described(gait: Gait, options: RunOptions, evaluation: Evaluation) -> tuple[str, str]:
    """A title and a line of facts for the page of a run."""
    where = options.fluid or (f"ν = {options.viscosity:g} m²/s" if options.viscosity else "water")
    numbers = {name: value for name, value in gait.model_dump().items() if isinstance(value, float)}
    settings = ", ".join(f"{name} {value:g}" for name, value in numbers.items())
    if evaluation.status != "ok":
        return f"{gait.kind} in {where}", f"{settings}: {evaluation.status}"
    return f"{gait.kind} in {where}", f"{settings}: {evaluation.speed:.3f} m/s at {evaluation.power:.2f} W"


def _print_table(numbers: dict[str, Any], about: dict[str, Any]) -> None:
    by_alias = {field.alias or name: field.description for name, field in about.items()}
    for name, value in numbers.items():
        shown = f"{value:.5g}" if isinstance(value, float) else "undefined" if value is None else str(value)
        print(f"{name:20} {shown:>12}  {by_alias[name]}")


def _print_rows(head: list[str], rows: list[list[str]]) -> None:
    widths = [max(map(len, column)) for column in zip(head, *rows, strict=True)]
    for row in (head, *rows):
        first, *others = (cell.rjust(width) for cell, width in zip(row, widths, strict=True))
        print("  ".join([first.strip().ljust(widths[0]), *others]))


if __name__ == "__main__":
    main()
