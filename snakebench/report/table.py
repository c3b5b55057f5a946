"""Tables of pages. ± is half the 95 % Student-t interval of a mean over seeds; Δ is a numerical difference."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from itertools import product
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from snakebench.names import COARSE, CURRENCIES, EXTENDED, FASTER, FINE, PAPER, STRONGER
from snakebench.report.intervals import comparison_interval, confidence_interval
from snakebench.tables import Columns

# Both currencies of power: P refunds braking as in the paper, P+ is what a battery pays.
POWERS = tuple(CURRENCIES.values())
COSTS = ("cost_of_transport", "positive_cost_of_transport")
MEASURED = ("speed", *POWERS, *COSTS)
CURRENCY_LABELS = {"net": "P", "positive": "P+"}  # in rows of tables and titles of panels
LABELS = {  # heads of columns
    "speed": "v [m/s]",
    "path_speed": "path v [m/s]",
    "power": "P [W]",
    "positive_power": "P+ [W]",
    "cost_of_transport": "CoT",
    "positive_cost_of_transport": "CoT+",
    "swim_frequency": "f [Hz]",
    "tail_amplitude": "tail [m]",
    "joint_amplitude": "joint [rad]",
    "torque_amplitude": "torque [N m]",
    "amplitude": "A [rad]",
    "frequency": "f [Hz]",
    "phase": "ψ [rad]",
    "return": "J",
    "distance": "distance [m]",
    "hypervolume": "hypervolume [m/s W]",
}
METHOD_NAMES = {  # of fixed gaits by their search space or study; policies have their own
    "sea_snake": "sea snake",
    PAPER: "sinusoid",
    FASTER: "faster sinusoid",
    STRONGER: "stronger sinusoid",
    EXTENDED: "wider sinusoid",
    "fourier": "free waveform",
}
PERTURBATION_LABELS = {  # with units
    "angle_noise": "noise of joint angles, ± [rad]",
    "rate_noise": "noise of joint rates, ± [rad/s]",
    "gyro_noise": "noise of the gyro, ± [rad/s]",
    "dropouts": "dropouts of the sensors [1/s]",
    "joint_offset": "joint offsets, ± [rad]",
    "delay": "delay of actions [control steps]",
    "jitter": "jitter of the delay [control steps]",
    "servo_strength": "servo strength [1]",
    "speed_limit": "no-load speed of servos [rad/s]",
    "dead_joint": "dead joint, from the head; 0: none",
    "mass": "masses [1]",
    "cover_stiffness": "cover stiffness [1]",
    "pressure_drag": "tangential pressure drag C_F [1]",
    "viscous_drag": "viscous drag C_μ, C_ν [1]",
    "normal_drag": "normal drag C_D [1]",
    "head_drag": "head's normal drag p_4 [1]",
    "tail_drag": "tail's normal drag p_5 [1]",
    "start": "first joint angles, s.d. [rad]",
}
LONGEST = 1000  # rows of a table whose rows are shown: longer ones are of searches
_DIGITS = {"power": 1, "positive_power": 1, "distance": 1, "return": 1}  # after the point; 3 of others

Cell = Callable[[pd.DataFrame], str]  # what a table shows of the rows of a group
Groups = Sequence[str] | Mapping[str, Iterable[Any]]  # columns to group by, and the order of their values
Label = Callable[..., str]  # a row's name, made of the values that it is grouped by
Column = str | tuple[str, Cell]  # the mean of a column under its label, or a head and a cell


class Table(NamedTuple):
    """A table as it is printed; the first column names the rows."""

    head: list[str]
    rows: list[list[str]]


def name_of(method: str) -> str:
    """The name of a policy or of the fixed gaits of a search space."""
    return METHOD_NAMES.get(method, method).replace("_", " ")


def joined(*labels: object) -> str:
    """The name of a row: a method, where it swims, and so on."""
    return ", ".join(LABELS.get(str(label)) or name_of(str(label)) for label in labels)


def summary(
    frame: pd.DataFrame, by: Groups, columns: Sequence[Column], *, head: str | None = None, label: Label = joined
) -> Table:
    """A table with a row for each group of a frame that has rows; `head` is above the names of the rows."""
    order = by if isinstance(by, Mapping) else {name: frame[name].unique() for name in by}
    cells = [(LABELS.get(column, column), mean(column)) if isinstance(column, str) else column for column in columns]
    parts = dict(iter(frame.groupby(list(order), sort=False)))
    keys = [key for key in product(*order.values()) if key in parts]
    rows = [[label(*key), *(cell(parts[key]) for _, cell in cells)] for key in keys]
    return Table([name_of(", ".join(order)) if head is None else head, *(name for name, _ in cells)], rows)


def chosen(table: pd.DataFrame, where: Mapping[str, Any]) -> tuple[pd.DataFrame, str]:
    """The rows of a table in which columns have these values, and the choice in words."""
    rows = table[(table[list(where)] == pd.Series(where, dtype=object)).all(axis=1)]
    return rows, ", ".join(f"{column} = {value}" for column, value in where.items())


def at(cell: Cell, **where: object) -> Cell:
    """What a cell shows of those rows of a group in which columns have these values."""
    return lambda part: cell(chosen(part, where)[0])


def under_labels(cell: Callable[..., Cell], names: Iterable[str], *options: Any) -> list[tuple[str, Cell]]:
    """A column for each name under its label; options are of the kind of cell."""
    return [(LABELS[name], cell(name, *options)) for name in names]


def size(part: pd.DataFrame) -> str:
    """Number of rows."""
    return str(len(part))


def mean(column: str, digits: int | None = None) -> Cell:
    """The mean ± half its 95 % interval."""
    return lambda part: averaged(part[column], _DIGITS.get(column, 3) if digits is None else digits)


def share(column: str, digits: int = 1) -> Cell:
    """The mean of a share ± half its 95 % interval [%]."""
    return lambda part: averaged(100 * part[column], digits)


def gain(column: str, digits: int = 0) -> Cell:
    """The mean of a relative gain of every `seed` over every `seed_fixed` ± half its 95 % interval over both [%]."""

    def cell(part: pd.DataFrame) -> str:
        gains = 100 * part.pivot(index="seed", columns="seed_fixed", values=column)
        opponents = gains.mean().to_list() if gains.shape[1] > 1 else ()
        return averaged(gains.mean(axis=1, skipna=False), digits, opponents)

    return cell


def change(column: str, digits: int = 1) -> Cell:
    """The mean of a relative change, of the rows where it is known, ± half its 95 % interval [%]."""
    return lambda part: averaged(100 * part[column].dropna(), digits)


def every(column: str, form: str = ".2f") -> Cell:
    """Every value that is known."""
    return lambda part: ", ".join(f"{value:{form}}" for value in part[column].dropna())


def first(column: str, form: str = "") -> Cell:
    """The value that all rows share; a dash where it is not known."""
    return lambda part: "–" if part.empty or pd.isna(value := part[column].iloc[0]) else f"{value:{form}}"


def digits3(column: str) -> Cell:
    """The mean with three digits."""
    return lambda part: number(part[column].mean())


def largest(column: str, form: str = ".2f") -> Cell:
    """The largest value."""
    return lambda part: f"{part[column].max():{form}}"


def yes_or_no(column: str) -> Cell:
    """Whether it is so in all rows."""
    return lambda part: "yes" if part[column].all() else "no"


def interval_of(column: str, form: str = ".3g") -> Cell:
    """The 95 % Student-t interval of the mean."""

    def cell(part: pd.DataFrame) -> str:
        ends = confidence_interval(part[column].dropna().to_numpy())
        return "needs two seeds" if ends is None else f"{ends[0]:{form}} to {ends[1]:{form}}"

    return cell


def over_seeds(column: str, each: str, form: str = ".2f") -> list[Column]:
    """Columns of every seed's value, under a head, of their mean and of its interval."""
    plain_mean = ("mean", lambda part: f"{part[column].mean():{form}}")
    return [(each, every(column, form)), plain_mean, ("95 % interval", interval_of(column, form))]


