"""The picture in CONTRIBUTING is the package: it is generated from the imports."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))


def test_the_picture_in_contributing_is_that_of_todays_imports():
    pytest.importorskip("grimp")
    from picture import CONTRIBUTING, with_picture

    text = CONTRIBUTING.read_text(encoding="utf-8")
    assert "graph LR" in text and text == with_picture(text)
