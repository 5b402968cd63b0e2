"""Where the numbers of a posture, of what was seen of it, and of its figure stand in the arrays that loops take."""

from __future__ import annotations

AT_ROOT, AT_TORSO, AT_HIPS, AT_HEAD, AT_DIRECTIONS, AT_SHAPE, AT_LIMBS = 0, 3, 12, 21, 30, 54, 63
"""A posture (71,): root; torso, hips and head, row by row; directions of segments; trunk's shape; limbs' lengths."""

AT_CAMERA, ROOT_PRIOR, ROOT_WEIGHT, AT_FREE, AT_POINTS = 0, 12, 15, 24, 28
"""What was seen of it: the camera; where the neck is known to be, and its whitening; limbs without limits; points.

A point is u, v and one over its deviation, pixels: the joints, then the head's.
"""

(
    CAMERA_PERSPECTIVE,
    CAMERA_FOCAL,
    CAMERA_SKEW,
    CAMERA_FOCAL_V,
    CAMERA_CENTRE,
    CAMERA_DISTORTED,
    CAMERA_DISTORTION,
) = 0, 1, 2, 3, 4, 6, 7
"""A camera: whether it is a pinhole camera, its focal lengths and centre, and Brown's five coefficients, if any."""

(
    VARIED_SHAPE,
    VARIED_LIMBS,
    LIMIT_SCALE,
    HAS_WALLS,
    LEGS_ON_TORSO,
    TRUNK_ONLY,
    MIDDLE_PELVIS,
    HEAD_COUNT,
    BRANCH_COUNT,
) = range(9)
"""A figure: what is varied, one over the limits' deviation (0: no limits), what limits are, how many head points."""

(
    BOX_BRANCHES,
    SHAPE_WEIGHTS,
    SHAPE_SQUARES,
    LIMB_WEIGHTS,
    LIMB_OWN,
    LIMB_BOX,
    PELVIS_BOX,
    NECK_BOX,
    HEAD_OFFSETS,
) = (
    9,
    17,
    26,
    35,
    43,
    51,
    83,
    89,
    95,
)
"""Euler branch and side of the hinge, four of them; weights of the trunk's nine distances, and their squares; weights
and lengths of limbs' segments; middles, then halves, of the limbs' boxes of angles, limb by limb, and of two balls;
then the head's points."""

HIP_LIMITS, NECK_LIMITS, LIMIT_COUNT = 16, 19, 22
"""Limits that are passed: those of the limbs, limb by limb, then those of pelvis and neck."""

LIMB_STARTS = (1, 2, 4, 5)
"""The joint of the trunk at which each limb starts."""

LIMB_MIDDLES, LIMB_ENDS = (6, 7, 10, 11), (8, 9, 12, 13)
"""The joints in the middle and at the end of each limb."""
