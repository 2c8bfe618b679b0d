"""Sphinx settings: `make docs` builds the site offline, with warnings as errors."""

import logging
import os
import sys
from pathlib import Path

# The width of the commands' help, and JAX in float64: both must be set before anything is imported.
os.environ["COLUMNS"] = "100"
os.environ["JAX_ENABLE_X64"] = "1"
sys.path.insert(0, str(Path(__file__).parent))

logging.getLogger("arviz").setLevel(logging.WARNING)  # otherwise it logs which of its optional packages are installed

project = "bayes_tyre"
html_title = "bayes_tyre"
extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon", "from_source"]
exclude_patterns = ["README.md"]
smartquotes = False

html_theme = "furo"
html_copy_source = False
html_show_copyright = False
html_theme_options = {"top_of_page_buttons": []}

myst_enable_extensions = ["deflist"]
myst_heading_anchors = 3

# The docstrings state shapes and units; annotations such as Float[Array, "records 4"] are for the type checker.
autodoc_typehints = "none"
autodoc_member_order = "bysource"
autodoc_default_options = {"members": True}
autodoc_preserve_defaults = True
napoleon_google_docstring = False
# A type in a docstring is often a short name, which cannot be linked.
napoleon_use_rtype = False
napoleon_custom_sections = ["Fields", "Source"]
# Docstrings write names in single backticks.
default_role = "code"

nitpicky = True
# Types of other projects: linking to them would need inventories from a network.
nitpick_ignore_regex = [
    ("py:.*", r"(pandas|xarray|numpy|jax|jaxtyping|equinox|numpyro|pydantic|pathlib)\..*"),
    ("py:class", r"Array|ArrayLike|ndarray|collections\.abc\..*"),  # what a property of jaxtyping's is left with
]
