"""Figures of the adaptation study."""

from collections.abc import Mapping, Sequence

import numpy as np
import pandas as pd

from snakebench.names import ADAPTIVE, CURRENCIES
from snakebench.report.figure_axes import legend_below, panels
from snakebench.report.figure_style import method_look, palette, svg
from snakebench.report.seed_figure import draw_seeds
from snakebench.report.table import LABELS, name_of
from snakebench.studies.adaptation.controls import single_curve, single_gaits

_PLACES = 240  # along x, where the seeds of a policy are averaged


def course(name: str, along: str, traces: pd.DataFrame, policies: Sequence[str], gaits: Mapping[str, str]) -> str:
    """Viscosity, speed and powers along the "time" or "x" of a course, of policies and of fixed gaits with labels."""
    shown = ["speed", "power", "positive_power"]
    rows, ratios = 1 + len(shown), [1, *(2 for _ in shown)]
    labels = {"x": "t [s]" if along == "time" else "x [m]", "y": ["ν [m²/s]", *map(LABELS.__getitem__, shown)]}
    height = (1.6 + 2.4 * len(shown)) / rows
    fig, axes = panels(rows, 1, 10.0, height, sharex=True, height_ratios=ratios, **labels)
    fluid, *others = axes[:, 0]
    furthest = traces.iloc[traces[along].argmax()]
    track = traces[(traces["method"] == furthest["method"]) & (traces["seed"] == furthest["seed"])].sort_values(along)
    fluid.plot(track[along], track["viscosity"], color="#444444")
    fluid.fill_between(track[along], track["viscosity"].min(), track["viscosity"], color="#8a949e", alpha=0.3, lw=0)
    fluid.set_yscale("log")
    colors, lines = palette(policies, "Set2"), traces if along == "time" else _at_equal_places(traces, shown)
    for ax, column in zip(others, shown, strict=True):
        for method, color in colors.items():
            draw_seeds(ax, lines[lines["method"] == method], along, column, method, color)
        for method, label in gaits.items():
            for _, line in lines[lines["method"] == method].groupby("seed"):
                ax.plot(line[along], line[column], color=method_look(label).color, lw=1.1, label=label)
    legend_below(fig, columns=3)
    return svg(fig, f"Viscosity, speed and powers through the course {name}")


def _at_equal_places(traces: pd.DataFrame, columns: Sequence[str]) -> pd.DataFrame:
    """Columns of traces at places along x that are the same for all seeds of a method."""
    parts = []
    for method, swims in traces.groupby("method"):
        x = np.linspace(swims["x"].min(), swims["x"].max(), _PLACES)
        for seed, swim in swims.groupby("seed"):
            way = np.maximum.accumulate(swim["x"])
            values = {name: np.interp(x, way, swim[name], left=np.nan, right=np.nan) for name in columns}
            parts.append(pd.DataFrame({"method": method, "seed": seed, "x": x, **values}))
    return pd.concat(parts)


def at_equal_power(swims: pd.DataFrame, ideal: pd.DataFrame, policies: Sequence[str]) -> str:
    """Distance over mean power, P and P+, on each course: single gaits, policies, and the limit's ideal switching.

    A point of a policy is the mean over its seeds at one preference; a line joins the corners of single gaits.
    """
    courses = list(swims["course"].unique())
    fig, axes = panels(len(CURRENCIES), len(courses), 3.6, 3.0, titles=courses, y="distance [m]")
    singles, learned = single_gaits(swims), swims[swims["tuned_to"] == ADAPTIVE]
    means = learned.groupby(["course", "method"], sort=False)[["distance", *CURRENCIES.values()]].mean().reset_index()
    for row, (currency, column) in zip(axes, CURRENCIES.items(), strict=True):
        for ax, name in zip(row, courses, strict=True):
            curve = ideal[(ideal["course"] == name) & (ideal["currency"] == currency)]
            if len(curve):
                ax.plot(curve["power"], curve["distance"], color="#111111", label="limit, ideal switching")
            for method, part in singles[singles["course"] == name].groupby("method", sort=False):
                look, line = method_look(name_of(method)), single_curve(part, column)
                label = f"single {name_of(method)}"
                ax.plot(*line.T, color=look.color, lw=1, marker=look.marker, ms=4, label=label)
            here = means[means["course"] == name]
            for method, color in palette(policies, "Set2").items():
                own = here[here["method"] == method]
                ax.plot(own[column], own["distance"], "o", color=color, ms=6, label=name_of(method))
            rest = here[~here["method"].isin(policies)].sort_values(column)
            for policy, own in rest.groupby(rest["method"].str.replace(r"_[^_]+_W$", "", regex=True)):
                look, label = method_look(policy), f"{name_of(policy)}, any preference"
                ax.plot(
                    own[column], own["distance"], "--", color=look.color, marker=look.marker, ms=4, lw=1, label=label
                )
            ax.set(xlabel=LABELS[column], xlim=(0, 1.15 * means[column].max() if means[column].notna().any() else None))
    legend_below(fig, columns=3)
    return svg(fig, "Distance over mean power on each course")
