"""`snakebench reproduce`: everything that is published, with one command."""

from __future__ import annotations

from pathlib import Path

from snakebench.cli.printing import say


def reproduce(
    *,
    profile: str | None = None,
    workers: int | None = None,
    results: Path = Path("results"),
    reports: Path = Path("reports"),
) -> None:
    """Run all studies of the library to their reports, each when it ends; interrupted, the same command continues.

    It first says how long each study will take: on two cores some ten hours in all, of which learning takes six; with
    profile quick two hours, with smoke five minutes. Studies that are finished are passed in minutes, but sea_snake in
    full, which chooses gaits by GP again: some twenty minutes.

    Example: snakebench reproduce --profile quick --workers 2

    Parameters
    ----------
    profile
        Which budget of every study; the published one, full, if omitted.
    workers
        How many evaluations at a time; as many as cores if omitted. They change the time, never the result.
    results
        Directory of result tables and of the evaluation cache.
    reports
        Directory of generated pages.
    """
    from snakebench.files import writable_directory
    from snakebench.studies import reproduction
    from snakebench.workers import check_workers, usable_cores

    crew = usable_cores() if workers is None else workers
    check_workers(crew)
    configs = reproduction.checked_configs(profile)
    writable_directory(reports)
    from snakebench.site import write_report, write_reports

    index: list[Path] = []
    reproduction.reproduce(
        configs,
        results,
        crew,
        lambda directory: write_report(directory, reports),
        lambda: index.append(write_reports(results, reports)),  # again: pages show what later studies found
    )
    say(f"results: {results}", f"index:   {index[0]}")
