"""Limbs brought back to the length that the person's have."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

import numpy as np
from numpy.typing import NDArray

from posekit.geometry import Array, runs
from posekit.skeleton import FEET_POINTS, LIMB_JOINTS, POINTS, SEGMENT_NAMES, segment_name

RAMP_FRAMES: Final = 6
"""Frames before and after a span over which a length may have drifted there."""

SEEN_SHARE: Final = 2e-3
"""Of a length: what is off by less has not drifted."""


def with_lengths(points: Array, bad: NDArray[np.bool_], lengths: Mapping[str, float]) -> Array:
    """Give limbs' segments their lengths in spans of frames; what hangs on them moves along.

    Parameters
    ----------
    points : array (T, 23, 3)
        Joints, head, feet.
    bad : bool array (T, 17)
        Where which of `posekit.skeleton.SEGMENT_NAMES` has drifted.
    lengths : mapping
        Metres, by segment name.
    """
    out = points.copy()
    for limb, joints in enumerate(LIMB_JOINTS):
        for start, end in ((joints[0], joints[1]), (joints[1], joints[2])):
            name = segment_name((start, end))
            spans = np.zeros(len(points), dtype=np.bool_)
            for first, stop in runs(bad[:, SEGMENT_NAMES.index(name)]):
                spans[max(first - RAMP_FRAMES, 0) : stop + RAMP_FRAMES] = True
            vector = out[:, end] - out[:, start]
            length = np.linalg.norm(vector, axis=-1)
            off = spans & (np.abs(length - lengths[name]) > SEEN_SHARE * lengths[name])
            way = vector[off] * (lengths[name] / length[off] - 1)[:, None]
            beyond = [joint for joint in joints if joints.index(joint) >= joints.index(end)]
            if limb > 1:
                side = ("right", "left")[limb % 2]
                beyond += [len(POINTS) + k for k, foot in enumerate(FEET_POINTS) if foot.startswith(side)]
            for mark in beyond:
                out[off, mark] += way
    return out
