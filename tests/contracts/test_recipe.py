"""The recipe for a study in CONTRIBUTING makes one: in a copy of the package, with nothing else changed."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pandas as pd
import pytest

import snakebench as sb
from snakebench.manifest import read_manifest

ROOT = Path(__file__).parents[2]
FILES = re.compile(
    r"^```\w+\n(?:# |<!-- )((?:snakebench/)?studies/[\w/.]+)(?: -->)?\n(.*?)^```$", re.DOTALL | re.MULTILINE
)


@pytest.fixture(scope="module")
def ran(tmp_path_factory) -> Path:
    """A directory in which the new study was run."""
    root = tmp_path_factory.mktemp("copy")
    for name in ("snakebench", "studies"):
        shutil.copytree(ROOT / name, root / name)  # with what is compiled
    for name, content in FILES.findall((ROOT / "CONTRIBUTING.md").read_text()):
        (root / name).parent.mkdir(exist_ok=True)
        (root / name).write_text(content)
    words = [sys.executable, "-m", "snakebench.cli", "run-study", "speeds", "--profile", "smoke", "--workers", "1"]
    done = subprocess.run(words, cwd=root, env=os.environ | {"PYTHONPATH": str(root)}, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return root


def test_the_recipe_has_all_files_of_a_room():
    names = {Path(name).name for name, _ in FILES.findall((ROOT / "CONTRIBUTING.md").read_text())}
    assert names == {
        "settings.py",
        "columns.py",
        "run.py",
        "page.py",
        "figures.py",
        "page.html",
        "speeds.toml",
        "speeds.md",
    }


def test_the_new_study_evaluates_what_it_says(ran):
    swims = pd.read_csv(ran / "results/speeds-smoke/swims.csv")
    gait = sb.SeaSnake(amplitude=0.9, frequency=0.6, phase=0.7)
    assert swims["fluid"].tolist() == ["water", "oil1", "oil2"]
    assert swims["speed"].tolist() == [sb.evaluate(gait, fluid, duration=4.0).speed for fluid in swims["fluid"]]
    assert read_manifest(ran / "results/speeds-smoke")["config"]["method"] == "speeds"


def test_the_new_study_has_a_page_with_its_figure_its_table_and_its_accuracy(ran):
    page = (ran / "reports/speeds-smoke.html").read_text()
    assert page.count("<svg") == 1 and "One swim in each fluid." in page and 'id="accuracy"' in page
