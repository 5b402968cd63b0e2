"""Which end of each segment is nearer to the camera, and how sure that is."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from posekit.geometry import Array
from posekit.skeleton import JOINT, PARENTS

ANSWER_SEGMENTS: Final = tuple(
    (JOINT[start], JOINT[end])
    for start, end in (
        ("right_shoulder", "right_elbow"),
        ("right_elbow", "right_wrist"),
        ("left_shoulder", "left_elbow"),
        ("left_elbow", "left_wrist"),
        ("right_hip", "right_knee"),
        ("right_knee", "right_ankle"),
        ("left_hip", "left_knee"),
        ("left_knee", "left_ankle"),
        ("left_shoulder", "right_shoulder"),
        ("left_hip", "right_hip"),
        ("pelvis", "neck"),
    )
)
"""Start and end of the segments of which an answer says which end is nearer: eight of limbs, three of the trunk."""

LEVEL_METRES: Final = 0.05
"""Metres of depth up to which neither end is nearer: a segment that lies across the line of sight."""

_erf = np.frompyfunc(math.erf, 1, 1)


@dataclass(frozen=True, kw_only=True, eq=False)
class DepthOrder:
    """Probabilities that the end of each of the 11 segments of `ANSWER_SEGMENTS` is nearer than its start, or farther.

    What is missing to one is the probability that it is neither, by 5 cm of depth, or that no listed body is right.

    Parameters
    ----------
    near, far : array (11,)
        Probabilities; NaN where an end is not known.
    unlisted : float
        The probability that no listed body is right.
    """

    near: Array
    far: Array
    unlisted: float = 0.0

    def __post_init__(self) -> None:
        for values in (self.near, self.far):
            values.flags.writeable = False

    @property
    def level(self) -> Array:
        """The probability that neither end is nearer by 5 cm (11,)."""
        return np.maximum(1.0 - self.unlisted - self.near - self.far, 0.0)


def depth_orders(
    depth: Array, variance: Array, frame: NDArray[np.intp], probability: Array, unlisted: Array
) -> list[DepthOrder]:
    r"""Find the probabilities of near and far of every frame.

    A body's is :math:`\Phi((-5 cm - d)/\sigma)`, with d the depth of the end less that of the start. Joints are lifted
    one from the other, so that the variance of an end is its start's and the segment's own: :math:`\sigma^2` is
    their difference. Shoulders and hips turn about the middle: theirs adds up the deviations of both from it.

    Parameters
    ----------
    depth : array (N, 14)
        Of the joints of all bodies of all frames, metres.
    variance : array (N, 14)
        Of each depth, square metres; NaN where it is not known, and neither are then the segments that end there.
    frame : int array (N,)
        The frame of each body.
    probability : array (N,)
        Of each body in its frame.
    unlisted : array (F,)
        The probability that it is none of these, by frame.
    """
    frames = len(unlisted)
    start, end = np.array(ANSWER_SEGMENTS).T
    gap = depth[:, end] - depth[:, start]
    own = np.abs(variance[:, end] - variance[:, start])
    middle = np.array(PARENTS)[start]
    turned = middle == np.array(PARENTS)[end]
    both = [np.sqrt(np.abs(variance[:, side[turned]] - variance[:, middle[turned]])) for side in (start, end)]
    own[:, turned] = (both[0] + both[1]) ** 2
    spread = np.sqrt(2.0 * np.maximum(own, LEAST_DEVIATION_METRES**2))
    found = np.empty((2, frames, len(start)))
    for sign, into in zip((-1.0, 1.0), found, strict=True):
        beyond = 0.5 * (1.0 + np.asarray(_erf((sign * gap - LEVEL_METRES) / spread), dtype=np.float64))
        for column in range(len(start)):
            into[:, column] = np.bincount(frame, probability * beyond[:, column], minlength=frames)
    empty = np.bincount(frame, minlength=frames) == 0
    found[:, empty] = np.nan
    found *= 1.0 - unlisted[:, None]
    return [
        DepthOrder(near=near, far=far, unlisted=rest)
        for (near, far), rest in zip(found.transpose(1, 0, 2), unlisted.tolist(), strict=True)
    ]


LEAST_DEVIATION_METRES: Final = 1e-3
"""Metres: no depth is taken to be better known."""
