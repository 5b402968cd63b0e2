"""Read and write motion: which format a file is in, and the formats by name."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from posekit.formats.format import Content
from posekit.formats.given_file import GivenFile
from posekit.formats.motion.motion import UP_DIRECTIONS, Motion
from posekit.formats.motion.motion_checks import check_size
from posekit.formats.motion.motion_format import METRES_IN_UNIT, MotionFormat
from posekit.formats.registry import formats
from posekit.geometry import Array
from posekit.safe_io import nearest, refusal, shown

if TYPE_CHECKING:
    from posekit.body import Figure


def motion_formats() -> dict[str, MotionFormat]:
    """Return the formats of motion by name."""
    return {one.name: one for one in formats(Content.MOTION) if isinstance(one, MotionFormat)}


def read_motion(
    path: str | Path,
    format: str | None = None,
    *,
    unit: str | None = None,
    up: str | None = None,
    rate: float | None = None,
    as_recorded: bool = False,
) -> Motion:
    """Read named points over time.

    Parameters
    ----------
    path : path
        The file to read.
    format : str, optional
        One of `motion_formats`; by the end of the file's name, or its content, if not given.
    unit : str, optional
        ``m``, ``cm``, ``mm`` or ``in``: instead of what the file says or is taken to be in.
    up : str, optional
        The axis that points up, ``+y``: instead of what the file says. Points are not turned.
    rate : float, optional
        Frames a second of a file that says none.
    as_recorded : bool
        Whether it is taken as it is: times in whatever order or not known, and points of any size.

    Raises
    ------
    InputError
        Where it cannot be read, is in no format that is known, or in several (the candidates are named); where its
        points span so little or so much that the unit must be another, unless it is stated; where a rate is stated of a
        file that says it itself.
    """
    if unit is not None and unit not in METRES_IN_UNIT:
        raise refusal("--unit", "", shown(unit), "a known unit", nearest(unit, METRES_IN_UNIT))
    if up is not None and up not in UP_DIRECTIONS:
        raise refusal("--up", "", shown(up), "an axis", nearest(up, UP_DIRECTIONS))
    chosen = motion_format(format) if format is not None else format_of(path)
    if chosen.read is None:
        got = f"{chosen.name}: {chosen.title}"
        expected = f"points: {', '.join(one.name for one in motion_formats().values() if one.read)}"
        raise refusal(path, "format", got, expected, "choose a file of points")
    recorded = as_recorded or rate is not None
    read = chosen.read_recorded if recorded and chosen.read_recorded else chosen.read
    motion = read(Path(path), unit)
    if rate is not None:
        motion = _at_rate(motion, rate)
    if unit is None and not as_recorded:
        check_size(motion)
    return motion if up is None else replace(motion, up=up, told=(*motion.told, "up"))


def _at_rate(motion: Motion, rate: float) -> Motion:
    """State the rate of a motion that says none."""
    if np.isfinite(motion.rate) or len(motion.clips) > 1:
        got = f"{rate:g}, of a file that says {motion.rate:g} frames a second itself"
        raise refusal(motion.source, "--fps", got, "a file without a rate", "leave it out")
    return replace(
        motion, rate=rate, rates=np.array([rate]), time=np.arange(len(motion)) / rate, as_recorded=False
    )


def write_motion(path: str | Path, motion: Motion, format: str | None = None) -> None:
    """Write named points over time, whole or not at all, in a format by name or by the end of the file's name.

    Raises
    ------
    InputError
        Where the format is not known or carries no points, or the file cannot be written.
    """
    chosen = motion_format(format) if format is not None else _by_suffix(path)
    if chosen.write_points is None:
        formats = ", ".join(one.name for one in motion_formats().values() if one.write_points)
        raise refusal(
            path, "format", f"{chosen.name}, which carries joint angles", formats, "choose one of them"
        )
    chosen.write_points(Path(path), motion)


def write_configurations(
    path: str | Path, figure: Figure, q: Array, time: Array, format: str | None = None
) -> None:
    """Write joint angles of a figure, whole or not at all; see `posekit.formats.motion.motion_format.MotionFormat`.

    Raises
    ------
    InputError
        Where the format is not known or carries no joint angles, or the file cannot be written.
    """
    chosen = motion_format(format) if format is not None else _by_suffix(path)
    if chosen.write_configurations is None:
        formats = ", ".join(one.name for one in motion_formats().values() if one.write_configurations)
        raise refusal(path, "format", f"{chosen.name}, which carries points", formats, "choose one of them")
    chosen.write_configurations(Path(path), figure, q, time)


def motion_format(name: str) -> MotionFormat:
    """Return a format by its name.

    Raises
    ------
    InputError
        Where there is no such format.
    """
    if name not in motion_formats():
        raise refusal("--format", "", shown(name), "a known format", nearest(name, motion_formats()))
    return motion_formats()[name]


def format_of(path: str | Path) -> MotionFormat:
    """Tell a file's format, by the end of its name and by its content.

    Raises
    ------
    InputError
        Where neither says it, or the two say different things; the candidates are named.
    """
    path = Path(path)
    if path.is_dir():
        return _of_folders(path)
    given = GivenFile(path)
    named = [one for one in motion_formats().values() if given.suffix in one.suffixes]
    looks = [one for one in motion_formats().values() if one.suffixes and one.looks_like(given)]
    candidates = [one for one in named if one in looks] or [*named, *looks]
    if len(candidates) == 1:
        return candidates[0]
    if candidates:
        names = " or ".join(dict.fromkeys(one.name for one in candidates))
        raise refusal(path, "format", f"a file that is {names}", "one of them", "say which with --format")
    formats = ", ".join(motion_formats())
    raise refusal(
        path, "format", "a file of no format of motion that is known", formats, "say which with --format"
    )


def _of_folders(path: Path) -> MotionFormat:
    folders = [one for one in motion_formats().values() if one.folder]
    if len(folders) != 1:
        names = " or ".join(one.name for one in folders) or "a file"
        raise refusal(path, "format", "a folder", names, "say which with --format")
    return folders[0]


def _by_suffix(path: str | Path) -> MotionFormat:
    """Choose the format of a file that is to be written; a name without an end is a folder's."""
    suffix = Path(path).suffix.lower()
    if not suffix:
        return _of_folders(Path(path))
    written = [one for one in motion_formats().values() if one.writes]
    named = [one for one in written if suffix in one.suffixes]
    if len(named) != 1:
        known = ", ".join(end for one in written for end in one.suffixes)
        raise refusal(path, "format", shown(suffix), f"one of {known}", "name the file so, or say --to")
    return named[0]
