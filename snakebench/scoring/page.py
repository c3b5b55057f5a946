"""Pages of a score, which show where it loses, and of the leaderboard."""

from collections import Counter
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path

import numpy as np

from snakebench.files import writable_directory, write_file
from snakebench.fluid import Fluid, FluidField
from snakebench.physics.body import viscosity_at
from snakebench.report.table import PERTURBATION_LABELS, Table
from snakebench.scoring import figures
from snakebench.scoring.leaderboard import TOTAL, Listed, place, value_in
from snakebench.scoring.result import Score
from snakebench.scoring.swims import Swim
from snakebench.scoring.tasks import DEV, TASKS, VERSION, Draw, draws, load_tasks
from snakebench.scoring.yardstick import Yardstick
from snakebench.site import rendered
from snakebench.value import FloatArray

_LOWEST = 12  # swims that are listed
# What a controller has, and folders of entries that differ in it above all.
_PARTS = (
    ("feedback: gaits by an estimate of the fluid, instead of one waveform", "gain_schedule", "free_waveform"),
    ("a free waveform, instead of a sinusoid", "free_waveform", "wider_sinusoid"),
    ("privileged learning: a teacher, instead of sensors alone", "student", "symmetric"),
    ("privileged information in use: viscosity and velocity", "teacher", "student"),
    ("an LSTM that imitates a teacher, instead of RMA with 50 control steps", "student", "rma"),
    ("imitation of a teacher, instead of a search", "student", "evolution_strategy"),
    ("imitation of the limit's gaits, instead of a reward", "imitator", "preference_student"),
    ("training on perturbed robots", "robust_student", "student"),
    ("gaits of the limit, instead of learned ones", "gain_schedule", "student"),
    ("a network, instead of a tuned pattern generator", "evolution_strategy", "feedback_cpg"),
)


def score_table(score: Score, entries: Sequence[Listed]) -> Table:
    """A row for each task and for the total, with its place among the entries of the leaderboard."""
    rows = []
    for name in (*(name for name in TASKS if name in score.scores), TOTAL):
        part = score.scores.get(name)
        net, half, count = (
            (part.net_score, part.half_width, part.swims)
            if part
            else (score.net_total, score.half_width, len(score.swims))
        )
        found = place(score, name, entries)
        shown = [number(value_in(score, name)), number(half), "–" if found is None else str(found), number(net)]
        rows.append([name, *shown, str(count)])
    return Table(["task", "score", "±", "place", "score at P", "swims"], rows)


def leaderboard_table(entries: Sequence[Listed]) -> Table:
    """A row for each entry."""
    rows = []
    for one in entries:
        found = place(one.score, TOTAL, entries)
        values = [number(value_in(one.score, name)) for name in (TOTAL, *TASKS)]
        if one.score.half_width is not None:
            values[0] += f" ± {number(one.score.half_width)}"
        steps = f"{one.card.training_steps:.3g}" if one.card.training_steps else "–"
        columns = ["–" if found is None else str(found), one.card.information, *values, number(one.score.net_total)]
        rows.append([one.card.name, *columns, steps])
    return Table(["entry", "place", "information", TOTAL, *TASKS, "total at P", "training steps"], rows)


def score_page(score: Score, entries: Sequence[Listed] = ()) -> str:
    """The page of a score, under the name of its entry if it is one of these, else under that of its file."""
    name = next((one.card.name for one in entries if one.score.entry == score.entry), score.name)
    tasks = load_tasks(score.tasks)
    places = {(draw.task, draw.where): draw for draw in draws(tasks, score.seed)}
    by_task = {name: [swim for swim in score.swims if swim.task == name] for name in TASKS}
    viscosity = [_viscosity(places[swim.task, swim.where]) for swim in by_task["unknown"]]
    pictures: dict[str, Callable[[Sequence[Swim]], str | None]] = {
        "known": figures.over_power,
        "unknown": partial(figures.over_viscosity, viscosity),
        "changing": lambda swims: figures.along_courses(_courses(score, places, swims)),
        "robust": partial(figures.over_perturbations, PERTURBATION_LABELS),
    }
    drawn = {name: draw(by_task[name]) for name, draw in pictures.items() if by_task[name]}
    content = {
        "name": name,
        "score": score,
        "table": score_table(score, entries),
        "pictures": {name: picture for name, picture in drawn.items() if picture},
        "lowest": _lowest(score.swims),
        "made_by": "snakebench score",
    }
    return rendered("scoring/score.html", content)


