"""A figure shows names as they are: nothing in them is markup, a formula or an id."""

from __future__ import annotations

import re
from xml.etree import ElementTree

import matplotlib.pyplot as plt
import numpy as np
import pytest
from markupsafe import Markup

from snakebench.report.figure_style import svg

HOSTILE = 'x"><img src=x onerror=alert(1)>'


def drawn(title: str, name: str = "water", *, scale: str = "linear") -> str:
    fig, ax = plt.subplots(layout="constrained")
    ax.plot([1, 1000], [1, 1000], label=name)
    ax.set(title=name, xscale=scale)
    ax.legend()
    return svg(fig, title)


def element(picture: str) -> ElementTree.Element:
    return ElementTree.fromstring(str(picture).partition("</svg>")[0] + "</svg>")


def texts(picture: str) -> list[str]:
    return ["".join(one.itertext()).strip() for one in element(picture).iter("{http://www.w3.org/2000/svg}text")]


def test_a_title_is_escaped_in_its_attribute():
    picture = drawn(f"The course {HOSTILE}")
    assert element(picture).attrib["aria-label"] == f"The course {HOSTILE}" and "<img" not in picture


def test_a_picture_says_itself_that_it_is_escaped():
    assert isinstance(drawn("Front"), Markup)


@pytest.mark.parametrize("name", [HOSTILE, "$x^", "$x^$", "$\\frac{$", 'url(#a id="b', "a & b <!-- --> ]]>", "蜂蜜"])
def test_a_name_is_drawn_as_it_is(name):
    assert texts(drawn("Front", name)).count(name) == 2


def test_what_cannot_be_in_xml_is_not_in_a_picture():
    element(drawn("The course \x1b\x00", "\x1b\x07\ufffe"))


def test_pictures_of_titles_that_differ_in_a_sign_have_ids_of_their_own():
    ids = [set(re.findall(r'\bid="([^"]*)"', drawn(title))) for title in ("The course a b", "The course a-b")]
    assert ids[0].isdisjoint(ids[1])


def test_the_name_of_the_file_of_a_long_title_is_short():
    assert len(re.findall(r'download="([^"]*)"', drawn("a" * 1000))[0]) < 120


def test_powers_of_ten_are_plain_text():
    assert {"10⁰", "10³"} <= set(texts(drawn("Front", scale="log")))


def points(path: str) -> np.ndarray:
    """The points of a path of lines, whose steps along an axis have one number."""
    steps = list[tuple[float, float]]()
    for command, written in re.findall(r"([Mlhv])([^A-Za-z]*)", path):
        numbers = [float(number) for number in re.findall(r"-?\d*\.?\d+", written)]
        along = {"h": [(x, 0.0) for x in numbers], "v": [(0.0, y) for y in numbers]}
        steps += along.get(command, zip(numbers[::2], numbers[1::2], strict=True))
    return np.array(steps).cumsum(axis=0)


def longest_line(heights: np.ndarray) -> np.ndarray:
    fig, ax = plt.subplots()
    ax.plot(heights)
    with plt.rc_context({"path.simplify": False}):
        return points(max(re.findall(r' d="([^"]*)"', svg(fig, "Line")), key=len))


@pytest.mark.parametrize("heights", [np.random.default_rng(0).random(2000), np.repeat([0.0, 1.0, 0.5, 0.5001], 300)])
def test_a_long_line_ends_where_it_should(heights):
    """Points are steps from those before: every one of a zigzag and of stairs lies within a tenth of a pixel."""
    for place, expected in zip(longest_line(heights).T, (np.arange(len(heights)), heights), strict=True):
        assert np.allclose(place, np.polyval(np.polyfit(expected, place, 1), expected), rtol=0, atol=0.1)


def test_looks_are_classes_that_hold_in_their_own_figure():
    picture = drawn("Front")
    own = element(picture).attrib["id"]
    rules = re.findall(r"([^{}<>]*) \.(c\d+)\{", picture)
    assert rules and {scope for scope, _ in rules} == {f"#{own}"}
    used = " ".join(re.findall(r' class="([^"]*)"', picture))
    assert set(re.findall(r"\bc\d+\b", used)) == {name for _, name in rules}


def test_no_group_of_a_picture_is_without_attributes():
    assert all(group.attrib for group in element(drawn("Front")).iter("{http://www.w3.org/2000/svg}g"))
