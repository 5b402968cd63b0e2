"""Draw docs/pictures/layers.svg: the rooms of posekit, as the layers in pyproject.toml have them.

python docs/make_layers.py
"""

from __future__ import annotations

import re
import tomllib
from pathlib import Path
from typing import Final
from xml.sax.saxutils import escape

ROOT: Final = Path(__file__).parents[1]
PICTURE: Final = ROOT / "docs/pictures/layers.svg"
WIDTH, ROW_HEIGHT, GAP, MARGIN = 720, 22, 6, 12
"""Pixels: the picture, a layer, what is left between boxes, and around all of them."""
AT_THE_TOP: Final = ("validators", "viewer")
"""Rooms that are folders of their own beside the package, installed in it."""


def layers() -> list[list[str]]:
    """Return the rooms by layer, the highest first, as import-linter holds them."""
    tables = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    contracts = tables["tool"]["importlinter"]["contracts"]
    (contract,) = (one for one in contracts if one["type"] == "layers")
    return [re.findall(r"\w+", layer) for layer in contract["layers"]]


def svg() -> str:
    """Return the picture: a row a layer, a box a room."""
    found = layers()
    height = 2 * MARGIN + len(found) * (ROW_HEIGHT + GAP) - GAP
    style = 'font-family="sans-serif" font-size="13" text-anchor="middle" dominant-baseline="central"'
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {height}" {style}>',
        f'<rect width="{WIDTH}" height="{height}" fill="#ffffff"/>',
    ]
    for row, rooms in enumerate(found):
        y = MARGIN + row * (ROW_HEIGHT + GAP)
        width = (WIDTH - 2 * MARGIN - GAP * (len(rooms) - 1)) / len(rooms)
        for column, room in enumerate(rooms):
            x = MARGIN + column * (width + GAP)
            fill = "#fde9c9" if room in AT_THE_TOP else "#dbe8f6"
            parts.append(
                f'<rect x="{x:g}" y="{y}" width="{width:g}" height="{ROW_HEIGHT}" rx="4" fill="{fill}" '
                'stroke="#5b7083"/>'
            )
            parts.append(f'<text x="{x + width / 2:g}" y="{y + ROW_HEIGHT / 2:g}">{escape(room)}</text>')
    return "\n".join([*parts, "</svg>", ""])


if __name__ == "__main__":
    PICTURE.write_text(svg(), encoding="utf-8")