def leaderboard_page(entries: Sequence[Listed]) -> str:
    """The page of the leaderboard."""
    ranked = [one for one in entries if one.ranked]
    drawn = {
        one.card.name: np.array([swim.score for swim in one.score.swims if swim.task != "known"]) for one in ranked
    }
    steps = {one.card.name: (one.card.training_steps, one.score.total or 0.0) for one in ranked}
    tasks = load_tasks(VERSION)
    content = {
        "tasks": tasks,
        "swims": Counter(draw.task for draw in draws(tasks, DEV)),
        "entries": entries,
        "table": leaderboard_table(entries),
        "worth": worth_table(entries),
        "profiles": figures.profiles(drawn) if drawn else None,
        "steps": figures.over_training(steps) if steps else None,
        "made_by": "snakebench leaderboard",
    }
    return rendered("scoring/leaderboard.html", content)


def write_leaderboard(entries: Sequence[Listed], reports: Path) -> Path:
    """Write the page of the leaderboard to a directory, and return its path."""
    path = writable_directory(reports) / "leaderboard.html"
    write_file(path, leaderboard_page(entries))
    return path


def worth_table(entries: Sequence[Listed]) -> Table:
    """What parts of a controller are worth: differences of the scores of two entries, as far as both are there."""
    listed = {entry.folder.name: entry for entry in entries}
    rows = []
    for part, *pair in _PARTS:
        if set(pair) <= listed.keys():
            one, other = (listed[folder] for folder in pair)
            cells = []
            for task in TASKS[1:]:
                more, less = value_in(one.score, task), value_in(other.score, task)
                cells.append("–" if more is None or less is None else f"{more - less:+.3f}")
            rows.append([part, f"{one.card.name} − {other.card.name}", *cells])
    return Table(["part", "compared", *TASKS[1:]], rows)


def number(value: float | None) -> str:
    """A score with three digits after the point; a dash where there is none."""
    return "–" if value is None else f"{value:.3f}"


def _viscosity(draw: Draw) -> float:
    if not isinstance(draw.fluid, Fluid):
        raise TypeError(draw)
    return draw.fluid.kinematic_viscosity


def _courses(
    score: Score, places: dict[tuple[str, str], Draw], swims: Sequence[Swim]
) -> dict[str, tuple[FloatArray, FloatArray, float]]:
    """Of each course that was swum: times [s], viscosities [m²/s] and speeds over the limit's, and the score."""
    yardstick, found = Yardstick(load_tasks(score.tasks), "positive"), {}
    for swim in swims:
        field = places[swim.task, swim.where].fluid
        if swim.places and swim.positive_power and isinstance(field, FluidField):
            x = np.array(swim.places)
            time = np.arange(1, len(x) - 1, dtype=float)
            viscosity = np.array([viscosity_at(field, t, float(x[int(t)])) for t in time])
            ratio = (x[2:] - x[:-2]) / 2 / yardstick.along(viscosity, swim.positive_power)
            found[f"{swim.where}: {swim.score:.2f}"] = time, np.array([viscosity, ratio]), swim.score
    return found


def _lowest(swims: Sequence[Swim]) -> Table:
    rows = []
    for swim in sorted(swims, key=lambda swim: swim.score)[:_LOWEST]:
        asked = f"for {swim.target:g} W: {swim.setting}" if swim.target else swim.setting or "–"
        what = f"{PERTURBATION_LABELS[swim.perturbation]}: {swim.value:.3g}" if swim.perturbation else asked
        numbers = [number(swim.score), number(swim.speed), number(swim.limit)]
        power = "–" if swim.positive_power is None else f"{swim.positive_power:.1f}"
        course = "–" if swim.course is None else f"{swim.course:.0f}"
        rows.append([f"{swim.task}, {swim.where}", what, swim.status, *numbers, power, course])
    return Table(["swim", "with", "status", "score", "v [m/s]", "limit [m/s]", "P+ [W]", "course [°]"], rows)
