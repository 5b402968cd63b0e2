"""The 33 landmarks by name and number, and how files call frames, times and sizes."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Final

import numpy as np

from posekit.formats.keypoints.rows import DetectionRows, whole
from posekit.formats.skeleton_maps.skeleton_map import plain
from posekit.geometry import Array

LANDMARK_NAMES: Final = tuple(
    "nose left_eye_inner left_eye left_eye_outer right_eye_inner right_eye right_eye_outer left_ear right_ear "
    "mouth_left mouth_right left_shoulder right_shoulder left_elbow right_elbow left_wrist right_wrist left_pinky "
    "right_pinky left_index right_index left_thumb right_thumb left_hip right_hip left_knee right_knee left_ankle "
    "right_ankle left_heel right_heel left_foot_index right_foot_index".split()
)
"""mediapipe.solutions.pose.PoseLandmark, in its order."""
LANDMARK_NUMBER: Final = {plain(name): index for index, name in enumerate(LANDMARK_NAMES)}

PICTURE_LABEL_NAMES: Final = tuple(
    "frame frameid frameindex frameidx framenumber framenum frameno image imageid imagename img filename file".split()
)
"""What a picture's number or name is called, plain."""
SECONDS_NAMES: Final = (
    "time",
    "times",
    "timesec",
    "timeseconds",
    "timeinseconds",
    "seconds",
    "timestamps",
    "timestampsec",
)
MILLISECONDS_NAMES: Final = ("timestampms", "timems", "milliseconds", "ms")
MICROSECONDS_NAMES: Final = ("timestampus", "timeus")
SECONDS_OR_MILLISECONDS_NAMES: Final = ("timestamp",)
"""Seconds or milliseconds: the steps between frames tell."""
TIME_NAMES: Final = (*MILLISECONDS_NAMES, *MICROSECONDS_NAMES, *SECONDS_NAMES, *SECONDS_OR_MILLISECONDS_NAMES)
VISIBILITY_NAMES: Final = ("visibility", "vis", "v", "confidence", "conf", "score", "c")
PRESENCE_NAMES: Final = ("presence", "pres", "p")


def landmark(name: object) -> int | None:
    """Return a landmark's number, of a name in any spelling or of a number from 0 to 32."""
    index = whole(name)
    if index is not None:
        return index if index < len(LANDMARK_NAMES) else None
    if not isinstance(name, str):
        return None
    return LANDMARK_NUMBER.get(plain(name), LANDMARK_NUMBER.get(plain(name.rpartition(".")[2])))


def one_of(names: Iterable[str], wanted: Iterable[str]) -> str | None:
    """Return the first of the names that, plain, is one of the wanted, in the order in which they are wanted."""
    known = {plain(name): name for name in reversed(list(names))}
    return next((known[name] for name in wanted if name in known), None)


def in_seconds(times: Array, unit: str) -> Array:
    """Turn times (T,) into seconds; what is called a timestamp is milliseconds where frames are more than 2 apart."""
    if unit in MILLISECONDS_NAMES:
        return times * 1e-3
    if unit in MICROSECONDS_NAMES:
        return times * 1e-6
    if unit in SECONDS_OR_MILLISECONDS_NAMES:
        steps = np.diff(np.unique(times[np.isfinite(times)]))
        if len(steps) and float(np.median(steps)) > 2:
            return times * 1e-3
    return times


def note_times(rows: DetectionRows, labels: Iterable[str], times: Sequence[float], unit: str) -> None:
    """Note the times of pictures, as the file has them in a unit by its name."""
    for label, time in zip(labels, in_seconds(np.array(times), unit), strict=True):
        rows.picture(label, time=float(time))


def nobody() -> tuple[Array, Array]:
    """Make the points (33, 2) and confidences (33,) of a person of whom nothing is known yet."""
    return np.full((len(LANDMARK_NAMES), 2), np.nan), np.full(len(LANDMARK_NAMES), np.nan)
