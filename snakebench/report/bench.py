"""The page of the bench: how fast this machine is."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pandas as pd
import seaborn as sns

from snakebench.report.figure_style import ENGINE_COLORS, drawing, svg
from snakebench.report.table import Table
from snakebench.tables import read_table

DRIVES = {"torque": "torques", "angle": "target angles"}


def bench_page(directory: Path, manifest: dict[str, Any]) -> dict[str, Any]:
    """Everything the bench page shows."""
    table = read_table(directory / "bench.csv")
    return {"manifest": manifest, "table": bench_table(table), "figure": _figure(table)}


def bench_table(table: pd.DataFrame) -> Table:
    """The bench, one row a workload."""
    rows = [
        [
            f"{row['workload']}, {row['engine']}",
            DRIVES[row["drives"]],
            f"{row['physics_rate']}",
            f"{row['robots']}",
            f"{row['threads']}",
            _grouped(row["steps_per_second"]),
            _grouped(row["simulated"]),
            _grouped(row["control_steps_per_second"]),
            f"{row['times_evaluator']:.1f}",
            f"{row['times_bare_loop']:.2f}",
            percent(row["speed_error"]),
            percent(row["power_error"]),
        ]
        for row in table.to_dict("records")
    ]
    head = ["workload", "commands", "Hz", "robots", "threads", "steps/s", "sim. s/s", "control/s"]
    return Table([*head, "× evaluator", "× bare", "v error", "P error"], rows)


def percent(share: float) -> str:
    """A share with two digits."""
    if pd.isna(share):
        return "–"
    if 0 < abs(share) < 1e-6:
        return "< 0.0001\u00a0%"
    return f"{100 * share:.2g}\u00a0%" if abs(share) < 0.1 else f"{100 * share:.0f}\u00a0%"


def _grouped(number: float) -> str:
    return "" if pd.isna(number) else f"{number:,.0f}".replace(",", " ")


def _figure(table: pd.DataFrame) -> str:
    """Simulated seconds per second of every workload."""
    shown = table[table["workload"] != "bare loop"]
    labels = [
        f"{row['engine']}, {row['robots']} robot{'s' if row['robots'] > 1 else ''}, {row['physics_rate']} Hz"
        + (f", {row['threads']} threads" if row["threads"] > 1 else "")
        for row in shown.to_dict("records")
    ]
    with drawing():
        grid = sns.catplot(
            shown.assign(label=labels),
            x="simulated",
            y="label",
            col="drives",
            hue="engine",
            palette=ENGINE_COLORS,
            kind="bar",
            legend=False,
            height=3.2,
            aspect=1.45,
        )
    grid.set(xscale="log", xlim=(20, None))
    grid.set_titles("{col_name}")
    grid.set_axis_labels("simulated seconds per second", "")
    for ax in grid.axes.flat:
        for bars in ax.containers:
            ax.bar_label(bars, fmt="{:.0f}", padding=3, fontsize=8)
    return svg(grid.figure, "Simulated seconds per second of every workload")
