"""C3D: the binary format of motion capture systems (Motion Lab Systems, *The C3D File Format User Guide*).

Coordinates are 32-bit floats or scaled 16-bit integers, in the unit of ``POINT:UNITS``; a point whose residual is
negative was not seen. ``POINT:Y_SCREEN`` names the axis that points up on the screen. Files are decoded by
`posekit.formats.motion.c3d_content` and written by ezc3d, in metres: at 3 m a 32-bit float is good to 0.24
micrometres, in metres as in millimetres.
"""

from __future__ import annotations

import math
import tempfile
from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import Final

import numpy as np

from posekit.formats.distinct import check_distinct
from posekit.formats.given_file import GivenFile
from posekit.formats.motion.c3d_content import MAX_VALUES, C3dContent, decode_c3d
from posekit.formats.motion.c3d_parameters import Parameter
from posekit.formats.motion.motion import UP_DIRECTIONS, Motion
from posekit.formats.motion.motion_checks import the_one_clip
from posekit.formats.motion.motion_format import METRES_IN_UNIT, MotionFormat
from posekit.safe_io import cut, extra, one_line, read_bytes, refusal, replacing, shown

WRITTEN_BY_EZC3D: Final = ("ezc3d", "c3d", "writing C3D")
MAX_BYTES: Final = 500_000_000
MAX_FRAMES = 65_534
"""Frames, and points, that are written: ezc3d cuts what is longer where it reads it again."""
_LONGEST_NAME: Final = 127
_SCREEN_X: Final = {"x": "+Y", "y": "+Z", "z": "+X"}


def read_c3d(path: str | Path, unit: str | None = None, *, as_recorded: bool = False) -> Motion:
    """Read the points of a C3D file; analogue channels are left out, and time begins at 0.

    Parameters
    ----------
    path : path
        The file to read.
    unit : str, optional
        Instead of ``POINT:UNITS``.
    as_recorded : bool
        Whether ``POINT:RATE`` may be missing or none.

    Raises
    ------
    InputError
        Where the file is damaged, cut off or holds no points, or has no unit that is known.
    """
    data = read_bytes(path, limit=MAX_BYTES, too_large="split it by frames")
    content = decode_c3d(path, data)
    rate = _rate(path, content, as_recorded)
    frames, count, _ = content.points.shape
    return Motion(
        names=_names(path, content.parameters, count),
        points=METRES_IN_UNIT[unit or _unit(path, content.parameters)] * content.points,
        time=np.arange(frames) / rate,
        rate=rate,
        up=_up(content.parameters),
        source=str(path),
        as_recorded=as_recorded,
        told=("unit", "up") if _up(content.parameters) else ("unit",),
    )


def write_c3d(path: str | Path, motion: Motion) -> None:
    """Write a C3D file, in metres, axes as they are; a missing point has the residual -1.

    The way up goes into ``POINT:Y_SCREEN``. Times become frame numbers at the motion's rate.

    Raises
    ------
    InputError
        Where ezc3d is not installed, the motion has several clips, frames that are not evenly spaced or too many of
        them, a name that C3D cannot hold, or the file cannot be written.
    """
    ezc3d = extra(*WRITTEN_BY_EZC3D)
    motion = the_one_clip(path, motion, "C3D")
    _check_writable(path, motion)
    content = ezc3d.c3d()
    group = content["parameters"]["POINT"]
    group["UNITS"]["value"] = ["m"]
    group["RATE"]["value"] = [motion.rate]
    group["LABELS"]["value"] = list(motion.names)
    group["DESCRIPTIONS"]["value"] = [""] * len(motion.names)
    if motion.up:
        sign, axis = motion.up[0], motion.up[1]
        content.add_parameter("POINT", "X_SCREEN", [_SCREEN_X[axis]])
        content.add_parameter("POINT", "Y_SCREEN", [f"{sign}{axis.upper()}"])
    missing = np.isnan(motion.points).any(axis=-1).T
    points = np.ones((4, len(motion.names), len(motion)))
    points[:3] = np.moveaxis(motion.points, -1, 0).swapaxes(1, 2)
    points[:, missing] = 0.0  # what a point that was not seen has in place of coordinates
    content["data"]["points"] = points
    content["data"]["meta_points"] = {"residuals": np.where(missing, -1.0, 0.0)[None]}
    with tempfile.TemporaryDirectory() as folder:
        made = Path(folder) / "motion.c3d"
        try:
            content.write(str(made))
        except (RuntimeError, ValueError, TypeError, OSError) as error:
            got = f"ezc3d: {cut(one_line(str(error)))}"
            raise refusal(path, "", got, "a motion that C3D can hold", "choose another format") from None
        data = made.read_bytes()
    with replacing(path) as file:
        file.write(data)