def by_variant(column: str) -> Cell:
    """The value with the finer step, and Δ to that with the coarser step of the same swim."""

    def cell(part: pd.DataFrame) -> str:
        values = part.groupby("variant")[column].mean()
        return with_difference(values[FINE], values.get(COARSE, np.nan), "step")

    return cell


def number(value: float | None) -> str:
    """A number with three digits; a dash where it is not defined."""
    return "–" if value is None or pd.isna(value) else f"{value:.3g}" if abs(value) < 10 else f"{value:.1f}"


def with_difference(value: Any, other: Any, of: str) -> str:
    """A number, and how far it is from the one that another "step" or "engine" gave."""
    return number(value) + ("" if pd.isna(value - other) else f" (Δ {of} {abs(value - other):.1g})")


def averaged(values: pd.Series, digits: int = 3, opponents: Sequence[float] = ()) -> str:
    """A mean ± half its 95 % interval if there are several seeds; a dash unless every seed has a value.

    `opponents` are means by the seeds of what is compared with, if it has several.
    """
    if not len(values) or values.isna().any():
        return "–"
    return with_interval(float(values.mean()), comparison_interval(values.to_list(), opponents), digits)


def with_interval(center: float, interval: tuple[float, float] | None, digits: int = 3) -> str:
    """A mean ± half its interval, if there is one."""
    half = "" if interval is None else f" ± {(interval[1] - interval[0]) / 2:.{digits}f}"
    return f"{round(center, digits) + 0.0:.{digits}f}{half}"  # no minus before a zero


def failures(swims: pd.DataFrame) -> dict[str, int]:
    """How many swims there are of each status but ok."""
    return {str(status): count for status, count in swims[swims["status"] != "ok"]["status"].value_counts().items()}


def validity(swims: pd.DataFrame) -> dict[str, Any]:
    """How many swims there are, how many have not settled, and how many of each status but ok."""
    return {"n_swims": len(swims), "unsteady": int((~swims["steady"]).sum()), "failed": failures(swims)}


def of_valid(swims: pd.DataFrame) -> pd.DataFrame:
    """Swims whose speeds, powers and costs of transport are NaN unless they are valid."""
    valid = swims["status"] == "ok"
    return swims.assign(**{name: swims[name].where(valid) for name in ("path_speed", *MEASURED) if name in swims})


def plugin_metrics(tables: Mapping[str, pd.DataFrame], declared: Mapping[str, Columns]) -> dict[str, Table]:
    """For each table of swims, but those of searches, means of metrics of plug-ins, which no study declares.

    All swims of a seed are averaged first: of several prices, viscosities or steps, if the table has them.
    """
    found = {}
    for name, table in tables.items():
        if {"status", "return"} <= set(table) and len(table) <= LONGEST:
            columns = [str(column) for column in table]
            by = [label for label in columns[: columns.index("status")] if declared[name].get(label) is str]
            further = table[columns[columns.index("return") + 1 :]].select_dtypes("number")  # after an evaluation's own
            metrics = [str(metric) for metric in further if metric not in declared[name]]
            if metrics and by:
                of_seed = table.groupby([*by, *(["seed"] if "seed" in table else [])], sort=False, dropna=False)
                found[name] = summary(of_seed[metrics].mean().reset_index(), by, metrics)
    return found
