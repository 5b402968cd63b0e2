"""The rigid parts from their distances: where shoulders and hips lie for given segment lengths."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from posekit.errors import FigureError
from posekit.geometry import Array
from posekit.skeleton import SEGMENT_NAMES

FLAT_DEPTH_SQUARED = 1e-9
"""Squared depth (m^2) down to which a torso that cannot quite close counts as flat (rounded lengths)."""


def check_lengths(lengths: Mapping[str, float]) -> None:
    """Refuse lengths that are unknown, not finite or not positive."""
    for name, length in lengths.items():
        if name not in SEGMENT_NAMES:
            raise FigureError(
                f"figure.lengths: {name!r} is not a segment; expected one of {', '.join(SEGMENT_NAMES)}"
            )
        if not (math.isfinite(length) and length > 0):
            raise FigureError(f"figure.lengths: {name} is {length:g} m; expected a positive, finite length")


def torso_points(lengths: Mapping[str, float], *, behind: bool = False) -> Array:
    r"""Place neck, right shoulder, left shoulder and pelvis by their six distances.

    With the neck at the origin and the pelvis straight below, each shoulder lies on a circle about that
    line: height :math:`h = (a^2 + b^2 - c^2) / 2b` below the neck and radius :math:`\sqrt{a^2 - h^2}`, for
    neck-shoulder a, neck-pelvis b, shoulder-pelvis c. The line between the shoulders gives the angle
    between the two, and its part across the body the left axis. The distances leave the side open: the
    shoulders are put in front, unless they are said to be `behind`.

    Parameters
    ----------
    lengths : mapping
        Metres, by segment name.
    behind : bool
        Whether the shoulders lie behind the line from neck to pelvis.

    Returns
    -------
    array (4, 3)
        Torso frame of the URDF (x forward, y left, z up), metres.

    Raises
    ------
    FigureError
        Where no such body exists: a triangle does not close, or the shoulders are too far apart or too near.
    """
    right, left, forward_squared = _torso(lengths)
    if forward_squared < -FLAT_DEPTH_SQUARED:
        width, (z_right, r_right), (z_left, r_left) = (
            lengths["right_shoulder-left_shoulder"],
            right[:2],
            left[:2],
        )
        reach = r_right + r_left
        raise FigureError(
            f"figure.lengths: right_shoulder-left_shoulder is {width:g} m, but with the other torso lengths "
            f"it must lie between {math.hypot(r_right - r_left, z_right - z_left):g} and "
            f"{math.hypot(reach, z_right - z_left):g} m; correct one of the torso's six lengths"
        )
    forward = math.sqrt(max(forward_squared, 0.0))
    if behind:
        forward = -forward
    return np.array(
        [
            [0.0, 0.0, 0.0],
            [forward, right[2], -right[0]],
            [forward, left[2], -left[0]],
            [0.0, 0.0, -lengths["neck-pelvis"]],
        ]
    )


def forward_squared(lengths: Mapping[str, float]) -> float:
    """Return the square of how far the shoulders lie beside the line from neck to pelvis, forward or back (m^2).

    Negative where the six distances close in no space: how much is missing.
    """
    return _torso(lengths)[2]


def _torso(
    lengths: Mapping[str, float],
) -> tuple[tuple[float, float, float], tuple[float, float, float], float]:
    """Return depth, radius and place across of right and left shoulder, and the square of their place forward."""
    right = _apex("neck", "right_shoulder", "pelvis", lengths)
    left = _apex("neck", "left_shoulder", "pelvis", lengths)
    width = lengths["right_shoulder-left_shoulder"]
    across_squared = width**2 - (right[0] - left[0]) ** 2
    if across_squared <= 0:
        raise FigureError(
            f"figure.lengths: right_shoulder-left_shoulder is {width:g} m, but the shoulders' heights differ "
            f"by {abs(right[0] - left[0]):g} m; lengthen it or make the two sides more alike"
        )
    across = math.sqrt(across_squared)
    middle = (left[1] ** 2 - right[1] ** 2) / across
    y_left, y_right = (middle + across) / 2, (middle - across) / 2
    return (*right, y_right), (*left, y_left), right[1] ** 2 - y_right**2


def hips_points(lengths: Mapping[str, float]) -> Array:
    """Place pelvis, right hip and left hip by their three distances; the pelvis may lie between the hips.

    Returns
    -------
    array (3, 3)
        Hips frame of the URDF: origin the pelvis, y along the line of the hips, z up; metres.
    """
    base = lengths["right_hip-left_hip"]
    offset, height = _apex("right_hip", "pelvis", "left_hip", lengths)
    return np.array([[0.0, 0.0, 0.0], [0.0, -offset, -height], [0.0, base - offset, -height]])


def _apex(start: str, apex: str, end: str, lengths: Mapping[str, float]) -> tuple[float, float]:
    """Return how far along start-end, and how far from that line, the third corner of a triangle is."""
    base = _length(start, end, lengths)
    near = _length(start, apex, lengths)
    far = _length(apex, end, lengths)
    along = (base**2 + near**2 - far**2) / (2 * base)
    squared = near**2 - along**2
    if squared < -FLAT_DEPTH_SQUARED:
        raise FigureError(
            f"figure.lengths: the triangle {start}, {apex}, {end} does not close with {base:g}, {near:g} and "
            f"{far:g} m; each must be at most the sum of the other two"
        )
    return along, math.sqrt(max(squared, 0.0))


def _length(a: str, b: str, lengths: Mapping[str, float]) -> float:
    return lengths[f"{a}-{b}"] if f"{a}-{b}" in lengths else lengths[f"{b}-{a}"]
