"""The page of the bench: how fast this machine is."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pandas as pd

from snakebench.engines import ENGINES
from snakebench.errors import StoreError
from snakebench.report.figure_axes import panels
from snakebench.report.figure_style import ENGINE_COLORS, svg
from snakebench.report.table import Table
from snakebench.tables import Columns, read_table

COLUMNS: Columns = {
    "workload": str,
    "engine": str,
    "drives": str,
    "physics_rate": int,
    "robots": int,
    "threads": int,
    "steps_per_second": float,
    "simulated": float,
    "control_steps_per_second": float | None,
    "speed_error": float | None,
    "power_error": float | None,
    "times_evaluator": float,
    "times_bare_loop": float,
}
DRIVES = {"torque": "torques", "angle": "target angles"}


def bench_page(directory: Path, manifest: dict[str, Any]) -> dict[str, Any]:
    """Everything the bench page shows.

    Raises:
        StoreError: when the table is missing, damaged or of other engines.
    """
    table = read_table(path := directory / "bench.csv", COLUMNS)
    if not set(table["engine"]) <= set(ENGINES):
        raise StoreError(
            f"cannot use the table {path}: engine must be one of {', '.join(ENGINES)}: run the bench again"
        )
    return {"manifest": manifest, "table": bench_table(table), "figure": _figure(table)}


def bench_table(table: pd.DataFrame) -> Table:
    """The bench, one row a workload."""
    shown = {"workload": table["workload"] + ", " + table["engine"], "commands": table["drives"].map(DRIVES)}
    shown |= {head: table[name].map(form) for name, (head, form) in _COLUMNS.items()}
    return Table(list(shown), pd.DataFrame(shown).to_numpy().tolist())


def percent(share: float) -> str:
    """A share with two digits."""
    if pd.isna(share):
        return "–"
    if 0 < abs(share) < 1e-6:
        return "< 0.0001\u00a0%"
    return f"{100 * share:.2g}\u00a0%" if abs(share) < 0.1 else f"{100 * share:.0f}\u00a0%"


def _grouped(number: float) -> str:
    return "" if pd.isna(number) else f"{number:,.0f}".replace(",", " ")


_COLUMNS: dict[str, tuple[str, Callable[[Any], str]]] = {  # head and form of numbers
    "physics_rate": ("Hz", str),
    "robots": ("robots", str),
    "threads": ("threads", str),
    "steps_per_second": ("steps/s", _grouped),
    "simulated": ("sim. s/s", _grouped),
    "control_steps_per_second": ("control/s", _grouped),
    "times_evaluator": ("× evaluator", "{:.1f}".format),
    "times_bare_loop": ("× bare", "{:.2f}".format),
    "speed_error": ("v error", percent),
    "power_error": ("P error", percent),
}


def _figure(table: pd.DataFrame) -> str:
    """Simulated seconds per second of every workload."""
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
