"""What points in space are that have no names: by their number, and by how the body hangs together in them.

17 are Human3.6M's, whose first is between the hips (VideoPose3D, MotionBERT, MotionAGFormer), or COCO's, whose first is
the nose; 22 and more begin with SMPL's body (HumanML3D's ``new_joints``); 33 are MediaPipe's.
"""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np

from posekit.formats.motion.amass import SMPL_NAMES
from posekit.formats.own.units import FARTHEST_COORDINATE
from posekit.formats.skeleton_maps import SkeletonMap, load_skeleton_map
from posekit.geometry import Array
from posekit.safe_io import refusal

SMPL_COUNTS: Final = (22, 24, 52, 55, 127, 144)
"""Joints of HumanML3D, SMPL, SMPL+H and SMPL-X, the last without and with key points of the surface."""
MIDDLE_SHARE: Final = 0.1
"""How far a middle of two joints may be from it, as a share of the legs' length."""
SIDES_SHARE: Final = 0.25
"""By how much limbs of both sides may differ in length, and the middle half of the frames."""


class NamedPoints(NamedTuple):
    """Names of points (T, P, 3), the points, and a sentence that says how the names are known."""

    names: tuple[str, ...]
    points: Array
    said: str


def named_points(points: Array, source: str) -> NamedPoints:
    """Name points whose file has no names.

    Parameters
    ----------
    points : array (T, P, 3)
        In any unit.
    source : str
        What to call them in errors.

    Raises
    ------
    InputError
        Where their number is none that is known, or the body in them does not hang together so.
    """
    count = points.shape[1]
    beyond = np.abs(points) > FARTHEST_COORDINATE
    if beyond.any():
        frame, point, axis = np.argwhere(beyond)[0]
        got = f"a coordinate of {points[frame, point, axis]:g}"
        raise refusal(source, f"frame {frame}", got, f"at most {FARTHEST_COORDINATE:g}", "correct it")
    if count in SMPL_COUNTS and _is_smpl(points):
        said = "points are taken in the order of SMPL: so hips and shoulders are on both sides of the spine"
        return NamedPoints(SMPL_NAMES, points[:, : len(SMPL_NAMES)], said)
    for name, fits in (("h36m_17", _is_h36m), ("coco_17", _is_alike), ("mediapipe_33", _is_alike)):
        layout = load_skeleton_map(name)
        if count == len(layout.points) and fits(points, layout):
            return NamedPoints(
                layout.points, points, f"points are taken in the order of {name}: so the body fits"
            )
    got = f"{count} points without names, in which no body is found"
    expected = "Human3.6M's 17, COCO's 17, SMPL's 22 or more, or MediaPipe's 33"
    raise refusal(source, "points", got, expected, "give their names, in an NPZ with joints and joint_names")


def _is_h36m(points: Array, layout: SkeletonMap) -> bool:
    """Tell whether the first point is between the hips, and the ninth between the shoulders."""
    size = _legs(points, layout)
    off = (
        _apart(points[:, 0], _middle(points, layout, "hip")),
        _apart(points[:, 8], _middle(points, layout, "shoulder")),
    )
    return off[0] < MIDDLE_SHARE * size and off[1] < 2 * MIDDLE_SHARE * size and _is_alike(points, layout)


def _is_alike(points: Array, layout: SkeletonMap) -> bool:
    """Tell whether the limbs of both sides are of one length, which stays."""
    for start, end in (("shoulder", "elbow"), ("elbow", "wrist"), ("hip", "knee"), ("knee", "ankle")):
        right, left = (
            _apart(_of(points, layout, f"{s}_{start}"), _of(points, layout, f"{s}_{end}")) for s in _SIDES
        )
        if not 0 < max(right, left) or not abs(right - left) <= SIDES_SHARE * max(right, left):
            return False
        lengths = np.linalg.norm(
            _of(points, layout, f"left_{end}") - _of(points, layout, f"left_{start}"), axis=-1
        )
        low, high = np.nanpercentile(lengths, (25, 75))
        if not high - low <= SIDES_SHARE * left:
            return False
    return True


def _is_smpl(points: Array) -> bool:
    """Tell whether the spine is between the hips, and the neck between the shoulders."""
    at = {name: points[:, k] for k, name in enumerate(SMPL_NAMES)}
    size = _apart(at["left_hip"], at["left_knee"]) + _apart(at["left_knee"], at["left_ankle"])
    hips = _apart(at["left_hip"], at["right_hip"])
    return (
        _apart(at["pelvis"], (at["left_hip"] + at["right_hip"]) / 2) < 2 * MIDDLE_SHARE * size
        and _apart(at["neck"], (at["left_shoulder"] + at["right_shoulder"]) / 2) < 3 * MIDDLE_SHARE * size
        and hips < size / 2
    )


_SIDES: Final = ("right", "left")


def _of(points: Array, layout: SkeletonMap, landmark: str) -> Array:
    """Return a landmark (T, 3) that is one point."""
    return np.asarray(points[:, layout.points.index(layout.landmarks[landmark][0])])


def _middle(points: Array, layout: SkeletonMap, joint: str) -> Array:
    return (_of(points, layout, f"right_{joint}") + _of(points, layout, f"left_{joint}")) / 2


def _legs(points: Array, layout: SkeletonMap) -> float:
    hip, knee, ankle = (_of(points, layout, f"left_{joint}") for joint in ("hip", "knee", "ankle"))
    return _apart(hip, knee) + _apart(knee, ankle)


def _apart(a: Array, b: Array) -> float:
    """Return the median distance of two points (T, 3); NaN where none is known."""
    found = np.linalg.norm(a - b, axis=-1)
    found = found[np.isfinite(found)]
    return float(np.median(found)) if len(found) else float("nan")
