"""No two tick labels of an axis overlap, whatever a figure shows, and the legend below is of every label once."""

from __future__ import annotations

from itertools import combinations

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from snakebench.comparison import figures as comparison
from snakebench.comparison.gain_ledger import STEPS
from snakebench.names import CURRENCIES
from snakebench.report import figure_style
from snakebench.report.bench import _figure as bench_figure
from snakebench.report.figure_axes import lay_out, legend_below, panels
from snakebench.report.front_figure import fronts
from snakebench.report.matrix_figure import matrices
from snakebench.report.seed_figure import over_viscosity
from snakebench.studies.validation import figures as validation

LONG = "a_very_long_name_of_a_plug-in_fluid_of_some_laboratory"


@pytest.fixture
def drawn(monkeypatch) -> list[Figure]:
    """The figures that are drawn, still open."""
    kept: list[Figure] = []
    monkeypatch.setattr(figure_style.plt, "close", kept.append)
    yield kept
    monkeypatch.undo()
    plt.close("all")


def overlaps(figure: Figure) -> list[tuple[str, str]]:
    """Pairs of tick labels of one axis whose boxes overlap, as Agg draws them."""
    FigureCanvasAgg(figure).draw()
    found = []
    for axis in (axis for ax in figure.axes for axis in (ax.xaxis, ax.yaxis)):
        low, high = sorted(axis.get_view_interval())
        span = 1e-9 * (high - low)
        texts = [
            label
            for tick in [*axis.get_major_ticks(), *axis.get_minor_ticks()]
            for label in (tick.label1, tick.label2)
            if label.get_visible() and label.get_text() and low - span <= tick.get_loc() <= high + span
        ]
        boxes = [(label.get_text(), label.get_window_extent()) for label in texts]
        found += [(one, other) for (one, a), (other, b) in combinations(boxes, 2) if a.overlaps(b)]
    return found


def shown(figure: Figure, axes: str = "x") -> int:
    """How many tick labels can be seen along these axes."""
    labels = [label for ax in figure.axes for axis in axes for label in getattr(ax, f"get_{axis}ticklabels")()]
    return sum(bool(label.get_text()) for label in labels if label.get_visible())


def crowded(*, scale: str = "linear", low: float = 0.0, high: float = 1.0, width: float = 2.0) -> Figure:
    fig, ((ax,),) = panels(1, 1, width, 2.0)
    ax.plot([low, high], [low, high])
    ax.set(xscale=scale, yscale=scale, xlim=(low, high), ylim=(low, high))
    return fig


@pytest.mark.parametrize(("scale", "width"), [("linear", 0.8), ("log", 0.8), ("log", 3.0)])
@pytest.mark.parametrize(
    ("low", "high"), [(0.0001, 0.00011), (1e-4, 5e-4), (2e-3, 3e-2), (1e-12, 1e12), (123456, 123457), (0.5, 0.50001)]
)
def test_numbers_along_an_axis_do_not_overlap(drawn, scale, low, high, width):
    figure_style.svg(crowded(scale=scale, low=low, high=high, width=width), "numbers")
    assert not overlaps(drawn[0])
    assert shown(drawn[0]) >= 1


def test_ticks_that_are_far_too_many_are_thinned():
    fig, ((ax,),) = panels(1, 1, 3, 2)
    ax.set(xlim=(0, 300), xticks=range(301))
    lay_out(fig)
    assert not overlaps(fig) and 5 < shown(fig) < 100
    plt.close(fig)


def test_crowded_names_are_turned_and_all_of_them_are_shown():
    fig, ((ax,),) = panels(1, 1, 4, 4)
    ax.set_xticks(range(12), [f"a long name {k}" for k in range(12)])
    lay_out(fig)
    assert not overlaps(fig) and shown(fig) == 12
    plt.close(fig)


def test_labels_that_have_room_all_stay():
    fig, ((ax,),) = panels(1, 1, 6, 2)
    ax.set_xticks(range(5), ["water", "oil1", "oil2", "honey", "air"])
    lay_out(fig)
    assert [label.get_text() for label in ax.get_xticklabels()] == ["water", "oil1", "oil2", "honey", "air"]
    assert {label.get_rotation() for label in ax.get_xticklabels()} == {0}
    plt.close(fig)


@pytest.mark.parametrize("fluids", [["water"], [f"{LONG}_{k}" for k in range(4)], [f"fluid{k}" for k in range(16)]])
def test_matrices_of_many_fluids_and_long_names(drawn, fluids):
    rows = [(LONG, loop, gait, fluid, 0.5, 1.0) for loop in ("open", "closed") for gait in fluids for fluid in fluids]
    columns = ["method", "loop", "gait_of", "fluid", "speed", "cost_of_transport"]
    matrices(pd.DataFrame(rows, columns=columns), fluids)
    assert not overlaps(drawn[0]) and shown(drawn[0], "xy") >= 4


