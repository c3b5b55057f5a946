"""The commands: parse, call one function, print where the result is."""

from pathlib import Path
from typing import Annotated, Any

from cyclopts import App, CycloptsError, Parameter

import snakebench as sb  # its names load on first use
from snakebench.cli.identify import identify
from snakebench.cli.limit import limit
from snakebench.cli.play import play
from snakebench.cli.printing import cell, print_rows, say
from snakebench.cli.score import leaderboard, score
from snakebench.cli.simulate import simulate_app
from snakebench.cli.study import (
    LEADERBOARD,
    REPORTS,
    RESULTS,
    WHOLE,
    Leaderboard,
    Reports,
    Results,
    pareto,
    reproduce,
    run_study,
    write_pages,
)
from snakebench.errors import InvalidValue
from snakebench.files import check_outputs, readable_file, writable_directory

app = App(
    name="snakebench",
    help="Benchmark of swimming snake robots: fixed gaits against adaptive policies in unknown fluids.",
    help_epilogue="""Examples:

    snakebench run-study quickstart
    snakebench pareto --fluids water oil1 oil2
    snakebench simulate sea-snake --amplitude 0.9 --frequency 0.6 --phase 0.7 --fluid oil1
    snakebench score gait.json --quick
    snakebench limit --fluid oil1 --power 5
    snakebench identify swim-1.csv swim-2.csv --save my-robot.json
    snakebench play
    snakebench reproduce --profile quick
    snakebench list""",
    help_format="markdown",
    version=sb.__version__,
    version_flags=["--version"],
    suppress_keyboard_interrupt=False,
)
app.command(simulate_app)
app.command(run_study)
app.command(pareto)
app.command(reproduce)
app.command(score)
app.command(leaderboard)
app.command(limit)
app.command(identify)
app.command(play)


@app.command
def bench(
    *,
    threads: Annotated[
        int | None, WHOLE, Parameter(help="Most threads for a batch of robots; all cores if omitted.")
    ] = None,
    results: Results = RESULTS,
    reports: Reports = REPORTS,
) -> None:
    """Measure this machine: the speed of each engine, side by side, and its error at that speed; about two minutes.

    The table is kept in `bench/` of the results.

    Example: snakebench bench --threads 2
    """
    from snakebench.bench import run_bench
    from snakebench.engines.planar import MOST_THREADS
    from snakebench.report.bench import bench_table
    from snakebench.site import write_report
    from snakebench.workers import usable_cores

    writable_directory(reports)
    directory = run_bench(results, min(usable_cores(), MOST_THREADS) if threads is None else threads)
    print_rows(*bench_table(directory))
    say(f"results: {directory}", f"report:  {write_report(directory, reports)}")


@app.command
def export(
    policy: Annotated[Path, Parameter(help="The policy's file, as a study leaves it.")],
    model: Annotated[Path, Parameter(help="The file to write: NAME.onnx or NAME.h.")],
    /,
    *,
    preference: Annotated[float | None, Parameter(help="Fix the price of power [1/W]; an input if omitted.")] = None,
) -> None:
    """Write a trained policy for a robot's computer: one control step as an ONNX model, or as a C header.

    The memory is an explicit input and output. The file describes all inputs and outputs; see docs/deploy.md.

    Example: snakebench export results/teacher_student/policies/student-10.safetensors student.onnx
    """
    from snakebench.deployment import export_policy

    check_outputs([model], inputs=[policy])
    export_policy(sb.Policy.load(readable_file(policy)), model, preference)
    say(f"written: {model}")


@app.command
def report(
    *,
    results: Results = RESULTS,
    reports: Annotated[Reports, Parameter(name=["--out", "--reports"])] = REPORTS,
    leaderboard: Leaderboard = LEADERBOARD,
) -> None:
    """Write the report again from stored results: an index page and one page per study; nothing is simulated.

    The index names what is missing, with the command that makes it. If a leaderboard lies next to the results, its page
    is written as well.

    Example: snakebench report --results results --out reports
    """
    from snakebench.scoring.leaderboard import entries_in

    if not results.is_dir():
        raise InvalidValue(f"{results} holds no results: run a study first, such as snakebench run-study quickstart")
    if leaderboard != LEADERBOARD:
        entries_in(leaderboard)  # refused if it is none
    say(f"index:  {write_pages(results, reports, leaderboard)}")


@app.command(name="list")
def list_names() -> None:
    """List the studies, fluids, gaits, robots, samplers, metrics and engines there are; a plus marks those of plug-ins.

    Example: snakebench list
    """
    from snakebench.engines import PHYSICS_RATES
    from snakebench.registry import load_plugins
    from snakebench.studies.config import LIBRARY, study_names, study_profiles

    load_plugins()  # one that cannot be loaded is refused before anything is printed
    print("studies")
    for name in study_names():
        print(f"  {cell(name):20} profiles: {cell(', '.join(study_profiles(LIBRARY / f'{name}.toml')))}")
    registries: dict[str, Any] = {"fluids": sb.FLUIDS, "gaits": sb.GAITS, "robots": sb.ROBOTS, "samplers": sb.SAMPLERS}
    for what, registry in (registries | {"metrics of plug-ins": sb.METRICS}).items():
        print(what)
        for name, thing in registry.items():
            print(f"{' ' if name in registry.own else '+'} {cell(name):20} {cell(_description(thing))}".rstrip())
        if not registry:
            print("  none")
    print("engines")
    for name, rate in PHYSICS_RATES.items():
        print(f"  {name:20} {rate} Hz by default")


def _description(thing: object) -> str:
    """What a fluid or robot is in numbers; of all else, the first line of its docstring."""
    if isinstance(thing, sb.Fluid):
        return f"viscosity {thing.kinematic_viscosity:.3g} m²/s, density {thing.density:g} kg/m³"
    if isinstance(thing, sb.Robot):
        return f"{thing.n_joints} joints, {thing.link_lengths.sum():.3g} m, {thing.total_mass:.3g} kg"
    return (thing.__doc__ or "").strip().partition("\n")[0]


def run(words: list[str]) -> None:
    """Run the command of a command line; an InvalidValue if it is refused."""
    try:
        app(words, exit_on_error=False, print_error=False, result_action="return_value")
    except CycloptsError as error:
        raise InvalidValue(str(error)) from None
