"""The documentation site: `uv run --dev sphinx-build -W docs out/site`, then open out/site/index.html.

Reference, gallery and replays are made anew by each build, from the code; see `site`.
"""

import sys
from pathlib import Path

from sphinx.application import Sphinx

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE))

from site_pages import docstrings, gallery, mathml, outside, reference  # noqa: E402 - found beside this file

project = "Aerobat"
author = "the Aerobat authors"
extensions = ["myst_nb", "sphinx.ext.autodoc", "sphinx.ext.napoleon", "sphinx_copybutton"]
exclude_patterns = ["site_pages"]

myst_enable_extensions = ["dollarmath", "attrs_inline"]
myst_fence_as_directive = ["math"]  # as GitHub has it
myst_heading_anchors = 4
nb_execution_mode = "off"  # the tutorial is kept with what it shows; a test runs it

autodoc_typehints = "description"
autodoc_member_order = "bysource"
autodoc_preserve_defaults = True
napoleon_numpy_docstring = False
default_role = "literal"
python_use_unqualified_type_names = True
highlight_language = "text"
copybutton_exclude = ".linenos, .gp, .go"

html_theme = "furo"
html_title = "Aerobat"
html_static_path = ["site_pages/static"]
html_css_files = ["site.css"]
html_extra_path = ["generated/extra"]  # replays: whole pages of their own
html_math_renderer = "mathml"
html_theme_options = {
    "light_css_variables": {"color-brand-primary": "#004488", "color-brand-content": "#004488"},
    "dark_css_variables": {"color-brand-primary": "#6fa3d4", "color-brand-content": "#6fa3d4"},
}


def setup(app: Sphinx) -> None:
    """Write what is made from the code, and have formulas and docstrings read as they are meant."""
    mathml.register(app)
    app.connect("autodoc-process-docstring", docstrings.as_restructured_text, priority=400)
    app.connect("autodoc-process-signature", docstrings.readable_types, priority=900)
    app.connect("source-read", outside.relink)
    generated = HERE / "generated"
    outside.write(generated)
    reference.write(generated)
    gallery.write(generated)
