"""Studies: a folder for each method, with its settings, its run and its page; what they share lies beside them."""

from pathlib import Path

METHODS = tuple(sorted(path.parent.name for path in Path(__file__).parent.glob("*/settings.py")))
