"""The leaderboard made again: each entry by the script that its card names, and scored."""

import os
import shlex
import subprocess
import sys
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from threading import Lock

from snakebench.errors import SnakebenchError, StoreError
from snakebench.execution import physics_fingerprint
from snakebench.files import inside, writable_directory, write_file
from snakebench.publication import locked
from snakebench.scoring.entry import read_entry
from snakebench.scoring.leaderboard import (
    SCORE,
    Card,
    Listed,
    entries_in,
    entry_file,
    read_card,
    read_leaderboard,
    write_entry,
)
from snakebench.scoring.page import score_page
from snakebench.scoring.result import Score
from snakebench.scoring.score import score
from snakebench.scoring.tasks import VERSION, load_tasks
from snakebench.sources import code_digest, package_version
from snakebench.value import digest

FILES = SCORE, "score.html"  # of a score
_SCORE_SECONDS = 180.0  # of one core, that an entry is scored in, about
Script = subprocess.Popen[bytes]
# Runs a script, and ends it when this process ends, even if killed: the script's standard input is then closed.
_RUN = """
import os, runpy, sys, threading
threading.Thread(target=lambda: (os.read(0, 1), os._exit(1)), daemon=True).start()
del sys.argv[0]
sys.path[0] = os.path.dirname(sys.argv[0])
runpy.run_path(sys.argv[0], run_name="__main__")
"""
_LEARNING = (  # modules that scripts which train use
    *("gain_schedule", "learning.control_step", "learning.estimator", "learning.network", "learning.ppo"),
    *("learning.vector", "observation", "reward", "collocation.front"),
    *("scoring.tasks", "scoring.trial", "scoring.yardstick"),
)
_OF_STUDIES = "study_entries.py"  # a script that trains nothing
_OF_SCRIPT = {"file", "training_steps", "hours"}  # fields of a card that its script knows


class ScriptFailed(SnakebenchError):
    """A script that did not make its entry."""


def making_seconds(directory: Path, workers: int) -> float:
    """About how long `make_leaderboard` takes [s]: trainings as their cards say, and the scores.

    Raises:
        InvalidValue: when a file is no entry, or needs a package that is not installed.
        StoreError: when a card is damaged or names what is no script there.
    """
    seconds = 0.0
    for folder in entries_in(directory):
        card = read_card(folder)
        if card.made_by:
            _script(folder, card)
        if (file := entry_file(folder, card)).exists() or not card.made_by:
            read_entry(file)
        trains = card.made_by and card.training_steps and _OF_STUDIES not in card.made_by
        seconds += _SCORE_SECONDS + (3600 * card.hours if trains else 0.0)
    return seconds / workers


def make_leaderboard(directory: Path, results: Path, workers: int, say: Callable[[str], object]) -> None:
    """Make the files of all entries whose cards name a script, and score all; run again, it continues.

    Scripts are run in the directory's parent, where they find the results in `results`.

    Raises:
        ScriptFailed: when a script fails.
        InvalidValue: when an entry is none.
        StoreError: when a card names what is no script there, something cannot be read or written, or another process
            makes the leaderboard.
    """
    with locked(results / directory.name):
        _make(directory, results, workers, say)


def _make(directory: Path, results: Path, workers: int, say: Callable[[str], object]) -> None:
    folders = entries_in(directory)
    scripts = Scripts()
    with ThreadPoolExecutor(workers) as pool, _ended(pool, scripts):
        for folder in pool.map(partial(make_entry, results=results, scripts=scripts), folders):
            say(f"made: {folder}")
    for folder in folders:  # pages come later: they tell the place among all scores
        found = score(entry_file(folder, read_card(folder)), workers=workers, cache=results)
        write_file(folder / SCORE, found.text())
        say(f"scored: {folder}")
    entries = read_leaderboard(directory)
    for one in entries:
        write_score(one.folder, one.score, entries)


def write_score(folder: Path, found: Score, entries: Sequence[Listed]) -> list[Path]:
    """Write a score and its page, with its place among entries, and return their paths."""
    paths = [folder / name for name in FILES]
    for path, text in zip(paths, (found.text(), score_page(found, entries)), strict=True):
        write_file(path, text)
    return paths


class Scripts:
    """The scripts that threads have started, which can be ended together."""

    def __init__(self) -> None:
        self._started, self._ended, self._lock = list[Script](), False, Lock()

    def add(self, script: Script) -> None:
        """A script has started; it is ended at once if all others were."""
        with self._lock:
            self._started.append(script)
            if self._ended:
                script.terminate()

    def end(self) -> None:
        """End all, and each that is added later."""
        with self._lock:
            self._ended = True
            for one in self._started:
                one.terminate()  # nothing, where it has ended


@contextmanager
def _ended(pool: ThreadPoolExecutor, scripts: Scripts) -> Iterator[None]:
    """At the end, no script runs or begins any more."""
    try:
        yield
    finally:
        pool.shutdown(wait=False, cancel_futures=True)
        scripts.end()


def make_entry(folder: Path, results: Path, scripts: Scripts) -> Path:
    """Make the file of an entry by the script that its card names, if it does; returns the folder.

    The script is added to `scripts` as it starts. The card keeps what it says, but for steps and hours.
    """
    card = read_card(folder)
    if not card.made_by:
        return folder
    script, arguments = _script(folder, card)
    code = code_digest(*_LEARNING), package_version("torch"), package_version("stable-baselines3")
    made_of = script.read_text(encoding="utf-8"), arguments, physics_fingerprint("planar"), load_tasks(VERSION).content
    key = digest([*made_of, *code])[:16]
    out = writable_directory(results / ".cache" / "entries" / f"{folder.name}-{key}").resolve()
    command = [sys.executable, "-c", _RUN, str(script), *arguments, "--out", str(out)]
    alone = os.environ | {"OMP_NUM_THREADS": "1"}
    held, lost = subprocess.PIPE, subprocess.DEVNULL
    with Script(command, cwd=_root(folder), env=alone, stdin=held, stdout=lost, stderr=subprocess.PIPE) as started:
        scripts.add(started)
        errors = started.stderr.read() if started.stderr else b""
    if started.returncode != 0:
        lines = errors.decode(errors="replace").strip().splitlines()
        raise ScriptFailed(f"{folder}: {card.made_by} failed: {lines[-1] if lines else started.returncode}")
    own = read_card(out)
    content = (out / own.file).read_bytes() if (out / own.file).exists() else None
    known = card.model_dump(exclude=_OF_SCRIPT) | own.model_dump(include=_OF_SCRIPT)
    write_entry(folder, content, known.pop("file"), **known)
    return folder


def _root(folder: Path) -> Path:
    """The directory that the leaderboard is in."""
    return folder.resolve().parent.parent


def _script(folder: Path, card: Card) -> tuple[Path, list[str]]:
    """The script that makes an entry, and its arguments."""
    root = _root(folder)
    try:
        name, *arguments = shlex.split(card.made_by)
    except ValueError:
        raise StoreError(f"{folder}: made_by = {card.made_by}: a script and its arguments are needed") from None
    script = inside(root, name)
    if script.suffix != ".py" or not script.is_file():
        raise StoreError(f"{folder}: made_by = {card.made_by}: {name} is no script in {root}")
    return script, arguments
