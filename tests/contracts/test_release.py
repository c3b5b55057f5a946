"""What is released is called the same everywhere, and is quick to import."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import yaml

from snakebench.version import __version__

ROOT = Path(__file__).parents[2]


def test_one_version_stands_in_the_package_the_citation_and_the_changelog(snakebench_command):
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text())
    changed = re.search(r"^## (\S+) – (\S+)$", (ROOT / "CHANGELOG.md").read_text(), re.M)
    assert changed is not None
    assert snakebench_command("--version") == (0, f"{__version__}\n", "")
    assert changed[1] == citation["version"] == __version__
    assert changed[2] == str(citation["date-released"])


def test_importing_the_package_loads_no_library():
    script = "import sys; before = set(sys.modules); import snakebench; print(*sorted(set(sys.modules) - before))"
    loaded = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True).stdout.split()
    others = {name.partition(".")[0] for name in loaded} - set(sys.stdlib_module_names) - {"snakebench"}
    assert not others
