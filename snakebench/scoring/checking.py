"""Whether entries of the leaderboard are as they were scored."""

import random
from collections.abc import Sequence

import numpy as np

from snakebench.errors import InvalidValue, StoreError
from snakebench.scoring.entry import SAFE, Entry, read_entry
from snakebench.scoring.leaderboard import Listed, entry_file
from snakebench.scoring.result import summary, totals
from snakebench.scoring.score import Planned, at_powers, planned, swum
from snakebench.scoring.swims import Swim
from snakebench.scoring.tasks import Tasks, load_tasks

_SAME = 1e-3  # largest difference of scores that other processors may make


def check(one: Listed, swims: int | None = 4, workers: int | None = 1) -> None:
    """Make sure that an entry is as it was scored; score some swims again, chosen at random, or all if `swims` is None.

    Raises:
        StoreError: when file, card and score do not belong together, or the score is another one.
        InvalidValue: when the file is no entry.
    """
    tasks, score = load_tasks(one.score.tasks), one.score
    if score.content != tasks.content:
        raise _refused(one, f"it was scored with other tasks than {tasks.version} are")
    entry = _entry(one)
    plans = planned(tasks, entry, score.seed, entry.tasks, quick=False)
    _check_means(one, tasks, entry, plans)
    if swims is None:
        _compare(one, score.swims, at_powers(tasks, swum(tasks, plans, workers)))
        return
    stored = {swim.label: swim for swim in score.swims}
    kept = [plan for plan in plans if plan.label in stored]
    if chosen := random.sample(kept, min(swims, len(kept))):
        _compare(one, [stored[plan.label] for plan in chosen], swum(tasks, chosen, workers))


def _entry(one: Listed) -> Entry:
    """The entry in the file of a card, if it is the one that was scored."""
    score, file = one.score, entry_file(one.folder, one.card)
    if file.suffix not in SAFE:
        raise InvalidValue(f"{file}: the leaderboard takes {', '.join(SAFE)} only, which execute nothing")
    entry = read_entry(file)
    if score.entry != entry.digest:
        raise _refused(one, f"{file.name} was changed since it was scored: score it again")
    if (score.information, score.engine, score.seed) != (entry.information, "pybullet", entry.digest):
        raise _refused(one, "it was not scored in full: neither --quick nor --seed dev is allowed")
    if one.card.information != entry.information:
        raise _refused(one, f"information = {one.card.information}: by its file it is {entry.information}")
    return entry


def _check_means(one: Listed, tasks: Tasks, entry: Entry, plans: Sequence[Planned]) -> None:
    """Make sure that a score has all swims that it should have, and is their mean."""
    found, wanted = ([part.label for part in parts if part.label[0] != "known"] for parts in (one.score.swims, plans))
    known = [swim for swim in one.score.swims if swim.task == "known"]
    targets = {name: tasks.known.powers if len(entry.told(name)) > 1 else (None,) for name in tasks.fluids}
    complete = [(swim.where, swim.target) for swim in known] == [
        (name, target) for name, powers in targets.items() for target in powers
    ]
    with np.errstate(over="ignore"):  # of absurd scores: their interval is infinite, and not the one that is stated
        scores = summary(entry.tasks, one.score.swims)
    total = totals([part for part in scores.values() if part.score is not None])
    told = {name: getattr(one.score, name) for name in total}
    if found != wanted or not complete or (scores, total) != (one.score.scores, told):
        raise _refused(one, "its swims are not those of its file, or its score is not their mean: score it again")


def _compare(one: Listed, stored: Sequence[Swim], again: Sequence[Swim]) -> None:
    for old, new in zip(stored, again, strict=True):
        if old.label != new.label or max(abs(old.score - new.score), abs(old.net_score - new.net_score)) > _SAME:
            where = " ".join(filter(None, (old.task, old.where, old.perturbation)))
            raise _refused(one, f"{where} has the score {old.score:.4f}, and scored again {new.score:.4f}")


def _refused(one: Listed, why: str) -> StoreError:
    return StoreError(f"{one.folder}: {why}")
