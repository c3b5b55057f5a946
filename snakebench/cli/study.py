"""`snakebench run-study`, `pareto` and `reproduce`: questions are answered, from searches to reports."""

from __future__ import annotations

import shlex
import sys
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from cyclopts import Parameter, Token

from snakebench.cli.printing import print_rows, say
from snakebench.errors import InvalidValue
from snakebench.files import writable_directory

if TYPE_CHECKING:
    from snakebench.studies.config import Setting


def _whole(kind: type, tokens: Sequence[Token]) -> Any:
    """One whole number, or a list of them; 1.5 is not rounded."""
    words = [token.value for token in tokens]
    try:
        return int(words[0]) if kind is int else list(map(int, words))
    except ValueError:
        option = "" if kind is int else f"{tokens[0].keyword}: "  # which is named anyway
        raise ValueError(f"{option}{' '.join(words)}: whole numbers are needed") from None


WHOLE = Parameter(converter=_whole)
_Many = Parameter(consume_multiple=True, negative=())
Profile = Annotated[str | None, Parameter(help="Budget: smoke takes seconds, quick minutes; full is as published.")]
Workers = Annotated[
    int | None, WHOLE, Parameter(help="Evaluations at a time, one a core if omitted; never changes results.")
]
Results = Annotated[Path, Parameter(help="Directory of result tables and of the evaluation cache.")]
Executor = Annotated[str, Parameter(help="Where evaluations run: `processes` of this machine, or `dask`, a cluster.")]
Scheduler = Annotated[
    str | None,
    Parameter(help="Address of a running Dask scheduler, as tcp://HOST:8786; if omitted, `dask` starts workers here."),
]
Reports = Annotated[Path, Parameter(help="Directory of generated pages.")]
Leaderboard = Annotated[Path, Parameter(help="Directory with a folder for each entry.")]
RESULTS, REPORTS, LEADERBOARD = Path("results"), Path("reports"), Path("leaderboard")
_BENCH_SECONDS = 130.0
_UNUSED = {"grid": ("population", "generations", "seeds"), "nsga2": ("grid",)}  # options, by what proposes gaits


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class WorkOptions:
    """The budget, who evaluates, and where results and pages go."""

    profile: Profile = None
    workers: Workers = None
    executor: Executor = "processes"
    scheduler: Scheduler = None
    results: Results = RESULTS
    reports: Reports = REPORTS


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class FrontOptions:
    """What is searched for fronts and how, by the names of a study's settings."""

    fluids: Annotated[list[str] | None, _Many] = None
    "Fluids by name, or as VISCOSITY or VISCOSITY,DENSITY [m²/s, kg/m³]; water, oil1 and oil2 if omitted."
    gait: str | None = None
    """Kind of gait; `snakebench list` shows them. Sinusoidal torque, in the spaces of the study pareto, if omitted; any
    other in its own search space."""
    robot: str | None = None
    "Name of a robot or a robot file (.json); the paper's if omitted."
    grid: Annotated[list[int] | None, _Many, WHOLE] = None
    "How many values of each parameter the grid has; of amplitude, frequency and phase 20 15 15 if omitted."
    population: Annotated[int | None, WHOLE] = None
    "Gaits in a generation of NSGA-II."
    generations: Annotated[int | None, WHOLE] = None
    "Generations of NSGA-II."
    seeds: Annotated[list[int] | None, _Many, WHOLE] = None
    "Seeds of NSGA-II."
    search: Annotated[Literal["grid", "nsga2", "both"], Parameter(name="--method")] = "grid"
    "What proposes the gaits: an exhaustive grid, NSGA-II, or both side by side."
    engine: str | None = None
    "Engine of the search: planar, or pybullet, which takes some thirty times as long."
    verify: str | None = None
    "Engine that measures the published figures; pybullet, the shared evaluator, if omitted."


def run_study(
    study: Annotated[str, Parameter(help="Name of a study (`snakebench list` shows them) or path of a TOML file.")],
    /,
    *,
    seeds: Annotated[
        list[int] | None,
        _Many,
        WHOLE,
        Parameter(help="Seeds of searches, trainings or compared policies, instead of the study's own."),
    ] = None,
    engine: str | None = None,
    optuna: Path | None = None,
    options: WorkOptions = WorkOptions(),
) -> None:
    """Run a study to its report; interrupted, the same command continues it.

    Example: snakebench run-study sea_snake --profile quick --seeds 0 1 2 --workers 2

    Parameters
    ----------
    engine
        Engine instead of the study's own; at that engine's own physics rate.
    optuna
        A file, such as studies.db, in which every search by one of Optuna's samplers is stored as an Optuna study, for
        optuna-dashboard; a study of the same name is replaced.
    """
    _run(study, options, optuna=optuna, seeds=seeds, engine=engine)
    if optuna is not None:
        say(f"studies: optuna-dashboard sqlite:///{optuna.resolve()}")


