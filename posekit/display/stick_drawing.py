"""Small drawings of postures as SVG text: the body from its front and from its side.

Right limbs are orange and left ones blue, which the colour-blind tell apart, too (Okabe & Ito 2008).
"""

from __future__ import annotations

import html
from collections.abc import Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from posekit.skeleton import JOINT, LIMB_SEGMENTS, SEGMENTS

Array = NDArray[np.float64]

PANEL_PIXELS: Final = 150
"""Width and height of a panel."""
EDGE_PIXELS: Final = 10
"""Around what is drawn in it."""
SIDE_COLOURS: Final = {"right": "#e69f00", "left": "#0072b2", "": "#808080"}
FADED_OPACITY: Final = 0.18
"""Opacity of postures that are not the first."""
_LEAST: Final = 1e-9


def posture_drawing(postures: Array, up: Array) -> str:
    """Draw postures over each other, from the front and from the side of the first; those after it are faded.

    Parameters
    ----------
    postures : array (K, 14, 3)
        Joints in tree order, any unit; NaN where unknown.
    up : array (3,)
        The direction that is drawn upward.

    Returns
    -------
    str
        SVG that loads nothing; empty where no joint is known.
    """
    if not len(postures):
        return ""
    right, forward, upward = body_axes(postures[0], up)
    front = np.stack([postures @ -right, -(postures @ upward)], axis=-1)
    side = np.stack([postures @ forward, -(postures @ upward)], axis=-1)
    return _svg([(front, "front"), (side, "side")])


def image_drawing(points: Array) -> str:
    """Draw a body as a picture shows it.

    Parameters
    ----------
    points : array (14, 2)
        Joints in tree order, x to the right, y down; NaN where not seen.
    """
    return _svg([(points[None], "image")])


def points_drawing(points: Array, up: Array) -> str:
    """Draw points that are no joints of the figure as dots, from two sides.

    Parameters
    ----------
    points : array (P, 3)
        Any unit; NaN where missing.
    up : array (3,)
        The direction that is drawn upward.
    """
    first, second, upward = level_axes(up)
    panels = [np.stack([points @ axis, -(points @ upward)], axis=-1)[None] for axis in (first, second)]
    return _svg([(panels[0], "from one side"), (panels[1], "from another")], dots=True)


def shares_drawing(shares: Sequence[tuple[str, int, str]]) -> str:
    """Draw how many there are of each kind as one bar.

    Parameters
    ----------
    shares : sequence of (str, int, str)
        Name, number and colour of each.
    """
    total = sum(count for _, count, _ in shares)
    width, start, parts = 2 * PANEL_PIXELS, 0.0, []
    for name, count, colour in shares:
        long = width * count / max(total, 1)
        title = f"<title>{html.escape(name)}: {count}</title>"
        parts.append(f'<rect x="{start:.1f}" width="{long:.1f}" height="14" fill="{colour}">{title}</rect>')
        start += long
    return _document(width, 14, parts) if total else ""


def body_axes(posture: Array, up: Array) -> tuple[Array, Array, Array]:
    """Return where a body's right, its front and up are, at right angles to each other.

    Parameters
    ----------
    posture : array (14, 3)
        Joints in tree order.
    up : array (3,)
        Up.
    """
    first, _, upward = level_axes(up)
    for part in ("shoulder", "hip"):
        across = posture[JOINT[f"right_{part}"]] - posture[JOINT[f"left_{part}"]]
        level = across - (across @ upward) * upward
        if np.isfinite(level).all() and np.linalg.norm(level) > _LEAST:
            first = level / np.linalg.norm(level)
            break
    return first, np.cross(upward, first), upward


def level_axes(up: Array) -> tuple[Array, Array, Array]:
    """Return two level directions and up, at right angles to each other.

    Parameters
    ----------
    up : array (3,)
        Up, of any length.
    """
    upward = np.asarray(up, dtype=np.float64) / np.linalg.norm(up)
    axis = np.eye(3)[int(np.argmin(np.abs(upward)))]
    first = axis - (axis @ upward) * upward
    first /= np.linalg.norm(first)
    return first, np.cross(upward, first), upward


def _svg(panels: Sequence[tuple[Array, str]], *, dots: bool = False) -> str:
    """Draw panels of postures (K, P, 2) beside each other, all on one scale; nothing where no point is known."""
    if not all(len(_known(points)) for points, _ in panels):
        return ""
    size = max(float(np.nanmax(np.ptp(_known(points), axis=0))) for points, _ in panels)
    scale = (PANEL_PIXELS - 2 * EDGE_PIXELS) / max(size, _LEAST)
    parts = []
    for k, (points, title) in enumerate(panels):
        known = _known(points)
        middle = (known.min(axis=0) + known.max(axis=0)) / 2
        placed = (points - middle) * scale + PANEL_PIXELS / 2
        lines = [
            f'<g opacity="{1.0 if row == 0 else FADED_OPACITY}">{_dots(one) if dots else _sticks(one)}</g>'
            for row, one in reversed(list(enumerate(placed)))
        ]
        parts.append(
            f'<g transform="translate({k * PANEL_PIXELS} 0)"><title>{title}</title>{"".join(lines)}</g>'
        )
    return _document(len(panels) * PANEL_PIXELS, PANEL_PIXELS, parts)


def _known(points: Array) -> Array:
    flat = points.reshape(-1, 2)
    return flat[np.isfinite(flat).all(axis=1)]


def _sticks(points: Array) -> str:
    """Draw the segments between known joints (14, 2), limbs above the trunk."""
    trunk = [pair for pair in SEGMENTS if pair not in LIMB_SEGMENTS]
    lines = []
    for a, b in (*trunk, *LIMB_SEGMENTS):
        if np.isfinite(points[[a, b]]).all():
            (x1, y1), (x2, y2) = points[[a, b]].tolist()
            colour = SIDE_COLOURS[_side(b) if _side(a) == _side(b) else ""]
            lines.append(f'<line x1="{x1:.1f}" y1="{y1:.1f}" x2="{x2:.1f}" y2="{y2:.1f}" stroke="{colour}"/>')
    return f'<g stroke-width="3" stroke-linecap="round">{"".join(lines)}</g>'


def _dots(points: Array) -> str:
    return "".join(
        f'<circle cx="{x:.1f}" cy="{y:.1f}" r="2" fill="{SIDE_COLOURS[""]}"/>'
        for x, y in _known(points).tolist()
    )


_NAMES: Final = tuple(JOINT)


def _side(joint: int) -> str:
    first = _NAMES[joint].partition("_")[0]
    return first if first in SIDE_COLOURS else ""


def _document(width: int, height: int, parts: Sequence[str]) -> str:
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{width}" height="{height}" '
        f'viewBox="0 0 {width} {height}" role="img">{"".join(parts)}</svg>'
    )
