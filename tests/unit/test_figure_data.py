"""The data of a figure is what it draws."""

from __future__ import annotations

import io

import numpy as np
import pandas as pd

from snakebench.report import figure_style as style


def test_every_line_marker_bar_and_cell_is_in_the_data():
    import matplotlib.pyplot as plt

    fig, (left, right) = plt.subplots(1, 2)
    left.plot([1, 2], [3.0, 4.0], label="_student, seed 0")
    left.scatter([5], [6.5], label="gaits")
    left.set(title="water", ylabel="v [m/s]", xlabel="P [W]")
    right.barh([0, 1], [0.5, 0.25], left=[0.0, 0.5])
    right.imshow([[7.0, 8.0]])
    table = pd.read_csv(io.StringIO(style.drawn_points(fig)))
    plt.close(fig)
    of = dict(list(table.groupby("series")))
    assert of["student, seed 0"][["x", "y"]].to_numpy().tolist() == [[1, 3], [2, 4]]
    assert set(of["student, seed 0"]["panel"]) == {"water / v [m/s] / P [W]"}
    assert of["gaits"][["x", "y"]].to_numpy().tolist() == [[5, 6.5]]
    assert of["bars (end, middle)"]["x"].tolist() == [0.5, 0.75]
    assert of["cells"][["x", "y", "value"]].to_numpy().tolist() == [[0, 0, 7], [1, 0, 8]]


def test_points_beyond_the_axes_are_not_in_the_data():
    import matplotlib.pyplot as plt

    fig, ax = plt.subplots()
    ax.plot(np.arange(100), np.arange(100), label="front")
    ax.axhline(7.5, label="bound")
    ax.set(xlim=(20, 30), ylim=(0, 25))
    table = pd.read_csv(io.StringIO(style.drawn_points(fig)))
    plt.close(fig)
    of = dict(list(table.groupby("series")))
    assert of["front"]["x"].tolist() == list(range(19, 27))  # with a neighbour on each side, so that lines go on
    assert of["bound"]["y"].tolist() == [7.5, 7.5]


def test_methods_and_fluids_look_different_from_each_other():
    methods = list(style.METHOD_LOOKS.values())
    assert len({look.color for look in methods}) == len({look.marker for look in methods}) == len(methods)
    assert len({look.line for look in style.FLUIDS.values()}) == len(style.FLUIDS)
    assert {look.color for look in methods}.isdisjoint(look.color for look in style.FLUIDS.values())
    lines = style.fluid_lines(["oil2", "5e-3", "water", "7e-3"])
    assert lines["water"] == "-" and lines["oil2"] == ":" and len({str(line) for line in lines.values()}) == 4


def test_a_picture_comes_with_its_data():
    import matplotlib.pyplot as plt

    fig, ax = plt.subplots()
    ax.plot(np.arange(3), np.arange(3))
    drawn = style.svg(fig, "Speed over power")
    assert (
        drawn.startswith("<svg")
        and 'download="speed-over-power.csv.gz"' in drawn
        and "data:application/gzip;base64," in drawn
    )
