"""Figures of the index page."""

from __future__ import annotations

from collections.abc import Sequence

from matplotlib.axes import Axes

from snakebench.comparison.gain_ledger import STEPS, VIEWS, Account
from snakebench.report.figure_axes import panels
from snakebench.report.figure_style import method_look, svg


def waterfall(accounts: Sequence[Account]) -> str:
    """The gain ledger: one row of panels a view, one panel a place, one bar a step; whiskers are 95 % intervals."""
    views = list(dict.fromkeys(account.view for account in accounts))
    places = list(dict.fromkeys(account.place for account in accounts))
    width, height = 10.8 / len(places), 2.3 + 0.6 / len(views)
    labels = {"titles": places, "x": "speed v [m/s]", "y": [VIEWS[view] for view in views]}
    fig, axes = panels(len(views), len(places), width, height, sharex="col", sharey=True, **labels)
    for account in accounts:
        _draw_steps(axes[views.index(account.view)][places.index(account.place)], account)
    return svg(fig, "Gain ledger: what makes the student faster, step by step")


def _draw_steps(ax: Axes, account: Account) -> None:
    """The first step as a bar from zero, the others as bars from the speed before to their own."""
    speeds = [step.speed.mean for step in account.steps]
    whiskers = [(0.0, 0.0), *((low, high) for _, low, high in account.changes())]
    for k, (step, (low, high)) in enumerate(zip(account.steps, whiskers, strict=True)):
        start = speeds[k - 1] if k else 0.0
        ax.barh(k, speeds[k] - start, left=start, color=method_look(step.id).color, height=0.7)
        if k:
            ax.plot([start, start], [k - 1.35, k + 0.35], color="#5b6875", lw=0.6, label="_from the step before")
        if high > low:
            ends = [max(start + low, 0.0), start + high]
            ax.plot(ends, [k, k], color="#111111", lw=1, label=f"_interval, {step.id}")
        ax.text(0.99, k, f"{speeds[k]:.3f}", va="center", ha="right", fontsize=8, transform=ax.get_yaxis_transform())
    ax.set(yticks=range(len(speeds)), yticklabels=[STEPS[step.id] for step in account.steps])
    ax.set_xlim(0, max(ax.get_xlim()[1], 1.35 * max(speeds)))
    ax.set_ylim(len(speeds) - 0.5, -0.5)
    ax.grid(visible=False, axis="y")
