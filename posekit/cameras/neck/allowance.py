"""How far lengths may be off in a frame, from how far its image points may be."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from posekit.body import Figure
from posekit.cameras import PinholeCamera
from posekit.cameras.neck.body import sight
from posekit.cameras.neck.given import PlacementInput
from posekit.geometry import Array
from posekit.skeleton import HIPS, JOINT, TORSO

RIGID_SIGMAS, TANGENT_SIGMAS = 3.0, 4.0
r"""Standard deviations of an image point, in metres at the body, by which a rigid distance and a segment may be off.

A segment is too short for its image by the errors of its two ends, and one of thirteen is the worst. A rigid distance
lies between two joints that are lifted, and a segment of length l across the line of sight that is seen too short by
:math:`\sigma` is lifted to :math:`\sqrt{2 l \sigma}` before or behind its end: that is added, for a shoulder. How
often the truth is within both: docs, "Where the body is".
"""

EXACT_RIGID, EXACT_TANGENT = 1e-8, 1e-9
"""Metres: rounding."""

RIGID_JOINTS = sorted({JOINT[name] for name in (*TORSO, *HIPS)})


class NeckAllowance(NamedTuple):
    """Metres by which rigid distances may be off, and segments too short for their image, in F frames (F,)."""

    rigid: Array
    tangent: Array


def allowances(camera: PinholeCamera, figure: Figure, given: PlacementInput) -> NeckAllowance:
    """Take the tolerances that are given, and derive those that are not.

    The deviation of an image point is taken to metres at the farthest depth that the image leaves the neck.
    """
    frames = len(given.image)
    rigid, tangent = (
        np.full(frames, np.nan if value is None else value)
        for value in (given.settings.tolerance, given.settings.tangent)
    )
    if given.settings.tolerance is not None and given.settings.tangent is not None:
        return NeckAllowance(rigid, tangent)
    first = _sigma(camera, figure, given, np.zeros(frames))
    # The image as it is, with its errors, leaves too little room, with their allowance too much: between the two.
    sigma = (first + _sigma(camera, figure, given, TANGENT_SIGMAS * first)) / 2
    if given.settings.tolerance is None:
        shoulder = (figure.lengths["neck-right_shoulder"] + figure.lengths["neck-left_shoulder"]) / 2
        rigid = np.maximum(RIGID_SIGMAS * sigma + np.sqrt(2 * shoulder * sigma), EXACT_RIGID)
    if given.settings.tangent is None:
        tangent = np.maximum(TANGENT_SIGMAS * sigma, EXACT_TANGENT)
    return NeckAllowance(rigid, tangent)


def _sigma(camera: PinholeCamera, figure: Figure, given: PlacementInput, tangent: Array) -> Array:
    """Return the deviation of the rigid parts' image points in metres, at the farthest depth of the neck (F,)."""
    seen = sight(camera, figure, given.image, tangent)
    depth = seen.farthest[:, 0] * seen.rays[:, 0, 2]
    depth = np.where(np.isfinite(depth), depth, 0.0)
    f = np.broadcast_to(camera.K, (len(depth), 3, 3))[:, 0, 0]
    variance = (given.deviation[:, RIGID_JOINTS] * (depth / f)[:, None]) ** 2 + given.offset[
        RIGID_JOINTS
    ] ** 2
    known = np.isfinite(given.image[:, RIGID_JOINTS, 0])
    sigma: Array = np.sqrt((variance * known).sum(axis=1) / np.maximum(known.sum(axis=1), 1))
    return sigma
