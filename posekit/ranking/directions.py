r"""A posture as unit vectors in the torso's frame: smooth where angles are not, and turning with it.

The torso's axes are those of `posekit.body.frames.torso_frame`: x forward, y left, z from the pelvis to the neck. In
them are told the hips' left and down, the eight segments of the limbs, and, where it is known, which way is up.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from posekit.body.frames import MIDDLE_PELVIS_PART
from posekit.geometry import Array, cross, dot, perpendicular, unit
from posekit.skeleton import JOINT, SIDES, segment_name

LIMB_SEGMENT_ENDS: Final = (("shoulder", "elbow"), ("elbow", "wrist"), ("hip", "knee"), ("knee", "ankle"))

LIMB_SEGMENTS: Final = tuple(
    (JOINT[f"{side}_{start}"], JOINT[f"{side}_{end}"]) for side in SIDES for start, end in LIMB_SEGMENT_ENDS
)
"""The segments of the limbs: upper arm, forearm, thigh and shank, the right ones first."""

SEGMENT_STARTS, SEGMENT_ENDS = np.array(LIMB_SEGMENTS).T
"""Their first and their last joints."""

DIRECTION_NAMES: Final = ("hips.left", "hips.down", *map(segment_name, LIMB_SEGMENTS), "up")
"""The eleven directions; `up` is the last, so that what is known without it comes first."""

UP_INDEX: Final = len(DIRECTION_NAMES) - 1


def directions(joints: Array, up: Array | None = None) -> Array:
    """Tell postures by their directions.

    Parameters
    ----------
    joints : array (14, 3, N)
        Any right-handed frame; NaN where a joint is not known.
    up : array (3, N) or (3, 1), optional
        Unit vectors against gravity, in the same frame.

    Returns
    -------
    array (11, 3, N), or (10, 3, N) without `up`
        Unit vectors in the torso's frame, in the order of `DIRECTION_NAMES`; NaN where one of their joints is not
        known, all of them where neck, a shoulder or the pelvis is not.
    """
    neck, right, left, pelvis = joints[:4]
    down = unit(pelvis - neck, axis=-2)
    left_axis = unit(perpendicular(left - right, down, axis=-2), axis=-2)
    axes = np.stack([cross(down, left_axis, axis=-2), left_axis, -down])
    hips_left, hips_down = _hips(joints)
    found = np.empty((UP_INDEX + (up is not None), 3, joints.shape[2]))
    found[0], found[1] = hips_left, hips_down
    found[2:UP_INDEX] = unit(joints[SEGMENT_ENDS] - joints[SEGMENT_STARTS], axis=-2)
    if up is not None:
        found[UP_INDEX] = up
    # As the torso has them: its axes are the rows of the rotation.
    return dot(found[:, None], axes[None], axis=-2)


def mirrored(found: Array) -> Array:
    """Return the directions (D, 3, N) of the same postures with left and right exchanged.

    In a mirror y turns round; the hips' left is drawn from the other hip to the one, and so turns round once more.
    """
    image = found * np.array([1.0, -1.0, 1.0])[:, None]
    image[0] *= -1.0
    order = [0, 1, *range(6, 10), *range(2, 6), *range(10, len(found))]
    return np.asarray(image[order])


def rows_of(names: tuple[str, ...]) -> NDArray[np.intp]:
    """Return where the components of some directions stand among all (3 a direction)."""
    first = 3 * np.array([DIRECTION_NAMES.index(name) for name in names], dtype=np.intp)
    return np.asarray((first[:, None] + np.arange(3)).ravel())


def _hips(joints: Array) -> tuple[Array, Array]:
    """Return the hips' left, and their down square to it, (3, N); no down where the pelvis is between the hips."""
    pelvis, right, left = joints[JOINT["pelvis"]], joints[JOINT["right_hip"]], joints[JOINT["left_hip"]]
    line = left - right
    left_axis = unit(line, axis=-2)
    down = perpendicular(right - pelvis, left_axis, axis=-2)
    flat = dot(down, down, axis=-2) < MIDDLE_PELVIS_PART**2 * dot(line, line, axis=-2)
    return left_axis, np.where(flat, np.nan, unit(down, axis=-2))
