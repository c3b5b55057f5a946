"""What all figures share: colours, the theme, and how a figure becomes a part of a page."""

from __future__ import annotations

import io
import re
from collections.abc import Sequence
from typing import Any, NamedTuple

import matplotlib

matplotlib.use("svg")

import matplotlib.pyplot as plt
import seaborn as sns
from matplotlib.figure import Figure

from snakebench.reporting.figures.data import drawn_points
from snakebench.reporting.tables import packed
from snakebench.store import INTEGRATED

Color = str | tuple[float, float, float]


class Look(NamedTuple):
    """How something is drawn in every figure."""

    color: str
    marker: str = "."
    line: str = "-"


METHODS = {  # a method has one colour and one marker everywhere
    "sea snake": Look("#b58900", "*"),
    "sinusoid": Look("#8a949e", "s"),
    "wider sinusoid": Look("#3d4650", "D"),
    "free waveform": Look("#6a3d9a", "^"),
    "one waveform for all": Look("#b89bd0", "v"),
    "symmetric": Look("#c2410c", "X"),
    "teacher": Look("#2b5fd9", "P"),
    "student": Look("#2a9d57", "o"),
    "asymmetric_critic": Look("#b279a2", ">"),
    "memoryless_teacher": Look("#12867a", "<"),
}
FLUIDS = {  # a fluid has one line, and a colour of its own where no methods are compared
    "water": Look("#4aa3c7", line="-"),
    "oil1": Look("#d98c00", line="--"),
    "oil2": Look("#8c3b12", line=":"),
}
_OTHERS = ("-.", (0, (5, 1)), (0, (1, 1)), (0, (3, 1, 1, 1)))  # lines of other fluids
SAMPLERS = {"tpe": "#c2410c", "random": "#7a8591", "cmaes": "#2a9d57", "gp": "#2b5fd9"}
COLORS = {name: look.color for name, look in FLUIDS.items()} | {"mean": "#444444", INTEGRATED: "#444444"} | SAMPLERS

sns.set_theme(
    style="whitegrid",
    context="paper",
    font_scale=1.15,
    rc={"svg.fonttype": "none", "svg.hashsalt": "snakebench", "font.family": "sans-serif", "axes.titleweight": "bold"},
)


def method_look(name: str) -> Look:
    """The look of a method, or that of what is compared for once."""
    return METHODS.get(name, Look("#c2557a", "h"))


def fluid_lines(names: Sequence[str]) -> dict[str, Any]:
    """The line style of each fluid, the same in every figure for those that are in `FLUIDS`."""
    spare = iter(_OTHERS * len(names))
    return {name: FLUIDS[name].line if name in FLUIDS else next(spare) for name in names}


def palette(names: list[str]) -> list[Color]:
    """A colour for each name, the same in every figure for those that are in `COLORS`."""
    spare = iter(sns.color_palette("deep", len(names)))
    return [COLORS.get(name) or next(spare) for name in names]


def svg(figure: Figure, title: str) -> str:
    """The figure as an SVG element that scales with the page, and its data to save; equal figures are equal bytes."""
    own = re.sub(r"\W+", "-", title)  # ids are the page's, and figures share glyphs and clips
    data = packed(drawn_points(figure).encode())
    text = io.StringIO()
    figure.savefig(text, format="svg", bbox_inches="tight", metadata={"Date": None})
    plt.close(figure)
    svg = text.getvalue()[text.getvalue().index("<svg") :]
    svg = re.sub(r'<svg ([^>]*?)width="[\d.]+pt" height="[\d.]+pt"|<svg ', _scaled, svg, count=1)
    svg = re.sub(r' (d|x|y)="[^"]*"', lambda numbers: re.sub(r"(\d\.\d{2})\d+", r"\1", numbers[0]), svg)
    svg = re.sub(r'(\bid="|href="#|url\(#)', rf"\g<1>{own}-", svg)
    link = f'<a class="data" download="{own.lower()}.csv.gz" href="{data}">Data (CSV)</a>'
    return svg.replace(">", f' role="img" aria-label="{title}">', 1) + link


def _scaled(match: re.Match[str]) -> str:
    return f'<svg class="figure" {match.group(1) or ""}'
