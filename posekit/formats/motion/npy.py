"""NPY: one array of points in space over time, without names, as pose lifters and generators of motion write it.

Shape (T, P, 3), or (1, T, P, 3); what the points are is told by `posekit.formats.motion.unnamed_points`. The file says
no frame rate, no unit and no way up.
"""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Final

import numpy as np

from posekit.formats.motion.motion import Motion
from posekit.formats.motion.motion_format import METRES_IN_UNIT, STATE_RATE, MotionFormat
from posekit.formats.motion.unnamed_points import named_points
from posekit.safe_io import read_npy, refusal

MAX_BYTES: Final = 1_000_000_000


def read_npy_motion(path: str | Path, unit: str | None = None, *, as_recorded: bool = False) -> Motion:
    """Read points without names.

    Parameters
    ----------
    path : path
        The file to read.
    unit : str, optional
        Of the coordinates; metres if not given.
    as_recorded : bool
        Whether the frame rate may be unknown, which it is.

    Raises
    ------
    InputError
        Where it holds pickles or another shape, nothing tells what the points are, or a frame rate is needed.
    """
    array = read_npy(path, "iuf", limit=MAX_BYTES)
    points = array[0] if array.ndim == 4 and len(array) == 1 else array
    if points.ndim != 3 or points.shape[2] != 3 or not len(points):
        remedy = "give one person's joints in space"
        raise refusal(path, "", f"shape {array.shape}", "(T, P, 3), T of one or more", remedy)
    if not as_recorded:
        raise refusal(path, "", "no frame rate", "one", STATE_RATE)
    named = named_points(points.astype(np.float64), str(path))
    return Motion(
        names=named.names,
        points=METRES_IN_UNIT[unit or "m"] * named.points,
        time=np.full(len(points), np.nan),
        rate=float("nan"),
        source=str(path),
        as_recorded=True,
        told=("unit",) if unit else (),
        said=(named.said,),
    )


NPY_FORMAT: Final = MotionFormat(
    name="npy",
    title="NPY: points in space without names, of Human3.6M, COCO, SMPL or MediaPipe",
    suffixes=(".npy",),
    looks_like=lambda given: given.start.startswith(b"\x93NUMPY"),
    read=read_npy_motion,
    read_recorded=partial(read_npy_motion, as_recorded=True),
)
