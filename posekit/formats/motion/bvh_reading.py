"""Read BVH files as motion."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np

from posekit.formats.motion.bvh_file import open_bvh
from posekit.formats.motion.bvh_kinematics import points_of, positions_are_absolute
from posekit.formats.motion.bvh_names import ANIMATION_NAMES
from posekit.formats.motion.bvh_size import BvhUnit, guessed_unit, guessed_up
from posekit.formats.motion.motion import UP_DIRECTIONS, Motion
from posekit.formats.motion.motion_format import METRES_IN_UNIT
from posekit.safe_io import refusal, shown


class BvhReading(NamedTuple):
    """A motion, and what was taken for what the file does not say.

    Attributes
    ----------
    motion : Motion
        The points of the joints over time.
    unit : BvhUnit
        What lengths in the file are in, and how that is known.
    absolute : bool
        Whether position channels were taken in place of the offsets.
    """

    motion: Motion
    unit: BvhUnit
    absolute: bool


def read_bvh(
    path: str | Path,
    unit: str | None = None,
    *,
    up: str | None = None,
    absolute: bool | None = None,
    as_recorded: bool = False,
) -> Motion:
    """Read a BVH file: its joints and End Sites in every frame; see `examine_bvh`."""
    return examine_bvh(path, unit, up=up, absolute=absolute, as_recorded=as_recorded).motion


def examine_bvh(
    path: str | Path,
    unit: str | None = None,
    *,
    up: str | None = None,
    absolute: bool | None = None,
    as_recorded: bool = False,
) -> BvhReading:
    """Read a BVH file, and say what was guessed.

    Parameters
    ----------
    path : path
        The file to read.
    unit : str, optional
        The file's, one of `posekit.formats.motion.motion_format.METRES_IN_UNIT`; told by the size of the body if not
        given.
    up : str, optional
        ``+x`` … ``-z``; y if not given, unless the body stands along another axis in a file that posekit did not write.
    absolute : bool, optional
        Whether position channels stand in place of the offsets; told by the numbers if not given.
    as_recorded : bool
        Whether ``Frame Time`` may be none: then no time is known.

    Returns
    -------
    BvhReading
        Points are the joints by name and the End Sites that have a length, as ``Head_end``.

    Raises
    ------
    InputError
        Where the file is no BVH file or damaged (with the line), or its skeleton has a body's size in no unit.
    """
    for given, valid, what in ((unit, METRES_IN_UNIT, "unit"), (up, UP_DIRECTIONS, "up")):
        if given is not None and given not in valid:
            raise refusal(path, what, shown(given), " or ".join(valid), "state one of them")
    file = open_bvh(path, as_recorded=as_recorded)
    if absolute is None:
        absolute = positions_are_absolute(file)
    points = points_of(file, absolute=absolute)
    if unit is None:
        scale = guessed_unit(file, points)
    else:
        scale = BvhUnit(unit, METRES_IN_UNIT[unit], "stated")
    tree = file.hierarchy
    kept = [k for k, site in enumerate(tree.sites) if not site or tree.offsets[k].any()]
    names = tuple(tree.names[k] for k in kept)
    points = points[:, kept]
    points *= scale.metres
    if up is None and set(ANIMATION_NAMES.values()) <= set(names):
        up = "+y"  # posekit wrote it
    motion = Motion(
        names=names,
        points=points,
        time=np.arange(len(points), dtype=np.float64) * file.frame_time,
        rate=1.0 / file.frame_time,
        up=guessed_up(points, names) if up is None else up,
        source=str(path),
        as_recorded=as_recorded,
        told=() if up is None else ("up",),
        said=(f"lengths are in {scale.name}: {scale.why}",),
    )
    return BvhReading(motion, scale, absolute)
