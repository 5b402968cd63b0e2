"""What refinement knows of a figure: the shape of its trunk, the lengths and the limits of its limbs."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from posekit.body import Figure
from posekit.body.angles import Limits
from posekit.geometry import Array
from posekit.skeleton import DOFS, HEAD, JOINT, LIMB_JOINTS, segment_name

TRUNK_JOINTS: Final = tuple(
    JOINT[name] for name in ("neck", "right_shoulder", "left_shoulder", "pelvis", "right_hip", "left_hip")
)
"""The joints of torso and hips: the first six of the tree."""

LIMB_STARTS, LIMB_MIDDLES, LIMB_ENDS = (tuple(limb[k] for limb in LIMB_JOINTS) for k in range(3))

ARM_LIMBS, LEG_LIMBS = slice(0, 2), slice(2, 4)

TRUNK_SEGMENTS: Final = ((0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3), (3, 4), (3, 5), (4, 5))
"""The nine distances of torso and hips."""

N_SHAPE_NUMBERS: Final = 9
"""Numbers that place the trunk's joints in their parts: see `FigureNumbers.shape`."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Bounds:
    """Limits of B balls or limbs, each of K angles, as the closed form's rotations.

    Parameters
    ----------
    lower, upper : array (B, K)
        Radians; a URDF joint that turns about minus the axis has its limits turned over.
    """

    lower: Array
    upper: Array


@dataclass(frozen=True, kw_only=True, eq=False)
class FigureNumbers:
    """A figure in numbers.

    Parameters
    ----------
    shape : array (9,)
        Metres. Torso frame (x forward, y left, z up, from the neck): the pelvis is at (0, 0, -b), the shoulders at
        (a, y, z), with a negative where they are behind; hips frame (from the pelvis): the hips at (0, y, -h). In the
        order b, a, right y, right z, left y, left z; h, right y, left y. The nine distances determine them.
    limbs : array (4, 2)
        Lengths of upper and lower segments, metres.
    head : array (5, 3)
        The head's points from the neck, head link's frame, metres.
    limb_bounds, pelvis_bounds, neck_bounds : Bounds
        (4, 4), (1, 3), (1, 3).
    middle_pelvis : bool
        Whether the pelvis is between the hips, which then turn with the spine (`posekit.body.frames.hips_frame`).
    """

    shape: Array
    limbs: Array
    head: Array
    limb_bounds: Bounds
    pelvis_bounds: Bounds
    neck_bounds: Bounds
    middle_pelvis: bool = False

    @staticmethod
    def of(figure: Figure, limits: Limits | None = None) -> FigureNumbers:
        """Read a figure; other limits than its own may be given."""
        points = figure.neutral_points
        pelvis = points[3]
        right_hip, left_hip = points[4] - pelvis, points[5] - pelvis
        shape = [
            -pelvis[2],
            points[1, 0],
            *points[1, 1:],
            *points[2, 1:],
            -right_hip[2],
            right_hip[1],
            left_hip[1],
        ]
        lengths = figure.lengths
        limbs = [
            [lengths[segment_name((a, b))] for a, b in ((limb[0], limb[1]), (limb[1], limb[2]))]
            for limb in LIMB_JOINTS
        ]
        limits = limits or figure.ik.limits
        first = [
            DOFS.index(f"{side}_{joint}.flexion")
            for joint in ("shoulder", "hip")
            for side in ("right", "left")
        ]
        return FigureNumbers(
            shape=np.array(shape),
            limbs=np.array(limbs),
            head=np.asarray(points[list(HEAD)] - points[0]),
            limb_bounds=_bounds(limits, first, 4),
            pelvis_bounds=_bounds(limits, [DOFS.index("pelvis.flexion")], 3),
            neck_bounds=_bounds(limits, [DOFS.index("neck.flexion")], 3),
            middle_pelvis=figure.pelvis_between_hips,
        )


def _bounds(limits: Limits, first: list[int], count: int) -> Bounds:
    rows = np.array(first)[:, None] + np.arange(count)
    low, high = limits.sign[rows] * limits.lower[rows], limits.sign[rows] * limits.upper[rows]
    return Bounds(lower=np.minimum(low, high), upper=np.maximum(low, high))
