"""Joint centres from other landmarks of a body: hips from markers of the pelvis, neck and pelvis of the figure."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

import numpy as np

from posekit.geometry.vectors import Array, cross, perpendicular, unit

#: Place of the built-in figure's pelvis on the line from the middle of the shoulders (0) to that of the hips (1).
PELVIS_SHARE: Final = 0.8200545021161334
#: The figure's neck from the middle of the shoulders, as shares of that line's length: forward, left, up.
NECK_OFFSET: Final = (0.06720811867953341, 0.0, -0.002995656796876607)


def middles(found: Mapping[str, Array]) -> dict[str, Array]:
    """Return the middles (..., D) of the shoulders and of the hips, where both sides are among the landmarks."""
    return {
        f"mid_{part}s": (found[f"right_{part}"] + found[f"left_{part}"]) / 2
        for part in ("shoulder", "hip")
        if {f"right_{part}", f"left_{part}"} <= set(found)
    }


def hips_from_markers(right: Array, left: Array, back: Array) -> tuple[Array, Array]:
    """Place right and left hip (T, 3) from the anterior spines of the pelvis and the sacrum (T, 3).

    From the middle of the spines, as shares of their distance: 0.36 to the side, 0.19 backward, 0.30 down (Bell,
    Brand & Pedersen 1989, *Prediction of hip joint centre location from external landmarks*, Human Movement Science 8).
    """
    width = np.linalg.norm(left - right, axis=-1, keepdims=True)
    to_left, middle = unit(left - right), (left + right) / 2
    ahead = unit(perpendicular(middle - back, to_left))
    base = middle - width * (0.19 * ahead + 0.30 * cross(ahead, to_left))
    return base - 0.36 * width * to_left, base + 0.36 * width * to_left


def place_neck(found: Mapping[str, Array]) -> Array:
    """Place the neck (T, 3) at a fixed offset in the frame of shoulders and pelvis, in spine lengths."""
    spine = np.linalg.norm(found["mid_shoulders"] - found["mid_hips"], axis=-1)
    spine = spine[np.isfinite(spine)]
    left = unit(found["left_shoulder"] - found["right_shoulder"])
    down = unit(perpendicular(found["right_shoulder"] - found["pelvis"], left))
    frame = np.stack([cross(down, left), left, -down], axis=-1)
    offset = np.array(NECK_OFFSET) * (float(np.median(spine)) if len(spine) else 1.0)
    return np.asarray(found["mid_shoulders"] + frame @ offset)
