"""Figures of the index page."""

import pandas as pd
from matplotlib.axes import Axes

from snakebench.comparison.gain_ledger import STEPS, VIEWS
from snakebench.report.figure_axes import panels
from snakebench.report.figure_style import method_look, svg


def waterfall(ledger: pd.DataFrame) -> str:
    """The gain ledger: one row of panels a view, one panel a place, one bar a step; whiskers are 95 % intervals."""
    views, places = list(ledger["view"].unique()), list(ledger["place"].unique())
    width, height = 10.8 / len(places), 2.3 + 0.6 / len(views)
    labels = {"titles": places, "x": "speed v [m/s]", "y": [VIEWS[view] for view in views]}
    fig, axes = panels(len(views), len(places), width, height, sharex="col", sharey=True, **labels)
    for (view, place), account in ledger.groupby(["view", "place"], sort=False):
        _draw_steps(axes[views.index(view)][places.index(place)], account)
    return svg(fig, "Gain ledger: what makes the student faster, step by step")


def _draw_steps(ax: Axes, account: pd.DataFrame) -> None:
    """The first step as a bar from zero, the others as bars from the speed before to their own."""
    steps = account.assign(start=account["speed"].shift(fill_value=0.0)).to_dict("records")
    for k, step in enumerate(steps):
        id, speed, start, low, high = (step[name] for name in ("step", "speed", "start", "low", "high"))
        ax.barh(k, speed - start, left=start, color=method_look(id).color, height=0.7)
        if k:
            ax.plot([start, start], [k - 1.35, k + 0.35], color="#5b6875", lw=0.6, label="_from the step before")
        if high > low:
            ends = [max(start + low, 0.0), start + high]
            ax.plot(ends, [k, k], color="#111111", lw=1, label=f"_interval, {id}")
        ax.text(0.99, k, f"{speed:.3f}", va="center", ha="right", fontsize=8, transform=ax.get_yaxis_transform())
    ax.set(yticks=range(len(account)), yticklabels=account["step"].map(STEPS))
    ax.set_xlim(0, max(ax.get_xlim()[1], 1.35 * account["speed"].max()))
    ax.set_ylim(len(account) - 0.5, -0.5)
    ax.grid(visible=False, axis="y")
