"""How the documentation is built, by `tox -e docs`."""

import sys
from pathlib import Path

from snakebench.version import __version__

sys.path.append(str(Path(__file__).parent / "extensions"))

project = "snakebench"
copyright = "snakebench contributors, MIT license"
version = release = __version__
extensions = [
    "myst_parser",
    "sphinx.ext.autodoc",
    "sphinx.ext.napoleon",
    "cyclopts.ext.sphinx",
    "fields",
    "mathml",
    "published",
]
exclude_patterns = ["_build"]

html_theme = "furo"
html_title = "snakebench"
html_show_sourcelink = False
html_copy_source = False
html_static_path = ["style.css"]
html_css_files = ["style.css"]

myst_enable_extensions = ["amsmath", "deflist", "dollarmath"]
myst_heading_anchors = 3

default_role = "literal"  # docstrings write `names` with single backticks
smartquotes_action = "qe"  # two hyphens begin an option
autodoc_default_options = {"exclude-members": "model_config"}
autodoc_type_aliases = {"FloatArray": "FloatArray", "Medium": "Medium"}
autodoc_member_order = "bysource"
autodoc_typehints = "signature"
autodoc_typehints_format = "short"
autodoc_preserve_defaults = True
napoleon_numpy_docstring = False
napoleon_use_ivar = True
