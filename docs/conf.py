"""Sphinx configuration of the documentation. Needs the installed package. Build: `sphinx-build -W docs docs/_build`."""

from __future__ import annotations

import tomllib
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent

project = "palpate"
author = "The palpate developers"
copyright = "the palpate developers"
release = version = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]["version"]

extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon"]
source_suffix = {".md": "markdown"}
root_doc = "index"
default_role = "literal"
exclude_patterns = ["_build"]
suppress_warnings = ["ref.python"]  # exceptions that two packages export

myst_enable_extensions = ["deflist"]
myst_heading_anchors = 3

autodoc_member_order = "bysource"
autodoc_preserve_defaults = True
autodoc_default_options = {"members": True}
autodoc_typehints_format = "short"
autodoc_type_aliases = {name: name for name in ("Array", "ArrayLike", "Indices")}
napoleon_use_ivar = True
napoleon_google_docstring = True
napoleon_numpy_docstring = False
python_use_unqualified_type_names = True
python_maximum_signature_line_length = 88

html_theme = "furo"
html_title = "palpate"
html_static_path: list[str] = []


def escape_bars(_app, _what, _name, _object, _options, lines):
    """Escape the bars of magnitudes such as |B|, which reStructuredText reads as substitutions."""
    lines[:] = [line.replace("|", r"\|") for line in lines]


def setup(app):
    """Connect the hook above."""
    app.connect("autodoc-process-docstring", escape_bars)
