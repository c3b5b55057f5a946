"""`sb.score`: the score of a controller in the tasks of a version."""

import tempfile
from collections.abc import Iterable, Mapping, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import NamedTuple

import numpy as np

from snakebench.channel import perturbed
from snakebench.errors import InvalidValue, UnknownName
from snakebench.execution import Case, Evaluator, compile_engine, physics_fingerprint
from snakebench.manifest import provenance
from snakebench.names import CURRENCIES
from snakebench.progress import Work
from snakebench.scoring.entry import Entry, Setting, entry_of, read_entry
from snakebench.scoring.measurement import scored_swim
from snakebench.scoring.result import Score, summary, totals
from snakebench.scoring.swims import Swim, scored
from snakebench.scoring.tasks import DEV, TASKS, VERSION, Draw, Tasks, draws, load_tasks
from snakebench.scoring.yardstick import Yardstick
from snakebench.simulation import AnyController
from snakebench.store import EvaluationCache
from snakebench.workers import open_workers, usable_cores

_SECONDS = 1.0  # that a swim takes, about [s]


class Planned(NamedTuple):
    """A swim of an entry at a setting."""

    draw: Draw
    setting: Setting
    case: Case
    start: float  # from which it is measured [s]

    @property
    def label(self) -> tuple[object, ...]:
        """As that of its swim."""
        return self.draw.task, self.draw.where, self.draw.perturbation, self.draw.value, self.setting.label


def score(
    controller: AnyController | Path | str,
    *,
    tasks: Iterable[str] | str = TASKS,
    seed: str | None = None,
    quick: bool = False,
    workers: int | None = None,
    cache: Path | str | None = None,
    trust: bool = False,
    progress: bool = False,
    executor: str = "processes",
    scheduler: str | None = None,
) -> Score:
    """The score of a controller: how near it comes to the limit of the body, from 0 to about 1.

    Args:
        controller: a gait, a policy or a `Predictor`, or the path of an entry's file.
        tasks: names of tasks; the total is known of all four only.
        seed: "dev" draws the same swims for every entry, for development; by default its own, from a hash of the file.
        quick: swim in the planar engine: a first impression.
        workers: how many processes; by default one per core.
        cache: directory of results in which swims are remembered; by default none is.
        trust: load an archive of Stable-Baselines3, which may run code.
        progress: show it on standard error.
        executor: "processes" of this machine, or a "dask" cluster.
        scheduler: address of a running Dask cluster's scheduler.

    Raises:
        InvalidValue: when the file or the controller cannot be scored.
        StoreError: when the cache cannot be used.
        WorkersLost: when workers are lost.

    Example:
        >>> sb.score(sb.SeaSnake(amplitude=0.9, frequency=0.6, phase=0.7), tasks="known", quick=True).scores["known"]
    """
    entry = read_entry(Path(controller), trust) if isinstance(controller, Path | str) else entry_of(controller)
    names = [tasks] if isinstance(tasks, str) else list(tasks)
    if not names:
        raise InvalidValue(f"tasks is empty: some of {', '.join(TASKS)} are needed")
    for name in names:
        if name not in TASKS:
            raise UnknownName.among("task", name, TASKS)
    if seed not in (None, DEV):
        raise UnknownName.among("seed", str(seed), [DEV])
    asked = [name for name in entry.tasks if name in names]
    if not asked or (len(asked) < len(set(names)) < len(TASKS)):
        raise InvalidValue(f"{entry.name} has no gait for all fluids: of the tasks, it can swim known only")
    frozen = load_tasks(VERSION)
    plans = planned(frozen, entry, seed or entry.digest, asked, quick)
    swims = at_powers(frozen, swum(frozen, plans, workers, cache, progress, executor, scheduler))
    return scored_entry(frozen, entry, seed or entry.digest, quick, asked, swims)


