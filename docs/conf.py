import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))  # the extension and the tables of this folder

import tables

from posekit import __version__ as release

project = "posekit"
author = "posekit developers"
copyright = "2026, posekit developers"

# No intersphinx and no MathJax: the documentation is built and read without a network.
extensions = [
    "myst_parser",
    "mathml",
    "sphinx.ext.autodoc",
    "sphinx.ext.autosummary",
    "sphinx.ext.napoleon",
]
exclude_patterns = ["_build", "_generated", "_templates"]
templates_path = ["_templates"]

myst_enable_extensions = ["colon_fence", "deflist", "dollarmath"]
myst_heading_anchors = 3

autodoc_member_order = "bysource"
autodoc_typehints = "signature"
autodoc_class_signature = "separated"
napoleon_google_docstring = False
napoleon_use_ivar = True
napoleon_use_rtype = False
python_maximum_signature_line_length = 90

# Short names in docstrings have more than one target: posekit.Motion is posekit.motion.motion.Motion.
suppress_warnings = ["ref.python"]

html_theme = "furo"
html_title = f"posekit {release}"


def setup(app):
    """Write the generated tables before Sphinx reads the pages."""
    app.connect("builder-inited", lambda app: tables.write_generated())