@pytest.mark.parametrize("n", [1, 9])
def test_fronts_of_many_fluids(drawn, n):
    names = [f"{LONG}_{k}" for k in range(n)]
    power = np.logspace(-2, 2, 20)
    parts = [
        pd.DataFrame({"method": LONG, "front": name, "seed": 0, "speed": 0.1 + 1e-5 * power, "power": power})
        for name in names
    ]
    parts = [part.assign(positive_power=2 * power, currency=currency) for part in parts for currency in CURRENCIES]
    fronts(pd.concat(parts), parts[0].head(2), names, "fronts")
    assert not overlaps(drawn[0]) and shown(drawn[0], "xy") >= 4


def test_what_swims_backwards_is_counted_and_does_not_squeeze_the_fronts(drawn):
    line = pd.DataFrame({"front": "water", "seed": 0, "power": [1.0, 2.0], "speed": [0.1, 0.2]})
    line = line.assign(method="sinusoid", currency="net", positive_power=line["power"])
    speeds = [0.15, -0.001, -0.3, -0.4]  # the second hardly moves
    marks = pd.DataFrame({"method": "symmetric", "front": "water", "power": 1.5, "speed": speeds})
    fronts(line, marks, ["water"], "fronts")
    (ax,) = drawn[0].axes
    assert [text.get_text() for text in ax.texts] == ["symmetric: 2 of 4\nbackwards, not shown"]
    assert -0.1 < ax.get_ylim()[0] < -0.001


def test_a_front_that_begins_at_rest(drawn):
    line = pd.DataFrame({"front": "water", "seed": 0, "power": [0.0, 1.0, 2.0], "speed": [0.0, 0.1, 0.2]})
    line = line.assign(method="imitator", currency="net", positive_power=line["power"])
    fronts(line, line.head(0), ["water"], "fronts")
    assert [list(drawn_line.get_xdata()) for ax in drawn[0].axes for drawn_line in ax.lines] == [[1.0, 1.0, 2.0]]


@pytest.mark.parametrize("high", [1.1e-4, 3e-4, 1e-1])
def test_viscosities_in_a_narrow_range(drawn, high):
    viscosity = np.linspace(1e-4, high, 4)
    columns = ["swim_frequency", "tail_amplitude", "torque_amplitude", "speed", "power", "positive_power"]
    costs = dict.fromkeys(["cost_of_transport", "positive_cost_of_transport"], np.linspace(0.100001, 0.100009, 4))
    seeds = [
        pd.DataFrame({"method": LONG, "seed": seed, "viscosity": viscosity, **costs}).assign(
            **dict.fromkeys(columns, 1e-4 + 1e-9 * viscosity)
        )
        for seed in (1, 2)
    ]
    over_viscosity(pd.concat(seeds), [LONG])
    assert not overlaps(drawn[0]) and shown(drawn[0], "xy") >= 4


def test_physics_rates_that_are_many(drawn):
    rates = [60 * 2**k for k in range(14)] + [61, 62, 63, 125, 126]
    table = pd.DataFrame({"physics_rate": rates, "error": np.geomspace(1e-1, 1e-12, len(rates)), "gait": "a"})
    validation.order(table.assign(engine="planar", drives="torque"))
    assert not overlaps(drawn[0]) and shown(drawn[0], "xy") >= 4


def test_workloads_that_are_many(drawn):
    rows = [("swim", "planar", "torque", 60 + k, 64, 2, 10.0**k) for k in range(12)]
    columns = ["workload", "engine", "drives", "physics_rate", "robots", "threads", "simulated"]
    bench_figure(pd.DataFrame(rows, columns=columns))
    assert not overlaps(drawn[0]) and shown(drawn[0], "xy") >= 4


def test_a_ledger_of_many_places(drawn):
    parts = [
        pd.DataFrame({"view": "equal", "place": f"{LONG}{k}", "step": STEPS.keys(), "low": 0.0, "high": 2e-6})
        for k in range(8)
    ]
    ledger = pd.concat(parts, ignore_index=True)
    comparison.waterfall(ledger.assign(speed=0.00010 + 1e-6 * (ledger.index % len(STEPS))))
    assert not overlaps(drawn[0]) and shown(drawn[0], "xy") >= 4


def test_a_legend_has_every_label_once_and_none_that_is_private():
    fig, axes = panels(1, 2, 3, 2)
    for ax in axes[0]:
        ax.plot([1, 2], label="student")
        ax.plot([2, 1], label="_student, seed 1")
    axes[0, 1].plot([1, 1], label="teacher")
    legend_below(fig)
    assert [text.get_text() for text in fig.legends[0].get_texts()] == ["student", "teacher"]
    plt.close(fig)


def test_a_figure_without_labels_has_no_legend():
    fig, _ = panels(1, 1, 3, 2)
    legend_below(fig)
    assert not fig.legends
    plt.close(fig)
