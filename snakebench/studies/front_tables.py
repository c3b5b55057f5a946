"""Tables of fronts on pages: what each is worth, and its speeds at equal power."""

import pandas as pd

from snakebench.names import CURRENCIES
from snakebench.report.table import CURRENCY_LABELS, Cell, Column, Table, first, name_of, number, summary
from snakebench.studies.published_fronts import powers_compared

FRONT = ["space", "front", "currency"]
NAMED_POINTS = {"fastest": "fastest", "knee": "knee", "thriftiest": "lowest CoT"}


def front_table(indicators: pd.DataFrame) -> Table:
    """The points, hypervolume and named points of each front."""
    worth = indicators.assign(difference=(indicators["hypervolume"] - indicators["hypervolume_searched"]).abs())
    columns: list[Column] = [("points", first("points")), ("beyond", first("beyond"))]
    columns += [("hypervolume", first("hypervolume", ".2f")), ("Δ engine", first("difference", ".2f"))]
    columns += [(label, _named_point(key)) for key, label in NAMED_POINTS.items()]
    return summary(worth, FRONT, columns, head="front", label=front_label)


def equal_power_table(indicators: pd.DataFrame) -> Table:
    """The speed of each front at each power."""
    return summary(indicators, FRONT, speeds_at_powers(indicators), head="front", label=front_label)


def front_label(space: str, front: str, currency: str) -> str:
    """The name of a front in a table: P is the power of those that are of net power."""
    return f"{name_of(space)}, {front}" + ("" if currency == "net" else f", {CURRENCY_LABELS[currency]}")


def _named_point(key: str) -> Cell:
    """Speed and both powers of a named point; a front that lies beyond the reference has no knee."""

    def cell(part: pd.DataFrame) -> str:
        speed, *powers = part[[f"{key}_{name}" for name in ("speed", "power", "positive_power")]].iloc[0]
        return "–" if pd.isna(speed) else f"{speed:.3f} at {' / '.join(map(number, powers))}"

    return cell


def speeds_at_powers(indicators: pd.DataFrame) -> list[Column]:
    """Columns of the speed of a front at each power: a dash beyond its fastest point, which is the last column."""
    powers = powers_compared(indicators)
    return [*((f"{power:g} W", first(column, ".3f")) for power, column in powers.items()), ("fastest", _fastest)]


def _fastest(part: pd.DataFrame) -> str:
    row = part.iloc[0]
    return f"{row['fastest_speed']:.3f} at {number(row['fastest_' + CURRENCIES[row['currency']]])} W"