def pareto(
    *, search: FrontOptions = FrontOptions(), name: str | None = None, options: WorkOptions = WorkOptions()
) -> None:
    """Find the fronts of speed against power of a kind of gait: per fluid, integrated and simple-sum.

    Gaits are searched on the planar engine; every member of every front is verified in PyBullet. Interrupted, the same
    command continues.

    Example: snakebench pareto --fluids water oil1 5e-3,900 --grid 10 8 8

    Parameters
    ----------
    name
        Name of the results and the page; if omitted, it says what differs from the published study.
    """
    asked = asdict(search)
    useless = [option for option in _UNUSED.get(search.search, ()) if asked[option] is not None]
    if useless:
        raise InvalidValue(f"--{useless[0]}: with --method {search.search} it has no effect")
    directory = _run("pareto", options, name, **asked)
    from snakebench.studies.front_tables import front_label, front_table
    from snakebench.studies.published import published
    from snakebench.studies.published_fronts import powers_compared

    study = published(directory)
    indicators, (least, most) = study.tables["indicators"], study.config["reference"]
    print_rows(*front_table(indicators))
    powers = ", ".join(f"{power:g}" for power in powers_compared(indicators))
    say(
        "hypervolume [m/s W], as verified, and its difference Δ to the searching engine's; speed [m/s] at P / P+ [W]",
        "note: rows that end on P+ are fronts of P+, the others of P",
        f"note: indicators.csv: speeds are compared at {powers} W for every robot",
    )
    for row in indicators[indicators["beyond"] > 0].to_dict("records"):
        lost = f"{row['beyond']} of {row['points']} points lie beyond the reference ({least:g} m/s, {most:g} W)"
        label = front_label(row["space"], row["front"], row["currency"])
        say(f"note: {label}: {lost} and add nothing to the hypervolume")


def reproduce(
    *,
    profile: Profile = None,
    workers: Workers = None,
    results: Results = RESULTS,
    reports: Reports = REPORTS,
    leaderboard: Leaderboard = LEADERBOARD,
) -> None:
    """Run all studies of the package but quickstart and write their pages; if interrupted, the same command continues.

    An estimate for each study is printed first. On two cores all studies take about 26 hours, eleven of them for
    training; with profile quick 45 minutes, with smoke five. Finished studies are read from the cache within minutes;
    sea_snake in full takes ten, since its sampler chooses its gaits again. In full, with a leaderboard beside the
    results, its entries are then made and scored again, and the speed of this machine is measured.

    Example: snakebench reproduce --profile quick --workers 2
    """
    from snakebench.site import write_report
    from snakebench.studies import reproduction
    from snakebench.studies.running import PAGE_SECONDS
    from snakebench.workers import check_workers, usable_cores

    count = usable_cores() if workers is None else workers
    check_workers(count)
    configs = reproduction.checked_configs(profile)
    writable_directory(reports)
    last = {}
    if _are_beside(leaderboard, results) and all(config.profile == "full" for config in configs):
        from snakebench.bench import run_bench
        from snakebench.engines.planar import MOST_THREADS
        from snakebench.scoring.making import make_leaderboard, making_seconds

        make = partial(make_leaderboard, leaderboard, results, count, say)
        last["leaderboard"] = reproduction.Task(making_seconds(leaderboard, count), make)
        last["bench"] = reproduction.Task(
            _BENCH_SECONDS, partial(run_bench, results, min(count, usable_cores(), MOST_THREADS))
        )
    pages = partial(write_pages, results, reports, leaderboard)  # again: pages show what later studies found
    last["pages"] = reproduction.Task(PAGE_SECONDS * (len(configs) + 1), pages)
    reproduction.reproduce(configs, results, count, partial(write_report, reports=reports), last)
    say(f"results: {results}", f"index:   {reports / 'index.html'}")


def write_pages(results: Path, reports: Path, leaderboard: Path) -> Path:
    """Write the pages of all results, and that of a leaderboard beside them; returns the path of the index."""
    from snakebench.site import write_reports

    index = write_reports(results, reports)
    if _are_beside(leaderboard, results):
        from snakebench.scoring.leaderboard import read_leaderboard
        from snakebench.scoring.page import write_leaderboard

        write_leaderboard(read_leaderboard(leaderboard, scored=True), reports)
    return index


def _are_beside(leaderboard: Path, results: Path) -> bool:
    """Whether there is a leaderboard, of entries that are made from these results: its scripts read `results`."""
    return leaderboard.is_dir() and leaderboard.resolve().parent / "results" == results.resolve()


def check_exclusive(workers: int | None, scheduler: str | None) -> None:
    """Make sure that workers are not asked of a cluster that runs already."""
    if workers is not None and scheduler is not None:
        raise InvalidValue("--workers and --scheduler exclude each other: a cluster has the workers that it has")


def _run(
    study: str, options: WorkOptions, name: str | None = None, optuna: Path | None = None, **overrides: Setting | None
) -> Path:
    """Run a study to its report, say where both are, and return the directory of its tables."""
    from snakebench.site import write_report
    from snakebench.studies import running
    from snakebench.studies.config import study_path, study_settings
    from snakebench.workers import usable_cores

    config = running.study_config(study_settings(study_path(study), options.profile, name, **overrides))
    writable_directory(options.reports)
    check_exclusive(options.workers, options.scheduler)
    directory = running.run_study(
        config,
        options.results,
        usable_cores() if options.workers is None else options.workers,
        options.executor,
        options.scheduler,
        optuna=optuna,
        command=shlex.join(["snakebench", *sys.argv[1:]]),
        page=partial(write_report, reports=options.reports),
    )
    say(f"results: {directory}", f"report:  {options.reports / directory.name}.html")
    return directory
