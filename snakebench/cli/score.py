"""`snakebench score` and `snakebench leaderboard`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

from cyclopts import Parameter

from snakebench.cli.printing import print_rows, say
from snakebench.cli.study import (
    LEADERBOARD,
    REPORTS,
    RESULTS,
    Executor,
    Leaderboard,
    Reports,
    Results,
    Scheduler,
    Workers,
    check_exclusive,
)
from snakebench.files import check_outputs, readable_file, writable_directory

Task = Literal["known", "unknown", "changing", "robust"]


def score(
    file: Annotated[Path, Parameter(help="A gait (.json), a policy (.safetensors, .onnx), or SB3's archive (.zip).")],
    /,
    *,
    task: Annotated[
        list[Task] | None, Parameter(consume_multiple=True, negative=(), help="Tasks; all four if omitted.")
    ] = None,
    seed: Annotated[
        Literal["dev"] | None,
        Parameter(help="dev: the same draws for every file; its own draws if omitted."),
    ] = None,
    quick: Annotated[bool, Parameter(negative=(), help="Swim in the planar engine: a first impression.")] = False,
    trust: Annotated[bool, Parameter(negative=(), help="Load an archive of SB3, which may run code.")] = False,
    out: Annotated[Path, Parameter(help="Existing directory, for score.json and score.html.")] = Path(),
    leaderboard: Leaderboard = LEADERBOARD,
    results: Results = RESULTS,
    workers: Workers = None,
    executor: Executor = "processes",
    scheduler: Scheduler = None,
) -> None:
    """Score a controller in the frozen tasks, as a share of the limit of the body: minutes, with --quick half of one.

    If interrupted, the same command continues. docs/compete.md describes tasks and rules.

    Example: snakebench score results/teacher_student/policies/student-10.safetensors --quick
    """
    import snakebench as sb
    from snakebench.scoring.leaderboard import read_leaderboard
    from snakebench.scoring.making import FILES, write_score
    from snakebench.scoring.page import number, score_table
    from snakebench.scoring.tasks import TASKS

    check_exclusive(workers, scheduler)
    check_outputs([out / name for name in FILES], [readable_file(file)])
    entries = read_leaderboard(leaderboard, scored=True)
    found = sb.score(
        file,
        tasks=TASKS if task is None else task,
        seed=seed,
        quick=quick,
        workers=workers,
        cache=results,
        trust=trust,
        progress=True,
        executor=executor,
        scheduler=scheduler,
    )
    outputs = write_score(out, found, entries)
    print_rows(*score_table(found, entries))
    say(f"score: {number(found.total)}", *(f"written: {path}" for path in outputs))


def leaderboard(
    *,
    check: Annotated[bool, Parameter(negative=(), help="Check all cards, files and scores first.")] = False,
    whole: Annotated[bool, Parameter(negative=(), help="Check by scoring all swims again, not some.")] = False,
    directory: Annotated[Leaderboard, Parameter(name="--leaderboard")] = LEADERBOARD,
    reports: Reports = REPORTS,
    workers: Workers = None,
) -> None:
    """Print the leaderboard and write its page.

    Example: snakebench leaderboard --check
    """
    from snakebench.scoring.checking import check as check_entry
    from snakebench.scoring.leaderboard import read_leaderboard
    from snakebench.scoring.page import leaderboard_table, write_leaderboard

    entries = read_leaderboard(directory)
    writable_directory(reports)
    for one in entries if check or whole else []:
        check_entry(one, None if whole else 4, workers)
        say(f"checked: {one.folder}")
    path = write_leaderboard(entries, reports)
    print_rows(*leaderboard_table(entries))
    say(f"page: {path}")
