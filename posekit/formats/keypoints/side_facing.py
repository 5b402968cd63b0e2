"""Left and right against each other: the shoulders', the hips' and the face's, and against a face that is seen.

A person who faces the camera has their right at the picture's left, and so in shoulders, hips, eyes and ears alike: a
trunk turns by some 45 degrees in itself, a head by some 80 on it. A face is seen where nose and eyes are surer than
usual: only a detector whose confidences differ, or that leaves points out, tells that.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from posekit.formats.keypoints.side_body import PICTURES_AROUND, of, pair, size, upright
from posekit.formats.skeleton_maps import LANDMARK_INDEX, LANDMARK_ORDER
from posekit.geometry import Array

SHOULDERS_CLEAR_WIDTH, HIPS_CLEAR_WIDTH, EARS_CLEAR_WIDTH, EYES_CLEAR_WIDTH = 0.2, 0.125, 0.12, 0.05
"""Widths in the picture, leg lengths, from which it is clear which is which: about half of those from the front."""
FACE_SEEN_CONFIDENCE: Final = 0.6
"""Confidence of a face against the body's from which it is seen."""
FACE_HIDDEN_CONFIDENCE: Final = 0.25
"""The same, below which it is not."""
CONFIDENCE_RANGE_INFORMED: Final = 0.05
"""Range of the confidences from which they are a detector's own."""
FACE_LANDMARKS: Final = tuple(LANDMARK_INDEX[name] for name in ("nose", "right_eye", "left_eye"))
EAR_LANDMARKS: Final = tuple(LANDMARK_INDEX[name] for name in ("right_ear", "left_ear"))
BODY_LANDMARKS: Final = tuple(
    LANDMARK_INDEX[name] for name in LANDMARK_ORDER if name.endswith(("shoulder", "elbow", "hip", "knee"))
)


@dataclass(frozen=True, kw_only=True)
class SideOrder:
    """Which way round the parts of one person are in each picture.

    Parameters
    ----------
    shoulders, hips, face : int array (F,)
        1 where the right is at the picture's right, -1 where it is at its left, 0 where it is not clear.
    """

    shoulders: NDArray[np.int8]
    hips: NDArray[np.int8]
    face: NDArray[np.int8]

    @property
    def twisted(self) -> NDArray[np.bool_]:
        """Pictures (F,) whose shoulders and hips are clearly opposite."""
        return np.asarray(self.shoulders * self.hips < 0)

    @property
    def turned(self) -> NDArray[np.bool_]:
        """Pictures (F,) whose face is clearly opposite to the shoulders, and the hips are not with it."""
        return np.asarray((self.shoulders * self.face < 0) & (self.hips * self.face <= 0))


def order(landmarks: Array, around: int = PICTURES_AROUND) -> SideOrder:
    """Find which way round shoulders, hips and face are in each picture of landmarks (F, 21, 2); see `size`."""
    unit = size(landmarks, around)
    ears, eyes = (
        _way(pair(landmarks, part)[:, 0] / unit, least)
        for part, least in (("ear", EARS_CLEAR_WIDTH), ("eye", EYES_CLEAR_WIDTH))
    )
    return SideOrder(
        shoulders=_way(pair(landmarks, "shoulder")[:, 0] / unit, SHOULDERS_CLEAR_WIDTH),
        hips=_way(pair(landmarks, "hip")[:, 0] / unit, HIPS_CLEAR_WIDTH),
        face=np.where(ears * eyes < 0, 0, np.where(ears != 0, ears, eyes)).astype(np.int8),
    )


def _way(width: Array, least: float) -> NDArray[np.int8]:
    with np.errstate(invalid="ignore"):
        return np.where(np.abs(width) > least, np.sign(np.nan_to_num(width)), 0).astype(np.int8)


def informed(landmarks: Array, confidence: Array) -> bool:
    """Tell whether what is seen of the face says something: its confidences (F, 21) differ, or points are missing.

    There are detectors that put a face on every head and are sure of it, from behind too (MediaPipe).
    """
    head = [*FACE_LANDMARKS, *EAR_LANDMARKS]
    known = confidence[:, head][~np.isnan(confidence[:, head])]
    if len(known) and float(np.ptp(known)) > CONFIDENCE_RANGE_INFORMED:
        return True
    there = ~np.isnan(landmarks[:, FACE_LANDMARKS, 0])
    return bool(there.any() and not there.all())


def facing(landmarks: Array, confidence: Array, occluded: NDArray[np.bool_]) -> NDArray[np.int8]:
    """Tell where the face is: 1 towards the camera, -1 away from it, 0 not known, for each picture (F,).

    Towards: nose and both eyes are sure and not hidden, the nose between the eyes. Away: none of them is, though an ear
    is, so the head is in the picture. Only of somebody who is upright.
    """
    there = ~np.isnan(landmarks[..., 0])
    sure = np.where(there, np.where(np.isnan(confidence), 1.0, confidence), 0.0)
    count = np.maximum(there[:, BODY_LANDMARKS].sum(axis=1), 1)
    body = (sure * there)[:, BODY_LANDMARKS].sum(axis=1) / count
    face = sure[:, FACE_LANDMARKS]
    seen = (
        (face >= FACE_SEEN_CONFIDENCE * body[:, None]).all(axis=1)
        & there[:, FACE_LANDMARKS].all(axis=1)
        & ~occluded[:, FACE_LANDMARKS].any(axis=1)
    )
    nose, right, left = (of(landmarks, name)[:, 0] for name in ("nose", "right_eye", "left_eye"))
    with np.errstate(invalid="ignore"):
        between = (nose - right) * (nose - left) < 0
    ear = (sure[:, EAR_LANDMARKS] >= FACE_HIDDEN_CONFIDENCE * body[:, None]).any(axis=1) & there[
        :, EAR_LANDMARKS
    ].any(axis=1)
    away = (face < FACE_HIDDEN_CONFIDENCE * body[:, None]).all(axis=1) & ear
    towards = np.where(seen & between, 1, np.where(away, -1, 0))
    return np.where(upright(landmarks), towards, 0).astype(np.int8)
