"""How Sphinx builds the documentation: `make docs`, without a network."""

from __future__ import annotations

import os
import sys
from importlib.metadata import version as version_of
from pathlib import Path

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE / "extensions"), str(HERE.parent)]
os.environ["PYTHONPATH"] = str(HERE.parent)  # the notebook runs in a process of its own
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

project = "ttwmr-mj"
author = "The ttwmr-mj authors"
copyright = author  # noqa: A001
release = version = version_of("ttwmr-mj")

extensions = [
    "myst_nb",
    "sphinx.ext.autodoc",
    "sphinx.ext.autosummary",
    "sphinx.ext.napoleon",
    "sphinx_gallery.gen_gallery",
    "mathml",
    "plain_docstrings",
]
exclude_patterns = ["build", "**/sg_execution_times.rst", "gallery/*.ipynb"]
suppress_warnings = ["config.cache"]  # the gallery's settings hold functions
default_role = "code"

# Markdown
myst_enable_extensions = ["colon_fence", "dollarmath", "deflist", "attrs_inline"]
myst_heading_anchors = 4
nb_execution_mode = "force"
nb_execution_timeout = 600  # a cell on a machine that has other work, too
nb_execution_raise_on_error = True
nb_merge_streams = True

# Docstrings
autosummary_generate = True
autodoc_typehints = "signature"
autodoc_member_order = "bysource"
autodoc_default_options = {"members": True}
napoleon_google_docstring = True
napoleon_numpy_docstring = False
napoleon_use_ivar = True

# The gallery: every script is run, its figures are its picture.
sphinx_gallery_conf = {
    "examples_dirs": "../examples",
    "gallery_dirs": "gallery",
    "filename_pattern": r"\.py$",
    "abort_on_example_error": True,
    "plot_gallery": True,
    "download_all_examples": False,
    "show_signature": False,
    "remove_config_comments": True,
    "min_reported_time": 1e6,
    "write_computation_times": False,
    "image_srcset": ["2x"],
}

# Pages
html_theme = "pydata_sphinx_theme"
html_title = "ttwmr-mj"
html_static_path = ["static"]
html_css_files = ["site.css"]
html_copy_source = html_show_sourcelink = False
html_math_renderer = "mathml"
html_theme_options = {
    "show_prev_next": True,
    "navigation_with_keys": False,
    "navbar_align": "left",
    "header_links_before_dropdown": 6,
    "secondary_sidebar_items": ["page-toc"],
    "footer_start": ["copyright"],
    "footer_end": [],
    "pygments_light_style": "a11y-high-contrast-light",
    "pygments_dark_style": "a11y-high-contrast-dark",
}
html_sidebars = {"index": []}
