"""How the documentation site is built: `sphinx-build -W docs build/site`, with the extra `docs` installed."""

from __future__ import annotations

project = "flexmb and crosscheck"
copyright = "the flexmb authors"
extensions = ["myst_parser", "sphinx.ext.autodoc"]
html_theme = "furo"
html_title = "flexmb and crosscheck"
html_static_path = ["_static"]
html_css_files = ["pictures.css"]
exclude_patterns = ["equations", "engine-template"]
default_role = "code"  # `name` in docstrings is a name of the code
myst_heading_anchors = 3
autodoc_member_order = "bysource"
autodoc_typehints = "signature"
