r"""Image points of a trunk of which a picture shows a part: what is not seen is where its neighbours leave it.

Two shoulders have the neck between them, and the pelvis lies on the line from there to the middle of the hips, beside
which the figure's own are: the waist bends. What neither tells hangs on the nearest joint that is seen. At the distance
l in an unknown direction, each coordinate deviates by :math:`l / \sqrt 3`.
"""

from __future__ import annotations

import math
from collections.abc import Collection
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from posekit.body import Figure
from posekit.geometry import Array
from posekit.skeleton import JOINT, JOINTS, N_TRUNK_JOINTS
from posekit.views.person_view import pelvis_fraction

FEWEST_TRUNK_JOINTS: Final = 2
"""Of the trunk's joints that have to be seen: one alone says nothing of how the body stands."""


class SeenTrunk(NamedTuple):
    """F pictures with a point for each joint of the trunk.

    Attributes
    ----------
    image : array (F, 14, 2)
        Pixels; those of limbs that were not seen stay NaN.
    offset : array (F, 14)
        Standard deviation of each coordinate from the joint, metres.
    told : bool array (F, 14)
        Joints that were seen, and those between two that were.
    reasons : list of str
        For each picture what is missing, or an empty text.
    """

    image: Array
    offset: Array
    told: NDArray[np.bool_]
    reasons: list[str]


def with_trunk(image: Array, figure: Figure, offset: Array, derived: Collection[str] = ()) -> SeenTrunk:
    """Put the joints of the trunk that are not seen where those that are leave them.

    Parameters
    ----------
    image : array (F, 14, 2)
        Pixels; NaN where not seen.
    figure : Figure
        Whose trunk it is.
    offset : array (14,)
        Standard deviation of what is seen, metres.
    derived : collection of str
        Joints that were put between others by now, and are no more seen than those that are put so here.
    """
    image = image.copy()
    offsets = np.broadcast_to(offset, image.shape[:2]).copy()
    seen = np.asarray(np.isfinite(image).all(axis=2))
    seen[:, [JOINT[name] for name in derived]] = False
    reasons = [_missing(one) for one in seen[:, :N_TRUNK_JOINTS].tolist()]
    neck, right, left, pelvis, right_hip, left_hip = range(N_TRUNK_JOINTS)
    fraction = pelvis_fraction(figure)
    shoulders = (image[:, right] + image[:, left]) / 2
    hips = (image[:, right_hip] + image[:, left_hip]) / 2
    own = figure.neutral_points
    for joint, between, sides in (
        (neck, shoulders, (right, left)),
        (pelvis, shoulders + fraction * (hips - shoulders), (right_hip, left_hip)),
    ):
        rows = np.flatnonzero(~seen[:, joint] & np.isfinite(between).all(axis=1))
        image[rows, joint] = between[rows]
        beside = float(np.linalg.norm(own[joint] - own[list(sides)].mean(axis=0)))
        offsets[rows, joint] = np.hypot(offset[joint], beside / math.sqrt(3))
        seen[rows, joint] = True
    apart = np.linalg.norm(own[:N_TRUNK_JOINTS, None] - own[None, :N_TRUNK_JOINTS], axis=2)
    for joint in range(N_TRUNK_JOINTS):
        rows = np.flatnonzero(~seen[:, joint] & seen[:, :N_TRUNK_JOINTS].any(axis=1))
        nearest = np.where(seen[rows, :N_TRUNK_JOINTS], apart[joint], np.inf).argmin(axis=1)
        image[rows, joint] = image[rows, nearest]
        offsets[rows, joint] = np.hypot(offsets[rows, nearest], apart[joint, nearest] / math.sqrt(3))
    return SeenTrunk(image, offsets, seen, reasons)


def _missing(seen: list[bool]) -> str:
    """Say what of a trunk is missing, where too little of it is seen."""
    there = [name for name, one in zip(JOINTS, seen, strict=False) if one]
    if len(there) >= FEWEST_TRUNK_JOINTS:
        return ""
    names = ", ".join(JOINTS[:N_TRUNK_JOINTS])
    one = f"only {there[0]}" if there else "none"
    return f"{one} of {names} is seen; a posture needs at least {FEWEST_TRUNK_JOINTS} of them"
