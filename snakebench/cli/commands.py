"""The commands: parse, call one function, print where the result is."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import App, CycloptsError, Parameter

from snakebench.cli.listing import list_names
from snakebench.cli.printing import print_rows, say
from snakebench.cli.reproduce import reproduce
from snakebench.cli.simulate import simulate_app
from snakebench.cli.study import pareto, run_study
from snakebench.errors import InvalidValue
from snakebench.version import __version__

app = App(
    name="snakebench",
    help="Benchmark of swimming snake robots: fixed gaits against adaptive policies in unknown fluids.",
    help_epilogue="""Examples:

    snakebench run-study quickstart

    snakebench pareto --fluids water oil1 oil2

    snakebench simulate sea-snake --amplitude 0.9 --frequency 0.6 --phase 0.7 --fluid oil1

    snakebench reproduce --profile quick

    snakebench list""",
    help_format="markdown",
    version=__version__,
    version_flags=["--version"],
    suppress_keyboard_interrupt=False,
)
app.command(simulate_app)
app.command(run_study)
app.command(pareto)
app.command(reproduce)
app.command(list_names, name="list")


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
    from snakebench.files import writable_directory
    from snakebench.workers import usable_cores

    writable_directory(reports)
    directory = run_bench(results, usable_cores() if threads is None else threads)
    from snakebench.report.bench import bench_table
    from snakebench.site import write_report
    from snakebench.store import read_manifest
    from snakebench.tables import read_table

    table = bench_table(read_table(directory / "bench.csv"))
    print_rows(table.head, table.rows)
    say(f"results: {directory}", f"report:  {write_report(directory, reports)}")
    for path in sorted(results.glob("*/manifest.json")):
        if read_manifest(path.parent)["config"]["method"] == "validation":
            say(f"report:  {write_report(path.parent, reports)}")


@app.command
def export(policy: Path, model: Path, /) -> None:
    """Write a trained policy as an ONNX model of one control step, for the robot's computer.

    The memory is an explicit input and output.

    Example: snakebench export results/teacher_student/policies/student-0.safetensors student.onnx

    Parameters
    ----------
    policy
        The policy's file, as a study leaves it.
    model
        The ONNX file to write.
    """
    from snakebench.files import check_outputs, readable_file
    from snakebench.policy import Policy

    check_outputs([model], inputs=[policy])
    loaded = Policy.load(readable_file(policy))
    try:
        from snakebench.learning.actor import export_onnx
    except ModuleNotFoundError as error:
        raise InvalidValue(f'export needs {error.name}: pip install "snakebench[learning]"') from None
    export_onnx(loaded, model)
    say(f"written: {model}")


@app.command
def report(
    *,
    results: Path = Path("results"),
    reports: Annotated[Path, Parameter(name=["--out", "--reports"])] = Path("reports"),
) -> None:
    """Write the report again from stored results: an index page, and one page a study; nothing is simulated.

    What is missing is said on the index, with the command that makes it.

    Example: snakebench report --results results --out reports

    Parameters
    ----------
    results
        Directory of result tables.
    reports
        Directory of generated pages.
    """
    from snakebench.site import write_reports

    if not results.is_dir():
        raise InvalidValue(f"{results} holds no results: run a study first, such as snakebench run-study quickstart")
    say(f"index:  {write_reports(results, reports)}")


def run(words: list[str]) -> None:
    """Run the command that the words of a command line tell.

    Raises:
        InvalidValue: when they tell none.
        SnakebenchError: of the command.
    """
    try:
        app(words, exit_on_error=False, print_error=False)
    except CycloptsError as error:
        raise InvalidValue(str(error)) from None
