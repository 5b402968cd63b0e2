"""Left and right, exchanged back where that makes the path whole."""

from __future__ import annotations

from itertools import product
from typing import Final

import numpy as np
from numpy.typing import NDArray

from posekit.geometry import Array, runs
from posekit.skeleton import FEET_POINTS, POINTS, other_side

CLIP_MARKS: Final = (*POINTS, *FEET_POINTS)
"""All points of a clip: joints, head, feet."""

ARM_PARTS: Final = ("shoulder", "elbow", "wrist")
LEG_PARTS: Final = ("hip", "knee", "ankle", "toe", "heel")
EXCHANGED_PARTS: Final = (
    (*ARM_PARTS, *LEG_PARTS, "eye", "ear"),
    (*ARM_PARTS, *LEG_PARTS),
    ARM_PARTS,
    LEG_PARTS,
    ARM_PARTS[1:],
    LEG_PARTS[1:],
    ARM_PARTS[2:],
    LEG_PARTS[2:],
)
"""What detectors take for its other side together, most first."""

END_FRAMES: Final = 3
"""Frames by which a span may begin or end otherwise than it was found."""


def exchanged(points: Array, bad: NDArray[np.bool_]) -> Array:
    """Exchange left and right in spans of frames, the parts and the ends that leave the smallest jumps.

    Parameters
    ----------
    points : array (T, 23, 3)
        In the order of `CLIP_MARKS`.
    bad : bool array (T,)
        Where labels are exchanged.
    """
    out = points.copy()
    for first, stop in runs(bad):
        last = stop - 1
        best = _jumps(out, first, last, np.arange(len(CLIP_MARKS)))
        chosen = None
        for parts, begin, end in product(
            EXCHANGED_PARTS,
            range(max(first - END_FRAMES, 0), first + END_FRAMES + 1),
            range(last - END_FRAMES, min(last + END_FRAMES, len(out) - 1) + 1),
        ):
            if begin > end:
                continue
            order = np.array(
                [
                    CLIP_MARKS.index(other_side(name)) if any(part in name for part in parts) else k
                    for k, name in enumerate(CLIP_MARKS)
                ]
            )
            jumps = _jumps(out, begin, end, order)
            if jumps < best:
                best, chosen = jumps, (begin, end, order)
        if chosen is not None:
            begin, end, order = chosen
            out[begin : end + 1] = out[begin : end + 1][:, order]
    return out


def _jumps(points: Array, first: int, last: int, order: NDArray[np.intp]) -> float:
    """Return the sum of squared ways around the ends of a span, with its points in another order."""
    low, high = max(first - 2 * END_FRAMES, 0), min(last + 2 * END_FRAMES + 1, len(points))
    path = points[low:high].copy()
    path[first - low : last + 1 - low] = path[first - low : last + 1 - low][:, order]
    return float(np.nansum(np.diff(path, axis=0) ** 2))
