# SPDX-License-Identifier: Apache-2.0
"""Sphinx: the pages of this folder (MyST) and the reference from the docstrings, offline."""

import re
from pathlib import Path

_ROOT = Path(__file__).resolve().parents[1]
_VERSION = (_ROOT / "riem_planner/version.py").read_text(encoding="utf-8")

project = "riem_planner"
author = copyright = "riem_planner maintainers"  # noqa: A001  Sphinx's name
version = release = re.search(r'__version__ = "([^"]+)"', _VERSION)[1]

extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon", "sphinx.ext.viewcode"]
exclude_patterns = ["_build"]
html_theme = "furo"
html_title = "riem_planner"

myst_enable_extensions = ["dollarmath", "amsmath"]
myst_heading_anchors = 3

napoleon_google_docstring = False
napoleon_use_rtype = False
autodoc_typehints = "none"  # shapes and units say more, and stand in the docstrings
autodoc_member_order = "bysource"
