"""Sphinx settings: `make docs` builds the site with warnings as errors, asking nothing of a network."""

import logging
import os
import sys
from pathlib import Path

# The commands' help is told for this width, and JAX is as the package sets it: both before anything imports them.
os.environ["COLUMNS"] = "100"
os.environ["JAX_ENABLE_X64"] = "1"
sys.path.insert(0, str(Path(__file__).parent))

logging.getLogger("arviz").setLevel(logging.WARNING)  # it says which of its parts it found

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

# Annotations such as Float[Array, "records 4"] say to a machine what each docstring says in words, units included.
autodoc_typehints = "none"
autodoc_member_order = "bysource"
autodoc_default_options = {"members": True}
autodoc_preserve_defaults = True
napoleon_google_docstring = False
# A type among the words of a docstring is often a short name, which no link could follow.
napoleon_use_rtype = False
napoleon_custom_sections = ["Fields", "Source"]
# The house writes names in single backticks.
default_role = "code"

nitpicky = True
# Types of other projects: an inventory to link to would have to be fetched.
nitpick_ignore_regex = [
    ("py:.*", r"(pandas|xarray|numpy|jax|jaxtyping|equinox|numpyro|pydantic|pathlib)\..*"),
    ("py:class", r"Array|ndarray"),  # what a property of jaxtyping's is left with
]