def _check_writable(path: str | Path, motion: Motion) -> None:
    count = len(motion.names)
    if (
        not 0 < len(motion) <= MAX_FRAMES
        or not 0 < count <= MAX_FRAMES
        or 4 * count * len(motion) > MAX_VALUES
    ):
        got = f"{len(motion):,} frames of {count:,} points"
        raise refusal(path, "", got, f"1 to {MAX_FRAMES:,} frames", "split it, or choose another format")
    for name in motion.names:
        if (
            not name.isascii()
            or not name.isprintable()
            or name != name.strip()
            or not 0 < len(name) <= _LONGEST_NAME
        ):
            expected = f"1 to {_LONGEST_NAME} printable ASCII characters"
            raise refusal(path, "names", shown(name), expected, "rename the point")
    steps = np.diff(motion.time) * motion.rate
    if (np.abs(steps - 1) > 0.01).any():
        k = int(np.argmax(np.abs(steps - 1) > 0.01))
        got = f"{steps[k]:.3g} frames between frames {k} and {k + 1}"
        remedy = "C3D has no times: choose another format, or fill the gap"
        raise refusal(path, "time", got, "evenly spaced frames", remedy)


def _rate(path: str | Path, content: C3dContent, as_recorded: bool) -> float:
    told = content.parameters.get("POINT:RATE")
    rates = [content.rate] if told is None else [*told.numbers[:1].tolist(), content.rate]
    rate = next((rate for rate in rates if math.isfinite(rate) and rate > 0), None)
    if rate is None and as_recorded:
        return math.nan
    if rate is None:
        raise refusal(path, "POINT:RATE", shown(content.rate), "frames a second, above 0")
    return rate


def _names(path: str | Path, parameters: Mapping[str, Parameter], count: int) -> tuple[str, ...]:
    """Read LABELS, LABELS2, …: 255 names each; a point without one is ``unnamed_K``."""
    names = _texts(parameters, "LABELS")
    k = 2
    while len(names) < count and f"POINT:LABELS{k}" in parameters:
        names += _texts(parameters, f"LABELS{k}")
        k += 1
    names = [*names, *[""] * (count - len(names))][:count]
    names = [name or f"unnamed_{k}" for k, name in enumerate(names, 1)]
    check_distinct(path, "POINT:LABELS", names)
    return tuple(names)


def _unit(path: str | Path, parameters: Mapping[str, Parameter]) -> str:
    found = next(iter(_texts(parameters, "UNITS")), "")
    plain = found.casefold()
    name = {"meters": "m", "metres": "m", "millimeters": "mm", "centimeters": "cm"}.get(plain, plain)
    if name not in METRES_IN_UNIT:
        expected = f"one of {', '.join(METRES_IN_UNIT)}"
        raise refusal(path, "POINT:UNITS", shown(found), expected, "state the unit yourself")
    return name


def _up(parameters: Mapping[str, Parameter]) -> str:
    """Return the axis that points up on the screen, empty where the file does not say."""
    found = next(iter(_texts(parameters, "Y_SCREEN")), "").casefold()
    found = f"+{found}" if f"+{found}" in UP_DIRECTIONS else found
    return found if found in UP_DIRECTIONS else ""


def _texts(parameters: Mapping[str, Parameter], name: str) -> list[str]:
    found = parameters.get(f"POINT:{name}")
    return [] if found is None else found.texts


def _looks_like(given: GivenFile) -> bool:
    first = given.start
    return len(first) > 512 and first[1] == 0x50 and first[0] >= 2 and not first[:2].isalnum()


C3D_FORMAT: Final = MotionFormat(
    name="c3d",
    title="C3D, binary files of motion capture (written with the extra c3d)",
    suffixes=(".c3d",),
    read=read_c3d,
    read_recorded=partial(read_c3d, as_recorded=True),
    write_points=write_c3d,
    written_by=WRITTEN_BY_EZC3D,
    looks_like=_looks_like,
)
