"""Pages: stored results to one self-contained HTML file each."""

from collections.abc import Callable, Iterable, Mapping
from contextlib import suppress
from importlib import import_module
from pathlib import Path
from typing import Any

import pandas as pd
from jinja2 import ChoiceLoader, Environment, PackageLoader, StrictUndefined
from markupsafe import Markup

from snakebench.comparison.page import INDEX_FILES, index_files, index_page, index_sections
from snakebench.errors import StoreError, printable, visible
from snakebench.files import inside, writable_directory, write_file
from snakebench.manifest import MANIFEST, command_of, read_manifest
from snakebench.names import STUDIES
from snakebench.publication import snapshot
from snakebench.report.accuracy import accuracy_of
from snakebench.report.animation import swimmer
from snakebench.report.assumptions import ledger
from snakebench.report.bench import bench_page
from snakebench.report.conclusions import conclusions
from snakebench.report.figure_style import packed
from snakebench.report.table import CURRENCY_LABELS, plugin_metrics
from snakebench.studies.config import LIBRARY
from snakebench.studies.published import published, tables_of
from snakebench.tables import table_file
from snakebench.trajectory import Trajectory
from snakebench.workers import answers_to, open_workers, usable_cores

_LARGEST_LINK = 50_000  # to a table that a page holds [bytes]
_PAGES_A_WORKER = 3  # at least: few pages are written sooner than a second process has started


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
_TEMPLATES.globals["currency_labels"] = CURRENCY_LABELS


def write_reports(results: Path, reports: Path, say: Callable[[str], object] = print) -> Path:
    """Write the page of every study in a directory of results, and the index page; return the index's path.

    The index names studies whose results are missing, damaged or of another format; an older page of theirs is replaced
    by one that says so. `say` is called with a line for each page and for each study that has none.
    """
    pages: dict[str, str] = {}
    earlier = _is_ours(writable_directory(reports) / "index.html")
    with snapshot(results) as taken:
        problems, directories = taken.problems, sorted(path.parent for path in taken.copy.glob(f"*/{MANIFEST}"))
        jobs = min(usable_cores(), len(directories) // _PAGES_A_WORKER) or 1
        tasks = [(index_sections, taken.copy, problems), *((_tried, directory) for directory in directories)]
        with open_workers(jobs) as workers, answers_to(workers, _made, tasks) as made:
            sections = next(made)
            for name, (text, problem) in zip([directory.name for directory in directories], made, strict=True):
                if problem:
                    problems[name] = taken.original(problem)
                    continue
                pages[name] = f"{name}.html"
                write_file(inside(reports, pages[name]), taken.original(text))
                say(printable(f"report: {reports / pages[name]}"))
        content = index_page(taken.copy, pages, problems, sections)
        content |= _conclusions("index", content["findings"])
        index = taken.original(rendered("comparison/page.html", content))
    for _name, problem in sorted(problems.items()):
        say(printable(f"left out: {problem}"))
    absent = {name: f"no results in {results / name}" for name in STUDIES if _is_ours(reports / f"{name}.html")}
    for name, problem in (absent | problems).items():
        if name not in pages:
            why = {"study": name, "problem": problem, "command": command_of(name)}
            write_file(inside(reports, f"{name}.html"), rendered("absent.html", why))
    files = index_files(content)
    for name, text in ({"index.html": index} | files).items():
        write_file(reports / name, text)
    for name in set(INDEX_FILES) - files.keys() if earlier else ():  # of earlier results
        (reports / name).unlink(missing_ok=True)
    return reports / "index.html"


def _is_ours(page: Path) -> bool:
    """Whether there is such a page, and written here."""
    with suppress(OSError):
        return b"snakebench</title>" in page.read_bytes()
    return False


def write_report(directory: Path, reports: Path) -> Path:
    """Write the page of the study whose results are in `directory`, and return its path."""
    with snapshot(directory.parent) as taken:
        if directory.name in taken.problems:
            raise StoreError(taken.problems[directory.name])
        text = taken.original(_page(taken.copy / directory.name))
    page = inside(writable_directory(reports), f"{directory.name}.html")
    write_file(page, text)
    return page


def write_animation(trajectory: Trajectory, path: Path, title: str, facts: str) -> None:
    """Write a page in which the robot of a trajectory swims, under a title and a line of facts."""
    write_file(path, rendered("swim.html", {"title": title, "facts": facts, "swimmers": [swimmer(title, trajectory)]}))


def _made(make: Callable[..., Any], *arguments: object) -> Any:
    return make(*arguments)


def _tried(directory: Path) -> tuple[str, str | None]:
    """As `_page`, and what is wrong with the results."""
    try:
        return _page(directory), None
    except StoreError as error:
        return "", str(error)


def _page(directory: Path) -> str:
    if directory.name == "index":
        raise StoreError(f"{directory}: the index page has that name, give the directory another one")
    manifest = read_manifest(directory)
    common = {"manifest": manifest, "made_by": command_of(directory.name, manifest)}
    if manifest.get("config", {}).get("method") == "bench":
        return rendered("bench.html", bench_page(directory) | common)
    study = published(directory)
    tables, config = study.tables, study.config
    content = import_module(f"snakebench.studies.{config['method']}.page").page(study) | common
    content |= _conclusions(directory.name, {**tables, **content.get("findings", {})}) | {
        "config": config,
        "robot": study.robot,
        "fluids": manifest["fluids"],
        "accuracy": accuracy_of(tables),
        "plugin_metrics": plugin_metrics(tables, tables_of(config["method"])),
        "assumptions": ledger(config),
        "downloads": _downloads(directory, tables),
    }
    return rendered(f"studies/{config['method']}/page.html", content)


def rendered(template: str, content: Mapping[str, Any]) -> str:
    """A page from its template."""
    return _TEMPLATES.get_template(template).render(content)


def _downloads(directory: Path, names: Iterable[str]) -> list[dict[str, str]]:
    """The names of those tables of a study that have rows, and links to save them; large tables have no link."""
    files = filter(Path.exists, (table_file(directory / f"{name}.csv") for name in names))
    links = {file.name: "" if file.suffix == ".gz" else packed(file.read_bytes()) for file in files}
    return [{"name": name, "link": link if len(link) <= _LARGEST_LINK else ""} for name, link in links.items()]


def _conclusions(name: str, tables: Mapping[str, pd.DataFrame]) -> dict[str, str | None]:
    """The conclusions that were drawn from published results, or the problem why they cannot be shown."""
    path, found = LIBRARY / f"{name}.md", dict[str, str | None](conclusions=None, problem=None)
    if path.exists():
        try:
            found["conclusions"] = conclusions(path.read_text(encoding="utf-8"), tables, path.name)
        except StoreError as error:
            found["problem"] = str(error)
    return found
