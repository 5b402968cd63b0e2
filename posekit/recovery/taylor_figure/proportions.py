"""The stick figure with the proportions of Taylor's Table 1."""

from __future__ import annotations

import math

import numpy as np

from posekit.body import Figure, load_figure
from posekit.body.lengths import hips_points, torso_points
from posekit.body.stature import MAX_STATURE_METRES, MIN_STATURE_METRES
from posekit.errors import FigureError
from posekit.skeleton import HEAD_POINTS, SEGMENTS, SIDES, segment_name

TABLE_1 = {
    "forearm": 14.0,
    "upper arm": 15.0,
    "shoulder girdle": 18.0,
    "foreleg": 20.0,
    "thigh": 19.0,
    "pelvic girdle": 14.0,
    "spine": 24.0,
    "height": 70.0,
}
"""Relative lengths of the human's segments (Taylor 2000, Table 1)."""


def figure_of(stature: float, figure: Figure | None = None) -> Figure:
    """Make the figure of a person of Table 1's proportions.

    Limbs and the widths of both girdles are the table's. It does not say how the torso is built inside: its shape is
    the stick figure's, scaled across by the girdles and along so that the way from the middle of the shoulders by the
    pelvis to the middle of the hips is the table's spine.

    Parameters
    ----------
    stature : float
        Standing height, metres; the table's is 70.
    figure : Figure, optional
        Whose torso, limits and bodies to take; the built-in one's unless told otherwise.

    Raises
    ------
    FigureError
        Where the stature is not a person's in metres.
    """
    if not (math.isfinite(stature) and MIN_STATURE_METRES <= stature <= MAX_STATURE_METRES):
        raise FigureError(
            f"stature is {stature:g} m; expected {MIN_STATURE_METRES} to {MAX_STATURE_METRES} m; is it in another unit?"
        )
    base = figure or load_figure()
    unit = stature / TABLE_1["height"]
    torso, hips = torso_points(base.lengths), hips_points(base.lengths)
    across = TABLE_1["shoulder girdle"] * unit / (torso[2, 1] - torso[1, 1])
    torso *= [across, across, 1.0]
    hips *= [1.0, TABLE_1["pelvic girdle"] * unit / (hips[2, 1] - hips[1, 1]), 1.0]
    along = _along(torso, hips, TABLE_1["spine"] * unit)
    torso *= [1.0, 1.0, along]
    hips *= [1.0, 1.0, along]
    place = dict(enumerate(torso)) | {4: hips[1] + torso[3], 5: hips[2] + torso[3]}
    lengths = {
        segment_name((a, b)): float(np.linalg.norm(place[a] - place[b]))
        for a, b in SEGMENTS
        if a in place and b in place
    }
    for side in SIDES:
        lengths[f"{side}_shoulder-{side}_elbow"] = TABLE_1["upper arm"] * unit
        lengths[f"{side}_elbow-{side}_wrist"] = TABLE_1["forearm"] * unit
        lengths[f"{side}_hip-{side}_knee"] = TABLE_1["thigh"] * unit
        lengths[f"{side}_knee-{side}_ankle"] = TABLE_1["foreleg"] * unit
    ratio = lengths["neck-pelvis"] / base.lengths["neck-pelvis"]
    head = {name: base.head_points[k + 1] * ratio for k, name in enumerate(HEAD_POINTS)}
    return base.scaled(lengths, head)


def _along(torso: np.ndarray, hips: np.ndarray, spine: float) -> float:
    r"""Return the factor z along the body at which the spine has its length.

    With f forward and a along from the middle of the shoulders to the pelvis, and b from there to the hips,
    :math:`\sqrt{f^2 + a^2 z^2} + b z = l`, a quadratic in z whose smaller root has :math:`b z < l`.
    """
    above = (torso[1] + torso[2]) / 2 - torso[3]
    f = above[0]
    a, b = float(np.hypot(above[1], above[2])), float(np.linalg.norm((hips[1] + hips[2]) / 2))
    # (a^2 - b^2) z^2 + 2 b l z + f^2 - l^2 = 0
    root = math.sqrt((b * spine) ** 2 + (a**2 - b**2) * (spine**2 - f**2))
    return float((spine**2 - f**2) / (b * spine + root))
