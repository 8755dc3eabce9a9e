"""How the documentation is built: ``make docs``, or ``sphinx-build -W docs build/docs``.

Nothing is fetched while it is built, and nothing when it is read: equations are MathML, sources
are part of the pages.
"""

import logging
import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE / "extensions"))
if (HERE.parent / "src").is_dir():
    sys.path.insert(0, str(HERE.parent / "src"))

from pivident import __version__  # noqa: E402

project = "pivident"
author = "the pivident authors"
copyright = "the pivident authors, Apache License 2.0"
version = release = __version__

extensions = [
    "myst_parser",
    "sphinx.ext.autodoc",
    "sphinx.ext.napoleon",
    "sphinx.ext.viewcode",
    "command_pages",
    "docstring_formulas",
    "equation_code",
    "mathml_equations",
]
exclude_patterns = ["extensions", "_build"]

# Markdown as on the other pages: Markdown links, headings as anchors, equations between dollars.
myst_enable_extensions = ["dollarmath", "colon_fence", "deflist"]
myst_heading_anchors = 3
myst_dmath_double_inline = False

# Docstrings: Google style, types from the annotations.
napoleon_google_docstring = True
napoleon_numpy_docstring = True
napoleon_use_rtype = False
autodoc_typehints = "description"
autodoc_typehints_description_target = "documented_params"
autodoc_member_order = "bysource"
autodoc_preserve_defaults = True
default_role = "literal"
python_use_unqualified_type_names = True
viewcode_line_numbers = False

math_number_all = False
math_numfig = True
numfig = False
math_eqref_format = "({number})"
html_math_renderer = "mathml"

html_theme = "furo"
html_title = f"pivident {version}"
html_static_path = ["_static"]
html_css_files = ["equations.css"]
html_copy_source = False
html_show_sourcelink = False
html_show_sphinx = False
html_theme_options = {"navigation_with_keys": True}


def setup(app) -> None:
    """A chapter that lists its pages by a pattern may have none yet."""
    toctree = logging.getLogger("sphinx.sphinx.directives.other")
    toctree.addFilter(lambda record: "glob pattern" not in str(record.msg))
