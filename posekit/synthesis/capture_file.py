"""Read motion capture, in any format of motion, as postures in clips."""

from __future__ import annotations

from pathlib import Path
from typing import Final

import numpy as np

from posekit.body import Figure
from posekit.formats.motion import UP_DIRECTIONS, guess_up, postures_of, read_motion
from posekit.formats.skeleton_maps import SkeletonMap
from posekit.safe_io.regular_file import check_file
from posekit.synthesis.capture import Capture

MAX_BYTES: Final = 1_000_000_000
"""The largest file that is read whole."""


def read_capture(
    path: str | Path,
    *,
    format: str | None = None,
    unit: str | None = None,
    up: str | None = None,
    layout: SkeletonMap | None = None,
    figure: Figure | None = None,
) -> Capture:
    """Read motion capture: NPZ, TRC, C3D, BVH, CSV, Parquet, or another format of points that posekit reads.

    Parameters
    ----------
    path : path
        An NPZ file.
    format, unit, up : str, optional
        Where the file's own are wrong or missing; see `posekit.formats.motion.read_motion`. A way up that neither
        says is guessed from necks and ankles, and the capture says so.
    layout : SkeletonMap, optional
        What the points are; by their names if not given.
    figure : Figure, optional
        Whose torso places neck and pelvis where the file has none; see `posekit.formats.motion.postures_of`.

    Raises
    ------
    InputError
        Where the file cannot be read, its points are no body's, or it does not say which way is up and nobody stands.
    """
    if Path(path).is_file() or not Path(path).exists():
        check_file(path, limit=MAX_BYTES)
    motion = read_motion(path, format, unit=unit, up=up)
    postures = postures_of(motion, layout, figure)
    found = motion.up or guess_up(postures.joints, motion.source)
    return Capture(
        points=np.concatenate([postures.joints, postures.head], axis=1),
        clip=motion.clip.copy(),
        names=_clip_names(motion.clips, motion.source),
        actions=motion.actions,
        fps=motion.rates.copy(),
        up=UP_DIRECTIONS[found].copy(),
        source=motion.source,
        derived=postures.derived,
        up_from="stated" if up else "file" if motion.up else "guessed",
    )


def _clip_names(clips: tuple[str, ...], source: str) -> tuple[str, ...]:
    """Call the only clip of a file without clips by the file's name."""
    return (Path(source).stem,) if clips == ("",) else clips
