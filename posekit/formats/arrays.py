"""Arrays in memory, read like files: points in 3D become a motion, points in pictures become key points."""

from __future__ import annotations

from typing import Any

import numpy as np

from posekit.errors import refusal
from posekit.following.detections import Detections
from posekit.formats import joint_arrays, robot_tables
from posekit.formats.detection_rows import Rows, detections_of
from posekit.formats.layout import load_layout
from posekit.formats.options import Options
from posekit.geometry import numbers
from posekit.motion.motion import Motion
from posekit.skeleton import JOINTS, POINTS


def has_layout(given: Any, layout: str | None) -> bool:
    """Return whether a layout is stated, or points (T, J, 3) differ in number from the points of the figure.

    Raises
    ------
    InputError
        If the values are not numbers.
    """
    if not isinstance(given, list | tuple | np.ndarray):
        return False
    shape = numbers(given, "array").shape
    return bool(layout) or (len(shape) == 3 and shape[1] not in (len(JOINTS), len(POINTS)))


def motion_of(values: Any, options: Options) -> Motion:
    """Read 3D joint positions (T, J, 3) in the order of a layout, or configurations of a robot (T, nq)."""
    values = numbers(values, "array")
    layout = load_layout(options.layout) if options.layout else None
    if values.ndim == 2 and values.shape[1] == 3 and layout is not None and layout.points:
        values = values[None]  # one posture
    if values.ndim != 2:
        return joint_arrays.read({"": values}, "array", options)
    whole = layout.fields.get("whole", {}) if layout is not None else {}
    return robot_tables.read({whole.get("sure", [""])[0]: values}, "array", options)


def key_points_of(values: Any, options: Options) -> Detections:
    """Read key points of pictures in the order of a layout.

    Parameters
    ----------
    values : array (T, P, 2) or (T, P, 3), or (T, N, P, 2) or (T, N, P, 3) of N people
        Pixels, and the confidence of each point. An unseen point is NaN or has a confidence of 0.

    Raises
    ------
    InputError
        If the array has another shape, or the layout of the points is unknown.
    """
    points = numbers(values, "array")
    several = points[:, None] if points.ndim == 3 else points
    if several.ndim != 4 or several.shape[-1] not in (2, 3):
        expected = "key points (T, P, 2), or (T, P, 3) with confidences"
        raise refusal("array", "", f"shape {points.shape}", expected, "give one picture per row")
    rows = Rows("array")
    rows.kind = "an array"
    if several.shape[-1] == 2:
        several = np.concatenate([several, np.full_like(several[..., :1], np.nan)], axis=-1)
    for label, people in enumerate(several):
        rows.picture(label)
        for person, one in enumerate(people):
            rows.add(label, one, person)
    return detections_of(rows, options)
