"""The claims as a Markdown table: its cells are text, whatever names in results are like."""

from __future__ import annotations

from pathlib import Path

import pytest
from markdown_it import MarkdownIt

from snakebench.comparison.claims import claims
from snakebench.comparison.quantities import Results
from snakebench.comparison.verdicts import Claim, markdown

ROOT = Path(__file__).parents[2]
HOSTILE = {
    "a pipe": "a | b || c",
    "an escaped pipe": r"a \| b",
    "lines": "a\n\n| b |\r\n# c\x0b\u2028- d",
    "code": "`a` ``b",
    "HTML": "<img src=x onerror=alert(1)><!-- a",
    "an entity": "&lt;b&gt; &#60;",
    "a link": "[a](https://a.example) [b][c] [d]: e <https://f.example>",
    "a picture": "![a](https://a.example/a.png)",
    "emphasis": "*a* **b** _c_ __d__ ~~e~~ f_g",
    "a formula": "$x^2$ $$y$$",
    "a bare address": "https://a.example www.a.example WWW.A.EXAMPLE ftp://a.example me@a.example",
    "a backslash at the end": "a\\",
}


def judged(text: str) -> list[Claim]:
    return [Claim(text, text, text, "5", "reproduced", "", "pareto")] * 2


def of_columns(text: str, name: str) -> list:
    tokens = MarkdownIt("commonmark").enable(["table", "strikethrough"]).parse(text)
    assert {token.type.partition("_")[0] for token in tokens} == {"table", "thead", "tbody", "tr", "th", "td", "inline"}
    return [after for before, after in zip(tokens, tokens[1:], strict=False) if before.type == name]


@pytest.mark.parametrize("name", HOSTILE)
def test_a_cell_of_the_claims_is_the_text_that_it_was_given(name):
    text = HOSTILE[name]
    cells = of_columns(markdown(judged(text)), "td_open")
    assert len(cells) == 2 * 5
    children = cells[0].children or []
    assert {child.content for child in children if child.type == "html_inline"} <= {"<span>", "</span>"}
    assert {child.type for child in children} <= {"text", "text_special", "html_inline"}
    assert "".join(child.content for child in children if child.type != "html_inline") == " ".join(text.split())


@pytest.mark.parametrize("sign", ["://", "www.", "WWW.", "@", "$"])
def test_no_address_or_formula_is_left_for_github_to_find(sign):
    assert sign not in markdown(judged(HOSTILE["a bare address"] + HOSTILE["a formula"]))


def test_the_claims_of_the_committed_results_are_as_they_were():
    found, _ = claims(Results(ROOT / "results"))
    assert markdown(found) == (ROOT / "reports" / "claims.md").read_text()
