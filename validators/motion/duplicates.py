"""Frames that are the one before again, while the body moves."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from posekit.geometry import Array, runs
from posekit.validators.motion.timeline import norm

SAME_METRES: Final = 1e-6
"""Below it two positions are one, written once as 32 bits and once as 64; nobody who is measured stands so still."""

MOVED_METRES: Final = 1e-3
"""The body moves where its fastest joint goes farther than this in a frame: coarse rounding alone makes no
duplicate."""

NEAR_FRAMES: Final = 3
"""Frames before and after a run in which the body must move."""


def duplicates(joints: Array) -> NDArray[np.intp]:
    """Say how many frames in a row are the one before again, at each frame (T,): 0 where it is none of them.

    Parameters
    ----------
    joints : array (T, 14, 3)
        Metres, frame after frame; a joint that is unknown in both frames is the same.

    Notes
    -----
    A run of the same frames counts where the body moves by more than a millimetre a frame shortly before it and
    shortly after it; at an end of the clip on the side that there is. Between frames that differ by less, rounding
    is enough to make two of them one.
    """
    count = len(joints)
    lengths = np.zeros(count, dtype=np.intp)
    if count < 2:
        return lengths
    steps = norm(np.diff(joints, axis=0))
    unknown = np.isnan(joints[..., 0])
    alike = (unknown[1:] == unknown[:-1]).all(axis=1) & ~unknown[1:].all(axis=1)
    fastest = np.nan_to_num(np.fmax.reduce(steps, axis=1))
    same = alike & (fastest < SAME_METRES)
    for first, last in runs(same):
        before, after = fastest[max(first - NEAR_FRAMES, 0) : first], fastest[last : last + NEAR_FRAMES]
        moving = [part.max() > MOVED_METRES for part in (before, after) if len(part)]
        if moving and all(moving):
            lengths[first + 1 : last + 1] = last - first
    return lengths
