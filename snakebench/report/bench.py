"""The page of the bench: how fast this machine is."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pandas as pd

from snakebench.engines import ENGINES
from snakebench.errors import StoreError
from snakebench.report.figure_axes import panels
from snakebench.report.figure_style import ENGINE_COLORS, svg
from snakebench.report.table import Table
from snakebench.tables import read_table

DRIVES = {"torque": "torques", "angle": "target angles"}


def percent(share: float) -> str:
    """A share with two digits."""
    if pd.isna(share):
        return "–"
    if 0 < abs(share) < 1e-6:
        return "< 0.0001\u00a0%"
    return f"{100 * share:.2g}\u00a0%" if abs(share) < 0.1 else f"{100 * share:.0f}\u00a0%"


def _grouped(number: float) -> str:
    return "" if pd.isna(number) else f"{number:,.0f}".replace(",", " ")


_NUMBERS: dict[str, tuple[Any, str, Callable[[Any], str]]] = {  # type, head and form
    "physics_rate": (int, "Hz", str),
    "robots": (int, "robots", str),
    "threads": (int, "threads", str),
    "steps_per_second": (float, "steps/s", _grouped),
    "simulated": (float, "sim. s/s", _grouped),
    "control_steps_per_second": (float | None, "control/s", _grouped),
    "times_evaluator": (float, "× evaluator", "{:.1f}".format),
    "times_bare_loop": (float, "× bare", "{:.2f}".format),
    "speed_error": (float | None, "v error", percent),
    "power_error": (float | None, "P error", percent),
}


def bench_page(directory: Path) -> dict[str, Any]:
    """Everything the bench page shows; errors as `bench_table`."""
    table = _read(directory)
    return {"table": _shown(table), "figure": _figure(table)}


def bench_table(directory: Path) -> Table:
    """The speed of every workload; a StoreError if the table is missing, damaged or of other engines."""
    return _shown(_read(directory))


def _shown(table: pd.DataFrame) -> Table:
    shown = {"workload": table["workload"] + ", " + table["engine"], "commands": table["drives"].map(DRIVES)}
    shown |= {head: table[name].map(form) for name, (_, head, form) in _NUMBERS.items()}
    return Table(list(shown), pd.DataFrame(shown).to_numpy().tolist())


def _read(directory: Path) -> pd.DataFrame:
    columns = dict.fromkeys(("workload", "engine", "drives"), str) | {name: kind[0] for name, kind in _NUMBERS.items()}
    table = read_table(path := directory / "bench.csv", columns)
    if not set(table["engine"]) <= set(ENGINES):
        known = ", ".join(ENGINES)
        raise StoreError(f"cannot use the table {path}: engine must be one of {known}: run the bench again")
    return table


def _figure(table: pd.DataFrame) -> str:
    shown = table[table["workload"] != "bare loop"].reset_index()
    robots = shown["robots"].map(lambda n: f"{n} robot{'s' if n > 1 else ''}")
    threads = shown["threads"].map(lambda n: f", {n} threads" if n > 1 else "")
    label = shown["engine"] + ", " + robots + ", " + shown["physics_rate"].astype(str) + " Hz" + threads
    drives, labels = list(shown["drives"].unique()), list(label.unique())
    shared = {"x": "simulated seconds per second", "sharex": True, "sharey": True}
    fig, axes = panels(1, len(drives), 4.7, 1 + 0.3 * len(labels), titles=drives, **shared)
    for ax, name in zip(axes[0], drives, strict=True):
        part = shown[shown["drives"] == name]
        places = [labels.index(words) for words in label[part.index]]
        bars = ax.barh(places, part["simulated"], color=part["engine"].map(ENGINE_COLORS))
        ax.bar_label(bars, fmt="{:.0f}", padding=3, fontsize=8)
        ax.set(xscale="log", xlim=(20, 2 * shown["simulated"].max()))
        ax.grid(visible=False, axis="y")
    ax.set(yticks=range(len(labels)), yticklabels=labels)
    ax.invert_yaxis()
    return svg(fig, "Simulated seconds per second of every workload")
