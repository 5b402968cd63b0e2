"""Colours that are told apart by the colour-blind too (Okabe & Ito 2008)."""

from __future__ import annotations

from typing import Final

from posekit.skeleton import POINTS

Rgb = tuple[float, float, float]


def rgb(text: str) -> Rgb:
    """Read ``#rrggbb`` as three numbers from 0 to 1."""
    red, green, blue = (int(text[k : k + 2], 16) / 255 for k in (1, 3, 5))
    return red, green, blue


def number(colour: Rgb) -> int:
    """Return a colour as meshcat takes it, 0xrrggbb."""
    red, green, blue = (round(255 * part) for part in colour)
    return red << 16 | green << 8 | blue


RIGHT_RGB: Final = rgb("#e69f00")  # orange
LEFT_RGB: Final = rgb("#0072b2")  # blue
MIDDLE_RGB: Final = rgb("#9a9a9a")
ALARM_RGB: Final = rgb("#d4006a")
FRUSTUM_RGB: Final = rgb("#303030")

SIDE_RGB: Final = {"right": RIGHT_RGB, "left": LEFT_RGB, "": MIDDLE_RGB}

GROUP_RGB: Final = tuple(
    rgb(text)
    for text in ("#009e73", "#cc79a7", "#56b4e9", "#d55e00", "#f0e442", "#0072b2", "#e69f00", "#505050")
)
"""One colour a group; they start again after the last."""


def side(name: str) -> str:
    """Return the side that a joint, link or limb is on: ``right``, ``left`` or empty."""
    word = name.split("_", 1)[0]
    return word if word in SIDE_RGB else ""


POINT_SIDES: Final = tuple(side(name) for name in POINTS)
"""The side of each of `posekit.skeleton.POINTS`."""
