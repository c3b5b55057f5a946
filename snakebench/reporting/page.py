"""Pages: stored results to one self-contained HTML file each."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined, TemplateError

from snakebench.errors import StoreError
from snakebench.files import writable_directory, write_file
from snakebench.reporting.adaptation import adaptation_page
from snakebench.reporting.animation import swimmer
from snakebench.reporting.cross import cross_page
from snakebench.reporting.fourier import fourier_page
from snakebench.reporting.learned_front import learned_front_page
from snakebench.reporting.pareto import pareto_page
from snakebench.reporting.sea_snake import sea_snake_page
from snakebench.reporting.sensitivity import sensitivity_page
from snakebench.reporting.teacher_student import teacher_student_page
from snakebench.reporting.validation import bench_page, validation_page
from snakebench.store import read_manifest
from snakebench.trajectory import Trajectory

_TEMPLATES = Environment(
    loader=PackageLoader("snakebench.reporting"),
    autoescape=True,
    undefined=StrictUndefined,
    trim_blocks=True,
    lstrip_blocks=True,
)


def write_report(directory: Path, reports: Path) -> Path:
    """Write the page of the study whose results are in `directory`, and return its path.

    Raises:
        StoreError: when results are missing, damaged or of another format, or the page cannot be written.
    """
    manifest = read_manifest(directory)
    try:
        page = reports / f"{manifest['study']}.html"
        method = manifest["config"]["method"]
        text = _TEMPLATES.get_template(f"{method}.html").render(_PAGES[method](directory, manifest))
    except (LookupError, TypeError, ValueError, TemplateError) as error:
        about = f"{type(error).__name__}: {error}".splitlines()[0]
        raise StoreError(
            f"the results in {directory} are damaged or incomplete ({about}): run the study again"
        ) from None
    writable_directory(reports)
    write_file(page, text)
    return page


def write_animation(trajectory: Trajectory, path: Path, title: str, facts: str) -> None:
    """Write a page in which the robot of a trajectory swims, under a title and a line of facts.

    Raises:
        StoreError: when it cannot be written.
    """
    write_file(
        path,
        _TEMPLATES.get_template("swim.html").render(title=title, facts=facts, swimmers=[swimmer(title, trajectory)]),
    )


# What a method's page shows, from the directory of its results and their manifest.
_PAGES: dict[str, Callable[[Path, dict[str, Any]], dict[str, Any]]] = {
    "pareto": pareto_page,
    "sea_snake_front": pareto_page,
    "sea_snake": sea_snake_page,
    "fourier": fourier_page,
    "teacher_student": teacher_student_page,
    "learned_front": learned_front_page,
    "cross": cross_page,
    "adaptation": adaptation_page,
    "sensitivity": sensitivity_page,
    "validation": validation_page,
    "bench": bench_page,
}
