"""What the axes of all figures share: grids of panels, the legend below them, and tick labels that never overlap."""

import re
from collections.abc import Mapping, Sequence
from typing import Any

import matplotlib.pyplot as plt
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.text import Text
from matplotlib.ticker import FixedLocator, LogFormatterSciNotation, LogLocator, NullLocator
from matplotlib.transforms import Bbox

_GAP = 1.5  # around a tick label [pixels of 1/100 inch]
_ABOVE_FACTOR = 18  # from the axes to a title above a factor such as 1e12 [points]
_MARGIN = 0.1  # around a figure [inch]
_RAISED = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


class _Powers(LogFormatterSciNotation):
    """Powers of ten as plain text, such as 2×10⁻³: no text in these figures is read as a formula."""

    def __call__(self, x: float, pos: int | None = None) -> str:
        formula = super().__call__(x, pos).removeprefix(r"$\mathdefault{").removesuffix("}$")
        return re.sub(r"\^\{(.*)\}", lambda power: power[1].translate(_RAISED), formula.replace(r"\times", "×"))


def panels(
    rows: int, columns: int, width: float, height: float, *, titles: Any = (), x: Any = "", y: Any = "", **options: Any
) -> tuple[Figure, Any]:
    """A figure and its axes, shape (rows, columns), of panels of so many inches; `options` are of `subplots`.

    `titles` are above the columns, `x` is below the last row, `y` beside the first column, or one a row.
    """
    size = (width * columns, height * rows)
    fig, axes = plt.subplots(rows, columns, figsize=size, layout="constrained", squeeze=False, **options)
    for ax, title in zip(axes[0], titles, strict=False):
        ax.set_title(title)
    for ax, label in zip(axes[:, 0], [y] * rows if isinstance(y, str) else y, strict=True):
        ax.set_ylabel(label)
    plt.setp(axes[-1], xlabel=x)
    return fig, axes


def wrapped_panels(
    titles: Sequence[str], columns: int, width: float, height: float, *, x: str, y: str, **options: Any
) -> tuple[Figure, Sequence[Axes]]:
    """A figure and its axes, one a title, in rows of so many; all have the label x."""
    fig, axes = panels(-(-len(titles) // columns), columns, width, height, y=y, **options)
    for ax in axes.flat[len(titles) :]:
        ax.remove()
    for ax, title in zip(axes.flat, titles, strict=False):
        ax.set(title=title, xlabel=x)
    return fig, axes.flat[: len(titles)]


def legend_below(fig: Figure, looks: Mapping[str, Mapping[str, Any]] | None = None, columns: int = 4) -> None:
    """A legend below all panels: of the looks of lines by label, or else of every label in the panels, once."""
    if looks is None:
        labelled = [pair for ax in fig.axes for pair in zip(*ax.get_legend_handles_labels(), strict=True)]
        handles = list({label: handle for handle, label in reversed(labelled)}.values())[::-1]
    else:
        handles = [Line2D([], [], label=label, **look) for label, look in looks.items()]
    if handles:  # a short training may have ended no episode
        fig.legend(handles=handles, loc="outside lower center", ncols=columns, frameon=False)


def plain_log(axis: Axis, subs: Sequence[float] = (1,)) -> None:
    """Plain numbers along a logarithmic axis: these multiples of the powers of ten."""
    axis.set(major_locator=LogLocator(10, subs=subs), major_formatter="{x:g}", minor_locator=NullLocator())


def lay_out(figure: Figure) -> Bbox:
    """Place all parts of a figure so that no two tick labels of an axis overlap; return the region drawn on [inch].

    Crowded names along x are turned upright. Labels that overlap one that stays are hidden, minor ones first.
    """
    FigureCanvasAgg(figure)  # it measures text
    axes = [axis for ax in figure.axes for axis in (ax.xaxis, ax.yaxis)]
    for axis in axes:
        _simplify_numbers(axis)
        plt.setp(list(axis.axes.spines.values()), in_layout=False)  # on the edge of its axes: no need to measure it
    if engine := figure.get_layout_engine():
        engine.execute(figure)
        named = [ax.xaxis for ax in figure.axes if isinstance(ax.xaxis.get_major_locator(), FixedLocator)]
        if crowded := [axis for axis in named if _overlapping(axis)]:
            for axis in crowded:
                axis.set_tick_params(labelrotation=90)
            engine.execute(figure)
        figure.set_layout_engine("none")
    for axis in axes:
        plt.setp(_overlapping(axis), visible=False)
    return figure.get_tightbbox().padded(_MARGIN)


def _simplify_numbers(axis: Axis) -> None:
    """Plain text along logarithmic axes, no minor ticks that have no labels, and room above for a common factor."""
    for which, formatter in (("major", axis.get_major_formatter()), ("minor", axis.get_minor_formatter())):
        if isinstance(formatter, LogFormatterSciNotation):
            axis.set(**{f"{which}_formatter": _Powers()})
    low, high = sorted(axis.get_view_interval())
    if axis.get_scale() == "log" and high > 10 * low:
        axis.set_minor_locator(NullLocator())
    if axis is axis.axes.yaxis and axis.get_majorticklabels() and axis.get_major_formatter().get_offset():
        title = axis.axes.title
        axis.axes.set_title(title.get_text(), fontsize=title.get_fontsize(), pad=_ABOVE_FACTOR)


def _overlapping(axis: Axis) -> list[Text]:
    """The tick labels of an axis that have to go so that the others do not overlap."""
    shown: list[Bbox] = []
    hidden = []
    for label in [*axis.get_majorticklabels(), *axis.get_minorticklabels()]:
        box = label.get_window_extent().padded(_GAP)
        if any(box.overlaps(other) for other in shown):
            hidden.append(label)
        elif label.get_text():
            shown.append(box)
    return hidden
