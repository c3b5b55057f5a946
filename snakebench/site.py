"""Pages: stored results to one self-contained HTML file each."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from importlib import import_module
from pathlib import Path
from typing import Any

import pandas as pd
from jinja2 import ChoiceLoader, Environment, PackageLoader, StrictUndefined
from joblib import Parallel, cpu_count, delayed
from markupsafe import Markup

from snakebench.comparison.page import index_files, index_page
from snakebench.errors import StoreError, printable, visible
from snakebench.files import inside, writable_directory, write_file
from snakebench.fluid import FLUIDS
from snakebench.report.accuracy import accuracy_of
from snakebench.report.animation import swimmer
from snakebench.report.assumptions import ledger
from snakebench.report.bench import bench_page
from snakebench.report.conclusions import conclusions
from snakebench.report.downloads import downloads
from snakebench.report.plugin_metrics import plugin_metrics
from snakebench.robot import Robot
from snakebench.snapshot import snapshot
from snakebench.store import MANIFEST, STUDIES, command_of, read_manifest
from snakebench.studies.config import LIBRARY
from snakebench.studies.published import Published, published, tables_of
from snakebench.trajectory import Trajectory

_PAGES_A_WORKER = 3  # at least


def _seen(value: object) -> object:
    """What a template shows: text that nothing in it can turn around or hide; what is HTML already stays."""
    return visible(value) if isinstance(value, str) and not isinstance(value, Markup) else value


_TEMPLATES = Environment(
    loader=ChoiceLoader([PackageLoader("snakebench.report"), PackageLoader("snakebench", "")]),
    autoescape=True,
    finalize=_seen,
    undefined=StrictUndefined,
    trim_blocks=True,
    lstrip_blocks=True,
)


def write_reports(results: Path, reports: Path, say: Callable[[str], object] = print) -> Path:
    """Write the page of every study in a directory of results, and the index page; return the index's path.

    Studies whose results are missing, damaged or of another format are said on the index; an older page of theirs is
    replaced by one that says so.

    Args:
        results: the directory; it may be empty.
        reports: where the pages go.
        say: told of each page and of each study that has none.

    Raises:
        StoreError: when a page cannot be written.
    """
    pages: dict[str, str] = {}
    writable_directory(reports)
    with snapshot(results) as taken:
        problems = taken.problems
        directories = sorted(path.parent for path in taken.copy.glob(f"*/{MANIFEST}"))
        with _workers(len(directories)) as workers:
            for directory, (name, text) in zip(directories, workers(map(delayed(_tried), directories)), strict=True):
                if name is None:
                    problems[directory.name] = taken.original(text)
                    continue
                write_file(inside(reports, name), taken.original(text))
                pages[directory.name] = name
                say(printable(f"report: {reports / name}"))
        content, index = index_page(taken.copy, pages, problems), reports / "index.html"
        content["conclusions"], content["problem"] = _conclusions("index", content["findings"])
        text = taken.original(_TEMPLATES.get_template("comparison/page.html").render(content))
    for name, problem in sorted(problems.items()):
        say(printable(f"left out: {problem}"))
        _write_absent(inside(reports, f"{name}.html"), name, problem)
    for name in STUDIES:
        if name not in pages.keys() | problems.keys() and (reports / f"{name}.html").exists():
            _write_absent(reports / f"{name}.html", name, f"no results in {results / name}")
    write_file(index, text)
    for name, text in index_files(content).items():
        write_file(reports / name, text)
    return index


def write_report(directory: Path, reports: Path) -> Path:
    """Write the page of the study whose results are in `directory`, and return its path.

    Raises:
        StoreError: when results are missing, damaged or of another format, or the page cannot be written.
    """
    with snapshot(directory.parent) as taken:
        if directory.name in taken.problems:
            raise StoreError(taken.problems[directory.name])
        name, text = _page_of(taken.copy / directory.name)
        text = taken.original(text)
    page = inside(writable_directory(reports), name)
    write_file(page, text)
    return page


def _workers(pages: int) -> Parallel:
    """Who writes so many pages: few are written sooner than a second process has started."""
    jobs = min(cpu_count(), pages // _PAGES_A_WORKER) or 1
    return Parallel(jobs, backend="loky" if jobs > 1 else "sequential", return_as="generator")


def _tried(directory: Path) -> tuple[str | None, str]:
    """As `_page_of`; without a name, what is wrong with the results."""
    try:
        return _page_of(directory)
    except StoreError as error:
        return None, str(error)


def _page_of(directory: Path) -> tuple[str, str]:
    """Name and text of a study's page; errors as `write_report`, but for writing."""
    if directory.name == "index":
        raise StoreError(f"{directory}: the index page has that name, give the directory another one")
    manifest = read_manifest(directory)
    if manifest.get("config", {}).get("method") == "bench":
        content = bench_page(directory, manifest) | {"made_by": command_of(directory.name, manifest)}
        return f"{directory.name}.html", _TEMPLATES.get_template("bench.html").render(content)
    study = published(directory)
    method = study.config["method"]
    content = import_module(f"snakebench.studies.{method}.page").page(study)
    template = _TEMPLATES.get_template(f"studies/{method}/page.html")
    return f"{directory.name}.html", template.render(content | _common(study, content.get("findings", {})))


