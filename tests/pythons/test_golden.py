"""Every Python computes the same; on later ones `tox -e py312,py313` runs this."""

from __future__ import annotations

import importlib.util
import json
from pathlib import Path

import pytest

from snakebench import sources

HERE = Path(__file__).parent
CODE = """
class A:
    def f(self, a, *b, c=1, **d):
        '''What it does.'''
        return [f"{a:.3g}", lambda: (), {}, c]
"""


def test_code_has_one_digest_on_every_python(tmp_path, monkeypatch):
    monkeypatch.setattr(sources, "_PACKAGE", tmp_path)
    (tmp_path / "a.py").write_text(CODE)
    assert sources.code_digest("a") == "63ebe916f5f3b0b8"


@pytest.mark.golden
def test_swims_are_those_of_python_311_to_the_last_bit():
    spec = importlib.util.spec_from_file_location("golden", HERE / "golden.py")
    golden = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(golden)
    assert golden.swims() == json.loads((HERE / "golden.json").read_text())
