"""What readers and writers of motion ask alike: one clip, and the size of what moves."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from posekit.formats.motion.motion import Motion
from posekit.geometry import Array
from posekit.safe_io import refusal, shown

SMALLEST_SPAN_METRES, WIDEST_SPAN_METRES = 0.1, 20.0
"""Metres that the points of one frame span: a hand is larger, people on one stage are nearer to each other."""


def the_one_clip(path: str | Path, motion: Motion, format: str) -> Motion:
    """Refuse several clips for a format that carries one."""
    if len(motion.clips) > 1:
        got = f"{len(motion.clips)} clips ({shown(motion.clips[0])}, …)"
        raise refusal(path, "clips", got, f"one, for {format} holds one", "choose one by its name")
    return motion


def check_size(motion: Motion) -> None:
    """Refuse points whose extent is no body's in metres: their unit is another.

    Raises
    ------
    InputError
        Where half of the frames span less than `SMALLEST_SPAN_METRES` or more than `WIDEST_SPAN_METRES`.
    """
    known = np.isfinite(motion.points).all(axis=-1)
    rows = known.sum(axis=1) > 1
    if not rows.any():
        return
    points = motion.points[rows]
    extent = float(np.median(np.linalg.norm(np.nanmax(points, axis=1) - np.nanmin(points, axis=1), axis=-1)))
    if not SMALLEST_SPAN_METRES <= extent <= WIDEST_SPAN_METRES:
        expected = f"{SMALLEST_SPAN_METRES:g} to {WIDEST_SPAN_METRES:g} m"
        remedy = "state the unit in which the file is: m, cm, mm or in"
        raise refusal(motion.source, "unit", f"points that span {extent:.4g} m", expected, remedy)


def check_turns(path: str | Path, q: Array) -> None:
    """Refuse configurations (T, nq) whose quaternion is not of unit length; one that is not known is none."""
    length = np.linalg.norm(q[:, 3:7], axis=1)
    off = np.abs(length - 1) >= 1e-6
    if off.any():
        frame = int(np.argmax(off))
        got = f"a quaternion of length {length[frame]:g}"
        raise refusal(path, f"q[{frame}]", got, "1", "normalise q[3:7]")


def check_time(path: str | Path, time: Array, frames: int) -> None:
    """Refuse times that are not one a frame, finite and ascending."""
    if time.shape != (frames,):
        raise refusal(
            path, "time", f"shape {time.shape}", f"({frames},), one a frame", "give a time for each row"
        )
    if not np.isfinite(time).all() or not (np.diff(time) > 0).all():
        frame = int(np.argmax(~np.isfinite(time) | np.r_[False, ~(np.diff(time) > 0)]))
        expected = "finite times that ascend, each after the one before"
        raise refusal(path, f"time[{frame}]", f"{time[frame]:g} s", expected, "put the frames in order")