def _common(study: Published, findings: Mapping[str, pd.DataFrame]) -> dict[str, Any]:
    """What every study's page shows; conclusions are drawn from its tables and from what its page found in them."""
    sentences, problem = _conclusions(study.directory.name, {**study.tables, **findings})
    return {
        "manifest": study.manifest,
        "config": study.config,
        "made_by": command_of(study.directory.name, study.manifest),
        "swum": _swum(study.manifest),
        "conclusions": sentences,
        "problem": problem,
        "accuracy": accuracy_of(study.tables),
        "plugin_metrics": plugin_metrics(study.tables, tables_of(study.config["method"])),
        "assumptions": ledger(study.config),
        "downloads": downloads(study.directory, study.tables),
    }


def _conclusions(name: str, tables: Mapping[str, pd.DataFrame]) -> tuple[Markup | None, str | None]:
    """What was concluded from published results, or why that cannot be shown."""
    path = LIBRARY / f"{name}.md"
    if not path.exists():
        return None, None
    try:
        return conclusions(path.read_text(encoding="utf-8"), tables, path.name), None
    except StoreError as error:
        return None, str(error)


def _swum(manifest: dict[str, Any]) -> str | None:
    """The robot and the fluids of a study, in numbers."""
    config = manifest["config"]
    if "robot" not in config or "fluids" not in config:
        return None
    robot = Robot(**config["robot"])
    numbers = manifest.get("fluids") or {name: FLUIDS[name].model_dump() for name in config["fluids"] if name in FLUIDS}
    fluids = [
        f"{name} ({fluid['kinematic_viscosity']:.3g} m²/s, {fluid['density']:.4g} kg/m³)"
        for name, fluid in numbers.items()
    ]
    size = f"{robot.n_joints} joints, {robot.link_lengths.sum():.2f} m, {robot.total_mass:.1f} kg"
    return f"Robot: {size}, diameter {robot.diameter:g} m. Fluids: {', '.join(fluids)}."


def _write_absent(page: Path, study: str, problem: str) -> None:
    """In place of a page that would show older results: what is missing, and the command that makes it."""
    text = _TEMPLATES.get_template("absent.html").render(study=study, problem=problem, command=command_of(study))
    write_file(page, text)


def write_animation(trajectory: Trajectory, path: Path, title: str, facts: str) -> None:
    """Write a page in which the robot of a trajectory swims, under a title and a line of facts.

    Raises:
        StoreError: when it cannot be written.
    """
    write_file(
        path,
        _TEMPLATES.get_template("swim.html").render(title=title, facts=facts, swimmers=[swimmer(title, trajectory)]),
    )