def planned(tasks: Tasks, entry: Entry, seed: str, names: Sequence[str], quick: bool) -> list[Planned]:
    """All swims of an entry: in `known` at all its settings for a fluid, else at its own."""
    found, own = list[Planned](), entry.own()
    for draw in draws(tasks, seed, tuple(names)):
        start = 0.0 if draw.task == "changing" else tasks.start
        settings = entry.told(draw.where) if draw.task == "known" else [own] if own else []
        if not settings:
            raise InvalidValue(f"{entry.name} has no gait for {draw.where}, and none for all fluids")
        for setting in settings:
            scenario = tasks.scenario(draw.fluid, setting.controller.drives, quick).but(control_rate=entry.control_rate)
            case = Case(*perturbed(setting.controller, scenario, draw.perturbations()))
            found.append(Planned(draw, setting, case, start))
    return found


def swum(
    tasks: Tasks,
    plans: Sequence[Planned],
    workers: int | None = None,
    cache: Path | str | None = None,
    progress: bool = False,
    executor: str = "processes",
    scheduler: str | None = None,
) -> list[Swim]:
    """The scored swims of an entry, in several processes; arguments and errors as those of `score`."""
    count = min(usable_cores(), len(plans)) if workers is None else workers
    with ExitStack() as stack:
        crew = stack.enter_context(open_workers(count, executor, scheduler))
        place = Path(cache) if cache else Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="snakebench-")))
        work = stack.enter_context(Work("score", len(plans), silent=not progress))
        work.begin(_SECONDS * len(plans) / crew.n_jobs)
        compile_engine(plans[0].case.scenario.engine, work.say)
        evaluator = Evaluator(stack.enter_context(EvaluationCache(place, work.say)), crew, work)
        measured = evaluator.measured(scored_swim, [(plan.case, (plan.start,)) for plan in plans])
    yardsticks = {
        wide: {currency: Yardstick(tasks, currency, wide) for currency in CURRENCIES}
        for wide in {one.setting.wide for one in plans}
    }
    pairs = zip(plans, measured, strict=True)
    return [
        scored(tasks, one.draw, found, yardsticks[one.setting.wide], setting=one.setting.label) for one, found in pairs
    ]


def scored_entry(
    tasks: Tasks, entry: Entry, seed: str, quick: bool, names: Iterable[str], swims: Sequence[Swim]
) -> Score:
    """The score of an entry from its swims."""
    scores = summary(names, swims)
    parts = [scores[name] for name in TASKS if name in scores and scores[name].score is not None]
    engine, origin = "planar" if quick else "pybullet", provenance()
    return Score(
        tasks=tasks.version,
        content=tasks.content,
        name=entry.name,
        entry=entry.digest,
        information=entry.information,
        seed=seed,
        engine=engine,
        physics=physics_fingerprint(engine),
        **totals(parts),
        scores=scores,
        swims=tuple(swims),
        versions=origin["versions"],
        commit=origin["commit"],
    )


def at_powers(tasks: Tasks, swims: Sequence[Swim]) -> list[Swim]:
    """The swims, of which in `known` the one nearest to each power stays where an entry has several settings."""
    known: Mapping[str, list[Swim]] = {name: [] for name in tasks.fluids}
    for swim in swims:
        if swim.task == "known":
            known[swim.where].append(swim)
    chosen = [one for own in known.values() for one in (_nearest(tasks, own) if len(own) > 1 else own)]
    return [*chosen, *(swim for swim in swims if swim.task != "known")]


def _nearest(tasks: Tasks, swims: Sequence[Swim]) -> list[Swim]:
    """Of each power the valid swim whose P+ has the nearest logarithm; any if none is valid."""
    valid = [swim for swim in swims if swim.status == "ok"] or swims[:1]
    powers = np.array([swim.positive_power or np.inf for swim in valid])
    return [valid[int(np.argmin(np.abs(np.log(powers / target))))].but(target=target) for target in tasks.known.powers]
