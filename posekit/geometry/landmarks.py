"""Joint centres estimated from other landmarks: hips from pelvis markers, neck and pelvis from shoulders and hips."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

import numpy as np

from posekit.geometry.vectors import Array, cross, perpendicular, unit

#: Position of the built-in figure's pelvis on the line from the midpoint of the shoulders (0) to that of the hips (1).
PELVIS_SHARE: Final = 0.8200545021161334
#: Offset of the figure's neck from the midpoint of the shoulders: forward, left, up, as fractions of that line's
#: length.
NECK_OFFSET: Final = (0.06720811867953341, 0.0, -0.002995656796876607)


def middles(found: Mapping[str, Array]) -> dict[str, Array]:
    """Return the midpoints (..., D) of the shoulders and of the hips; without both landmarks, a midpoint is omitted."""
    return {
        f"mid_{part}s": (found[f"right_{part}"] + found[f"left_{part}"]) / 2
        for part in ("shoulder", "hip")
        if {f"right_{part}", f"left_{part}"} <= set(found)
    }


def hips_from_markers(right: Array, left: Array, back: Array) -> tuple[Array, Array]:
    """Estimate right and left hip (T, 3) from markers (T, 3) on both anterior superior iliac spines and the sacrum.

    Each hip lies 0.36 sideways, 0.19 backward and 0.30 down from the midpoint of the two iliac spines. The numbers are
    fractions of the distance between these spines (Bell, Brand & Pedersen 1989, *Prediction of hip joint centre
    location from external landmarks*, Human Movement Science 8).
    """
    width = np.linalg.norm(left - right, axis=-1, keepdims=True)
    to_left, middle = unit(left - right), (left + right) / 2
    ahead = unit(perpendicular(middle - back, to_left))
    base = middle - width * (0.19 * ahead + 0.30 * cross(ahead, to_left))
    return base - 0.36 * width * to_left, base + 0.36 * width * to_left


def place_neck(found: Mapping[str, Array]) -> Array:
    """Estimate the neck (T, 3): midpoint of the shoulders plus an offset proportional to the median spine length."""
    spine = np.linalg.norm(found["mid_shoulders"] - found["mid_hips"], axis=-1)
    spine = spine[np.isfinite(spine)]
    left = unit(found["left_shoulder"] - found["right_shoulder"])
    down = unit(perpendicular(found["right_shoulder"] - found["pelvis"], left))
    frame = np.stack([cross(down, left), left, -down], axis=-1)
    offset = np.array(NECK_OFFSET) * (float(np.median(spine)) if len(spine) else 1.0)
    return np.asarray(found["mid_shoulders"] + frame @ offset)
