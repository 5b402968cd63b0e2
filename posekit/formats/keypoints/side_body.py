"""One person's landmarks along the pictures, and the measures of the body that left and right are judged by."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from posekit.formats.skeleton_maps import LANDMARK_INDEX
from posekit.geometry import Array
from posekit.skeleton import SIDES

LEG_JOINTS: Final = ("hip", "knee", "ankle")
ARM_JOINTS: Final = ("shoulder", "elbow", "wrist")
FACE_SIDES: Final = ("eye", "ear")
LEG_OVER_TRUNK: Final = 1.6
"""The length of a leg, hip to ankle, against that of the trunk, middle of the shoulders to middle of the hips."""
PICTURES_AROUND: Final = 7
"""Pictures before and after over which the person's size is taken: limbs point at the camera now and then."""


def of(landmarks: Array, name: str) -> Array:
    """Return one landmark (F, 2) of (F, 21, 2)."""
    return landmarks[:, LANDMARK_INDEX[name]]


def pair(landmarks: Array, part: str) -> Array:
    """Return the right less the left (F, 2) of a part of the body."""
    return of(landmarks, f"right_{part}") - of(landmarks, f"left_{part}")


def middle(landmarks: Array, part: str) -> Array:
    """Return the middle of the right and the left (F, 2) of a part."""
    return (of(landmarks, f"right_{part}") + of(landmarks, f"left_{part}")) / 2


def length(vectors: Array) -> Array:
    """Return the lengths of vectors (..., 2)."""
    return np.asarray(np.hypot(vectors[..., 0], vectors[..., 1]))


def limb(landmarks: Array, side: str, parts: tuple[str, str, str]) -> Array:
    """Return the length in the picture of an arm or a leg (F,), along both its segments."""
    a, b, c = (of(landmarks, f"{side}_{part}") for part in parts)
    return np.asarray(length(b - a) + length(c - b))


def trunk(landmarks: Array) -> Array:
    """Return the length of the trunk in the picture (F,)."""
    return length(middle(landmarks, "hip") - middle(landmarks, "shoulder"))


def upright(landmarks: Array) -> NDArray[np.bool_]:
    """Tell where the person is upright in the picture (F,): the trunk, or else the face on it, within 45 degrees."""
    up = middle(landmarks, "shoulder") - middle(landmarks, "hip")
    above = of(landmarks, "nose") - middle(landmarks, "shoulder")
    up = np.where(np.isnan(up), above, up)
    with np.errstate(invalid="ignore"):
        return np.asarray(-up[:, 1] > np.abs(up[:, 0]))


def size(landmarks: Array, around: int = PICTURES_AROUND) -> Array:
    """Return the length of a leg as large as the person is in each picture (F,), in the picture's unit; NaN if unknown.

    The largest of both legs and of the trunk's share, for each of them can point at the camera; the median over so many
    pictures before and after, 0 where they have nothing to do with each other.
    """
    lengths = [limb(landmarks, side, ("hip", "knee", "ankle")) for side in SIDES]
    each = np.fmax(np.fmax(*lengths), LEG_OVER_TRUNK * trunk(landmarks))
    padded = np.pad(each, around, constant_values=np.nan)
    windows = sliding_window_view(padded, 2 * around + 1)
    found = np.full(len(each), np.nan)
    some = ~np.isnan(windows).all(axis=1)
    found[some] = np.nanmedian(windows[some], axis=1)
    return np.where(found > 0, found, np.nan)


def mean(values: Array) -> float:
    """Return the mean of what is known; NaN where nothing is."""
    known = values[~np.isnan(values)]
    return float(known.mean()) if len(known) else float("nan")
