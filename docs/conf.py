"""How Sphinx makes the site: `make docs`."""

import sys
from pathlib import Path

DOCS = Path(__file__).resolve().parent
sys.path.insert(0, str(DOCS.parent))

(DOCS / "made" / "extra").mkdir(parents=True, exist_ok=True)  # Sphinx looks for it at once

import kincompile  # noqa: E402 - of this checkout

project = "kincompile"
author = "the kincompile authors"
copyright = author  # noqa: A001 - Sphinx's name
version = release = kincompile.__version__

extensions = [
    "myst_parser",
    "numpydoc",
    "sphinx.ext.autodoc",
    "sphinx_design",
    "docs.builders.dark",
    "docs.builders.mathml",
    "docs.builders.site",
]
exclude_patterns = ["builders", "made/extra"]
suppress_warnings = ["myst.header"]  # tables of the benchmarks stand two levels below

myst_enable_extensions = ["colon_fence"]
myst_fence_as_directive = ["math"]
myst_heading_anchors = 3

numpydoc_show_class_members = False
numpydoc_xref_param_type = False
autodoc_member_order = "bysource"
autodoc_typehints = "none"
add_module_names = False

html_theme = "pydata_sphinx_theme"
html_title = "kincompile"
templates_path = ["templates"]
html_static_path = ["static", "../templates/report/math.css"]  # the font of formulas
html_css_files = ["math.css", "site.css"]
html_extra_path = ["made/extra"]
html_math_renderer = "mathml"
html_show_sourcelink = False
html_copy_source = False
# A page opened from a file may not fetch others, and the results would not be shown.
html_show_search_summary = False
html_theme_options = {
    "navbar_align": "left",
    "navbar_end": ["theme-switcher"],
    "show_prev_next": True,
    "footer_start": ["copyright"],
    "footer_end": [],
    "header_links_before_dropdown": 7,
    "pygments_light_style": "a11y-high-contrast-light",
    "pygments_dark_style": "a11y-high-contrast-dark",
}
html_context = {"default_mode": "auto"}
