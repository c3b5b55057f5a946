"""`snakebench run-study` and `snakebench pareto`: a question is answered, from searches to a report."""

from __future__ import annotations

import shlex
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from cyclopts import Parameter

from snakebench.cli.printing import print_rows, say
from snakebench.errors import InvalidValue

if TYPE_CHECKING:
    from snakebench.studies.config import Setting

_Many = Parameter(consume_multiple=True, negative=())


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class WorkOptions:
    """Who evaluates, and where results and pages go."""

    workers: int | None = None
    "How many evaluations at a time; as many as cores if omitted. They change the time, never the result."
    executor: str = "processes"
    "Who makes them: processes of this machine, or a dask cluster."
    scheduler: str | None = None
    "Address of a dask cluster's scheduler; if omitted, the cluster is of worker processes on this machine."
    results: Path = Path("results")
    "Directory of result tables and of the evaluation cache."
    reports: Path = Path("reports")
    "Directory of generated pages."

    def crew(self) -> tuple[int, str, str | None]:
        """Workers, executor and scheduler, as `run_study` is told."""
        from snakebench.workers import usable_cores

        if self.workers is not None and self.scheduler is not None:
            raise InvalidValue("--workers and --scheduler exclude each other: a cluster has the workers that it has")
        return usable_cores() if self.workers is None else self.workers, self.executor, self.scheduler


def run_study(
    study: str,
    /,
    *,
    profile: str | None = None,
    seeds: Annotated[list[int] | None, _Many] = None,
    engine: str | None = None,
    optuna: Path | None = None,
    options: WorkOptions = WorkOptions(),
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
    optuna
        A file, such as studies.db, in which every search by one of Optuna's samplers is stored as an Optuna study, for
        optuna-dashboard; a study of the same name is replaced.
    """
    _run(study, options, profile, optuna, seeds=seeds, engine=engine)
    if optuna is not None:
        say(f"studies: optuna-dashboard sqlite:///{optuna.resolve()}")


def pareto(
    *,
    fluids: Annotated[list[str] | None, _Many] = None,
    gait: str | None = None,
    robot: str | None = None,
    method: Literal["grid", "nsga2", "both"] = "grid",
    grid: Annotated[list[int] | None, _Many] = None,
    population: int | None = None,
    generations: int | None = None,
    seeds: Annotated[list[int] | None, _Many] = None,
    engine: str | None = None,
    verify: str | None = None,
    profile: str | None = None,
    name: str | None = None,
    options: WorkOptions = WorkOptions(),
) -> None:
    """Find the fronts of speed against power of a kind of gait: per fluid, integrated and simple-sum.

    Gaits are searched on the planar engine; every member of every front is verified in PyBullet. Interrupted, the same
    command continues.

    Example: snakebench pareto --fluids water oil1 5e-3,900 --grid 10 8 8

    Parameters
    ----------
    fluids
        Fluids by name, or as VISCOSITY or VISCOSITY,DENSITY [m²/s, kg/m³]; water, oil1 and oil2 if omitted.
    gait
        Which kind; `snakebench list` shows them. Sinusoidal torque, in the paper's space and a wider one, if omitted;
        any other in its own search space.
    robot
        Which robot; the paper's if omitted.
    method
        What proposes the gaits: an exhaustive grid, NSGA-II, or both side by side.
    grid
        How many values of each parameter the grid has; of amplitude, frequency and phase 20 15 15 if omitted.
    population
        Gaits in a generation of NSGA-II.
    generations
        Generations of NSGA-II.
    seeds
        Seeds of NSGA-II.
    engine
        What searches: planar, or pybullet, which takes some thirty times as long.
    verify
        What measures the published figures: pybullet, the shared evaluator, unless told otherwise.
    profile
        Which budget, for all that is not given: smoke takes seconds, quick minutes, full is the published one.
    name
        What results and page are called; by what differs from the published study if omitted.
    """
    budget = {"grid": grid, "population": population, "generations": generations, "seeds": seeds}
    what = {"fluids": fluids, "gait": gait, "robot": robot}
    whose = {"search": method, "engine": engine, "verify": verify}
    directory = _run("pareto", options, profile, None, name, **what, **budget, **whose)
    from snakebench.studies.pareto.page import front_table
    from snakebench.studies.published import published
    from snakebench.studies.published_fronts import powers_compared

    study = published(directory)
    indicators, (least, most) = study.tables["indicators"], study.config["reference"]
    print_rows(*front_table(indicators))
    powers = ", ".join(f"{power:g}" for power in powers_compared(indicators))
    say(
        "hypervolume [m/s W], as verified, and its difference Δ to the searching engine's; speed [m/s] at P / P+ [W]",
        f"note: indicators.csv: speeds are compared at {powers} W for every robot",
    )
    for row in indicators[indicators["beyond"] > 0].itertuples():
        lost = f"{row.beyond} of {row.points} points lie beyond the reference ({least:g} m/s, {most:g} W)"
        say(f"note: {row.space}, {row.front}: {lost} and add nothing to the hypervolume")


def _run(
    study: str,
    options: WorkOptions,
    profile: str | None,
    shown: Path | None,
    name: str | None = None,
    **overrides: Setting | None,
) -> Path:
    """Run a study to its report, say where both are, and return the directory of its tables."""
    from snakebench.files import writable_directory
    from snakebench.studies import running
    from snakebench.studies.config import study_path, study_settings

    config = running.study_config(study_settings(study_path(study), profile, name, **overrides))
    writable_directory(options.reports)
    typed = shlex.join(["snakebench", *sys.argv[1:]])
    pages: list[Path] = []

    def page(directory: Path) -> None:
        from snakebench.site import write_report

        pages.append(write_report(directory, options.reports))

    directory = running.run_study(config, options.results, *options.crew(), optuna=shown, command=typed, page=page)
    say(f"results: {directory}", f"report:  {pages[0]}")
    return directory
