"""Pictures of the gallery: posekit's plots are figures of their own, and its scenes PNG files. A part of the build."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import Any

from matplotlib.figure import Figure
from sphinx_gallery.scrapers import figure_rst


def scrape(block: Any, variables: dict[str, Any], gallery: dict[str, Any]) -> str:
    """Save what a block has newly named: each `Figure`, and each `Path` of a PNG that is there."""
    seen: set[int] = variables.setdefault("pictures_seen", set())
    saved = []
    for value in variables["example_globals"].values():
        is_file = isinstance(value, Path) and value.suffix == ".png" and value.is_file()
        if id(value) in seen or not (is_file or isinstance(value, Figure)):
            continue
        seen.add(id(value))
        path = next(variables["image_path_iterator"])
        if isinstance(value, Figure):
            value.savefig(path, dpi=110, bbox_inches="tight")
        else:
            shutil.copyfile(value, path)
        saved.append(path)
    return str(figure_rst(saved, gallery["src_dir"]))
