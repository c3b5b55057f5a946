"""Figure of the study of the paper's operating point."""

from collections.abc import Sequence

import pandas as pd

from snakebench.report import paper
from snakebench.report.figure_axes import legend_below, panels
from snakebench.report.figure_style import fluid_lines, palette, svg
from snakebench.studies.operating_point.columns import AMPLITUDES


def tails(sinusoid: pd.DataFrame, fluids: Sequence[str]) -> str:
    """Tail amplitude of the paper's fixed gait over the diameter, by each definition, and the paper's values."""
    titles = [name.replace("_", ", ") for name in AMPLITUDES]
    fig, axes = panels(1, len(titles), 2.7, 2.7, titles=titles, x="diameter [m]", y="tail amplitude [m]", sharey=True)
    colors, lines = palette(fluids), fluid_lines(fluids)
    for ax, name in zip(axes[0], AMPLITUDES, strict=True):
        for fluid in fluids:
            part, look = sinusoid[sinusoid["fluid"] == fluid].sort_values("diameter"), {"color": colors[fluid]}
            ax.plot(part["diameter"], part[name], ".", ls=lines[fluid], label=fluid, **look)
            if fluid in paper.SINUSOID_TAIL:
                ax.axhline(paper.SINUSOID_TAIL[fluid], lw=0.8, ls=(0, (1, 2)), label=f"paper, {fluid}", **look)
    axes[0, 0].set_ylim(bottom=0)
    legend_below(fig, columns=5)
    return svg(fig, "Tail amplitude of the fixed sinusoid over the diameter")
