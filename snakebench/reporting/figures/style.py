"""What all figures share: colours, the theme, and how a figure becomes a part of a page."""

from __future__ import annotations

import io
import re

import matplotlib

matplotlib.use("svg")

import matplotlib.pyplot as plt
import seaborn as sns
from matplotlib.figure import Figure

Color = str | tuple[float, float, float]
COLORS = {"water": "#1f77b4", "oil1": "#d98c00", "oil2": "#8c3b12", "mean": "#444444"}

sns.set_theme(
    style="whitegrid",
    context="paper",
    font_scale=1.15,
    rc={"svg.fonttype": "none", "svg.hashsalt": "snakebench", "font.family": "sans-serif", "axes.titleweight": "bold"},
)


def palette(names: list[str]) -> list[Color]:
    """A colour for each name, the same in every figure for those that are in `COLORS`."""
    spare = iter(sns.color_palette("deep", len(names)))
    return [COLORS.get(name) or next(spare) for name in names]


def svg(figure: Figure, title: str) -> str:
    """The figure as an SVG element that scales with the page; equal figures are equal bytes."""
    text = io.StringIO()
    figure.savefig(text, format="svg", bbox_inches="tight", metadata={"Date": None})
    plt.close(figure)
    svg = text.getvalue()[text.getvalue().index("<svg") :]
    svg = re.sub(r'<svg ([^>]*?)width="[\d.]+pt" height="[\d.]+pt"|<svg ', _scaled, svg, count=1)
    svg = re.sub(r' (d|x|y)="[^"]*"', lambda numbers: re.sub(r"(\d\.\d{2})\d+", r"\1", numbers[0]), svg)
    own = re.sub(r"\W+", "-", title)  # ids are the page's, and figures share glyphs and clips
    svg = re.sub(r'(\bid="|href="#|url\(#)', rf"\g<1>{own}-", svg)
    return svg.replace(">", f' role="img" aria-label="{title}">', 1)


def _scaled(match: re.Match[str]) -> str:
    return f'<svg class="figure" {match.group(1) or ""}'
