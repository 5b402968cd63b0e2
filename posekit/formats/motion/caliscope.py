"""Caliscope's triangulated points: ``xyz_HOLISTIC.csv`` and the like, a row a point (mprib/caliscope).

Columns: ``sync_index``, the frame; ``point_id``, of which 0 to 32 are MediaPipe's landmarks of the body; ``x_coord``,
``y_coord``, ``z_coord``, metres. It says no times.
"""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Final

import numpy as np

from posekit.formats.motion.csv_table import read_columns
from posekit.formats.motion.motion import Motion
from posekit.formats.motion.motion_format import METRES_IN_UNIT, STATE_RATE, MotionFormat
from posekit.formats.skeleton_maps import load_skeleton_map
from posekit.safe_io import refusal

MOST_GAPS: Final = 10
"""Times as many frames as points that gaps may make."""
TABLE_COLUMNS: Final = ("sync_index", "point_id", "x_coord", "y_coord", "z_coord")


def read_caliscope(path: str | Path, unit: str | None = None, *, as_recorded: bool = False) -> Motion:
    """Read the points of the body.

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
        Where a cell is no number, a point comes twice in a frame, none is of the body, or a frame rate is needed.
    """
    if not as_recorded:
        raise refusal(path, "", "no frame rate", "one", STATE_RATE)
    columns = read_columns(path, lambda names: TABLE_COLUMNS)
    names = load_skeleton_map("mediapipe_33").points
    values = np.stack([np.asarray(columns[name], dtype=np.float64) for name in TABLE_COLUMNS], axis=1)
    body = values[(values[:, 1] >= 0) & (values[:, 1] < len(names)) & np.isfinite(values).all(axis=1)]
    if not len(body):
        raise refusal(path, "point_id", "no point of the body", f"some of 0 to {len(names) - 1}")
    first, last = float(body[:, 0].min()), float(body[:, 0].max())
    if (body[:, 0] % 1).any() or last - first > MOST_GAPS * len(body):
        got = f"frames {first:g} to {last:g}"
        raise refusal(path, "sync_index", got, "whole numbers, one a frame", "check how it was written")
    frames = np.arange(first, last + 1)  # those in which nobody was seen, too: they take their time
    row = (body[:, 0] - first).astype(np.intp)
    point = body[:, 1].astype(np.intp)
    if len(np.unique(row * len(names) + point)) != len(body):
        raise refusal(path, "point_id", "a point twice in a frame", "each once", "remove one of the two")
    points = np.full((len(frames), len(names), 3), np.nan)
    points[row, point] = METRES_IN_UNIT[unit or "m"] * body[:, 2:]
    return Motion(
        names=names,
        points=points,
        time=np.full(len(frames), np.nan),
        rate=float("nan"),
        source=str(path),
        as_recorded=True,
        told=("unit",) if unit else (),
    )


CALISCOPE_FORMAT: Final = MotionFormat(
    name="caliscope",
    title="Caliscope's triangulated points: sync_index, point_id, x_coord, y_coord, z_coord",
    suffixes=(".csv",),
    looks_like=lambda given: set(TABLE_COLUMNS) <= given.columns,
    read=read_caliscope,
    read_recorded=partial(read_caliscope, as_recorded=True),
)
