import sys
from importlib.metadata import version as installed_version
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))  # the two extensions of our own

project = "posekit"
author = "posekit developers"
copyright = "2026, posekit developers"
release = installed_version("posekit")
version = ".".join(release.split(".")[:2])

# No intersphinx: the documentation builds without a network.
extensions = [
    "myst_parser",
    "quick_build",
    "sphinx.ext.autodoc",
    "sphinx.ext.mathjax",
    "sphinx.ext.napoleon",
    "sphinx.ext.viewcode",
    "sphinx_gallery.gen_gallery",
    "warned_again",
]
exclude_patterns = ["_build"]

# Each picture is made by its code, in examples/gallery; a build makes those again whose code has changed.
sphinx_gallery_conf = {
    "examples_dirs": "../examples/gallery",
    "gallery_dirs": "gallery",
    "image_scrapers": ("gallery_pictures.scrape",),
    "abort_on_example_error": True,
    "download_all_examples": False,
    "min_reported_time": 10_000,
    "show_signature": False,
}

myst_enable_extensions = ["amsmath", "colon_fence", "deflist", "dollarmath"]
myst_heading_anchors = 3

autodoc_default_options = {"members": True, "member-order": "bysource", "show-inheritance": True}
autodoc_typehints = "signature"
autodoc_class_signature = "separated"
napoleon_google_docstring = False
napoleon_numpy_docstring = True
napoleon_use_ivar = True  # a dataclass lists its fields once, in its Attributes section
napoleon_use_rtype = False

# Short names in docstrings (`Figure`, `q`) have more than one target: posekit.Figure is figure.figure.Figure.
suppress_warnings = ["ref.python"]

# Every page's sidebar is made of all entries of all pages: with each class and its fields among them that took minutes.
toc_object_entries = False

html_theme = "furo"
html_title = f"posekit {release}"
