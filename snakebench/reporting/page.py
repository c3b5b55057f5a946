"""Pages: stored results to one self-contained HTML file each."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined, TemplateError

from snakebench.errors import StoreError
from snakebench.evaluation import Scenario
from snakebench.files import writable_directory, write_file
from snakebench.reporting import figures, tables
from snakebench.reporting.animation import swimmer
from snakebench.reporting.assumptions import assumptions
from snakebench.reporting.validation import bench_page, validation_page
from snakebench.robot import Robot
from snakebench.store import read_manifest, read_table
from snakebench.trajectory import Trajectory

_CONTROL_RATE = Scenario.model_fields["control_rate"].default  # of every study [Hz]
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


def _sea_snake(directory: Path, manifest: dict[str, Any]) -> dict[str, Any]:
    """Everything the sea-snake page shows."""
    trials, optima = read_table(directory / "trials.csv"), read_table(directory / "optima.csv")
    config = {"engine": "pybullet"} | manifest["config"]
    objectives = list(dict.fromkeys(trials["objective"]))
    pairs = list(dict.fromkeys(zip(optima["objective"], optima["fluid"], strict=True)))
    swims = {pair: Trajectory.load(directory / "trajectories" / f"{pair[0]}-{pair[1]}.npz") for pair in pairs}
    own = {fluid: swim for (objective, fluid), swim in swims.items() if objective == fluid}
    labels = {pair: f"own gait in {pair[1]}" if pair[0] == pair[1] else f"shared gait in {pair[1]}" for pair in pairs}
    failed = trials[trials["status"] != "ok"]["status"].value_counts().to_dict()
    return {
        "manifest": manifest,
        "config": config,
        "answers": tables.answers(optima),
        "best": tables.best_gaits(optima, config["space"]),
        "seeds": tables.over_seeds(optima),
        "shared": tables.one_gait_for_all(optima) if "mean" in objectives else None,
        "variants": tables.variants(optima),
        "failed": failed,
        "convergence": figures.convergence(trials),
        "search_space": figures.search_space(trials, config["space"]),
        "time_series": figures.time_series(own),
        "spectra": figures.spectra(own),
        "swimmers": [swimmer(labels[pair], swim) for pair, swim in swims.items()],
        "assumptions": assumptions(
            Robot(**config["robot"]), config["physics_rate"], config["check_rate"], _CONTROL_RATE, config["duration"]
        ),
    }


# What a method's page shows, from the directory of its results and their manifest.
_PAGES: dict[str, Callable[[Path, dict[str, Any]], dict[str, Any]]] = {
    "sea_snake": _sea_snake,
    "validation": validation_page,
    "bench": bench_page,
}
