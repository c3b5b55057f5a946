"""Conclusions are Markdown; their numbers come from tables, and what cannot be filled in is said in one line."""

from __future__ import annotations

import pandas as pd
import pytest
from scipy import stats

from snakebench.errors import StoreError
from snakebench.report.conclusions import conclusions

SWIMS = pd.DataFrame({"fluid": ["water", "water", "oil1"], "seed": [0, 1, 0], "speed": [0.2, 0.4, 0.1], "power": 2.0})


def filled(text: str) -> str:
    return str(conclusions(text, {"swims": SWIMS}, "a.md"))


def test_a_placeholder_is_a_mean_with_half_its_interval():
    half = stats.t.ppf(0.975, 1) * 0.1
    assert filled('{{ swims(fluid="water").mean("speed", 2) }}') == f"<p>0.30 ± {half:.2f}</p>\n"


def test_several_rows_of_a_seed_count_as_one_value():
    assert filled('{{ swims(seed=0).mean("speed", 2) }}') == "<p>0.15</p>\n"


def test_an_expression_of_columns_is_computed():
    assert filled('{{ swims(fluid="oil1").text("power / speed", ".0f") }}') == "<p>20</p>\n"


def test_a_value_that_is_not_known_is_a_dash_unless_it_is_left_out():
    table = SWIMS.assign(seconds=[1.0, float("nan"), 2.0])
    shown = [
        str(conclusions("{{ " + text + " }}", {"swims": table}, "a.md"))
        for text in (
            'swims.text("seconds", ".1f", "max")',
            'swims.mean("seconds", 1)',
            'swims.known("seconds").text("seconds", ".1f", "max")',
        )
    ]
    assert shown == ["<p>–</p>\n", "<p>–</p>\n", "<p>2.0</p>\n"]


def test_rows_that_are_not_there_can_be_counted():
    assert filled('{{ swims.count(fluid="tar") }} of {{ swims.n }}') == "<p>0 of 3</p>\n"


def test_the_highest_value_is_told_with_its_row():
    assert filled(
        '{% set top = swims.highest("speed / power") %}{{ top.name("fluid") }}, {{ top.text("seed", ".0f") }}'
    ) == ("<p>water, 1</p>\n")


def test_markdown_becomes_html_and_html_stays_text():
    assert filled("- *a*") == "<ul>\n<li><em>a</em></li>\n</ul>\n"
    assert "<script>" not in filled("<script>alert(1)</script>")


@pytest.mark.parametrize(
    "text",
    ['{{ swims(fluid="tar").mean("speed") }}', '{{ swim(fluid="water") }}', '{{ swims(gait="a").n }}', "{{ swims("],
)
def test_what_cannot_be_filled_in_is_said_in_a_line_that_names_the_file(text):
    with pytest.raises(StoreError, match=r"a\.md") as refusal:
        filled(text)
    assert "\n" not in str(refusal.value)
