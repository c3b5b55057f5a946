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
_CLOSE = 1e-2  # largest relative difference of speeds and powers


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
    chosen = plans if swims is None else random.sample(plans, min(swims, len(plans)))
    again = swum(tasks, chosen, workers) if chosen else []
    for new in again:
        for old in score.swims:
            if old.label == new.label:
                _compare(one, old, new)
    _check_nearest(one, at_powers(tasks, list({swim.label: swim for swim in [*again, *score.swims]}.values())))


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
    possible = {swim.label for swim in one.score.swims} <= {plan.label for plan in plans}
    known = [swim for swim in one.score.swims if swim.task == "known"]
    targets = {name: tasks.known.powers if len(entry.told(name)) > 1 else (None,) for name in tasks.fluids}
    complete = [(swim.where, swim.target) for swim in known] == [
        (name, target) for name, powers in targets.items() for target in powers
    ]
    with np.errstate(over="ignore"):  # of absurd scores: their interval is infinite, and not the one that is stated
        scores = summary(entry.tasks, one.score.swims)
    total = totals([part for part in scores.values() if part.score is not None])
    told = {name: getattr(one.score, name) for name in total}
    if found != wanted or not possible or not complete or (scores, total) != (one.score.scores, told):
        raise _refused(one, "its swims are not those of its file, or its score is not their mean: score it again")


def _compare(one: Listed, old: Swim, new: Swim) -> None:
    where = " ".join(filter(None, (old.task, old.where, old.perturbation)))
    if max(abs(old.score - new.score), abs(old.net_score - new.net_score)) > _SAME:
        raise _refused(one, f"{where} has the score {old.score:.4f}, and scored again {new.score:.4f}")
    for name in ("status", "speed", "power", "positive_power", "limit"):
        told, found = getattr(old, name), getattr(new, name)
        numbers = isinstance(told, float) and isinstance(found, float)
        if not (abs(told - found) <= _CLOSE * abs(found) + _SAME if numbers else told == found):
            raise _refused(one, f"{where} has {name} = {told}, and scored again {found}")


def _check_nearest(one: Listed, nearest: Sequence[Swim]) -> None:
    """Make sure that of several settings those are listed that come nearest to the powers."""
    listed = {(swim.where, swim.target): swim for swim in one.score.swims if swim.task == "known"}
    for swim in nearest:
        if swim.target is not None and (told := listed[swim.where, swim.target]).label != swim.label:
            what = f"{swim.setting} comes nearer to {swim.target:g} W in {swim.where} than {told.setting}"
            raise _refused(one, f"{what}: score it again")


def _refused(one: Listed, why: str) -> StoreError:
    return StoreError(f"{one.folder}: {why}")
