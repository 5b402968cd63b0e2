"""A BVH file as it stands: its hierarchy and the table of its channels, checked, in the file's unit and degrees."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np

from posekit.errors import InputError
from posekit.formats.motion.bvh_hierarchy import LARGEST_VALUE, Hierarchy, parse_hierarchy
from posekit.geometry import Array
from posekit.safe_io import cut, read_text, refusal, shown

MAX_BYTES: Final = 300_000_000
"""Half an hour of a rig with fingers at 120 frames a second."""
_CHUNK: Final = 4_000_000
"""Characters that are held as separate words at a time."""
_MOTION: Final = re.compile(r"^[ \t]*MOTION[ \t]*\r?$", re.MULTILINE | re.IGNORECASE)
_HEAD: Final = re.compile(r"\s*Frames\s*:\s*(\S+)\s+Frame\s*Time\s*:\s*(\S+)", re.IGNORECASE)
_FOREIGN: Final = re.compile(r"[^\s0-9eE.+-]", re.ASCII)


@dataclass(frozen=True, kw_only=True, eq=False)
class BvhFile:
    """What a BVH file says.

    Parameters
    ----------
    path : str
        Where it came from.
    hierarchy : Hierarchy
        The joints of the file, and their channels.
    frame_time : float
        Seconds from frame to frame.
    values : array (T, C)
        The channels of all joints, one after the other: the file's unit, degrees.
    """

    path: str
    hierarchy: Hierarchy
    frame_time: float
    values: Array


def open_bvh(path: str | Path, *, as_recorded: bool = False) -> BvhFile:
    """Read a BVH file as it stands.

    Parameters
    ----------
    path : path
        The file to read.
    as_recorded : bool
        Whether ``Frame Time`` may be none, as 0: it is NaN then.

    Raises
    ------
    InputError
        Where it cannot be read, is no BVH file, is cut off, has other numbers of frames or of values than it says, or
        holds a number that is not finite.
    """
    text = read_text(path, limit=MAX_BYTES, too_large="split it by frames")
    motion = _MOTION.search(text)
    if motion is None:
        remedy = "the file is cut off, or it is no BVH file"
        raise refusal(path, "", "no line MOTION", "HIERARCHY, then MOTION", remedy)
    hierarchy = parse_hierarchy(path, text[: motion.start()])
    head = _HEAD.match(text, motion.end())
    if head is None:
        line = _line(text, motion.end()) + 1
        expected = "Frames: and Frame Time: after MOTION"
        raise refusal(path, f"line {line}", "something else", expected, "add the two lines")
    frames, frame_time = _declared(path, head[1], head[2], as_recorded)
    if hierarchy.width == 0:
        raise refusal(path, "CHANNELS", "none", "the channels of one joint at least", "nothing moves in it")
    values = _numbers(path, text, head.end())
    return BvhFile(
        path=str(path),
        hierarchy=hierarchy,
        frame_time=frame_time,
        values=_table(path, text, head.end(), values, frames, hierarchy.width),
    )


def _declared(path: str | Path, frames: str, frame_time: str, as_recorded: bool) -> tuple[int, float]:
    if not (frames.isascii() and frames.isdigit() and len(frames) < 13 and int(frames) > 0):
        raise refusal(path, "Frames", shown(frames), "a positive whole number")
    try:
        seconds = float(frame_time) if frame_time.isascii() and "_" not in frame_time else np.nan
    except ValueError:
        seconds = np.nan
    if not 1e-6 <= seconds <= 1e6:
        if as_recorded:
            return int(frames), np.nan
        expected = "the seconds from frame to frame, 1e-6 to 1e6"
        raise refusal(path, "Frame Time", shown(frame_time), expected)
    return int(frames), seconds


def _numbers(path: str | Path, text: str, start: int) -> Array:
    """Read all numbers from a place to the end, some lines at a time: words cost more memory than numbers."""
    parts = []
    while start < len(text):
        end = len(text) if start + _CHUNK >= len(text) else text.find("\n", start + _CHUNK) + 1 or len(text)
        piece = text[start:end]
        foreign = _FOREIGN.search(piece)
        if foreign is not None:
            raise _no_number(path, text, start + foreign.start())
        try:
            parts.append(np.array(piece.split(), dtype=np.float64))
        except ValueError:
            raise _first_bad(path, text, start, end) from None
        if not (np.abs(parts[-1]) <= LARGEST_VALUE).all():
            raise _first_bad(path, text, start, end)
        start = end
    return np.concatenate([np.empty(0), *parts])


def _first_bad(path: str | Path, text: str, start: int, end: int) -> InputError:
    for word in re.compile(r"\S+").finditer(text, start, end):
        try:
            good = abs(float(word.group())) <= LARGEST_VALUE
        except ValueError:
            good = False
        if not good:
            return _no_number(path, text, word.start())
    return _no_number(path, text, start)


def _no_number(path: str | Path, text: str, at: int) -> InputError:
    head = re.compile(r"\S*$").search(text[max(0, at - 100) : at])
    tail = re.compile(r"\S*").match(text, at, at + 100)
    word = (head.group() if head else "") + (tail.group() if tail else "")
    expected = f"a finite number of at most {LARGEST_VALUE:g}"
    return refusal(
        path, f"line {_line(text, at)}", shown(cut(word)), expected, "correct the frame or remove it"
    )


def _table(path: str | Path, text: str, start: int, values: Array, frames: int, width: int) -> Array:
    """Put the numbers into rows, and refuse what does not fit: say which line is wrong, where one is."""
    if len(values) == frames * width:
        return values.reshape(frames, width)
    first = _line(text, start) + 1
    lines = [(first + k, len(line.split())) for k, line in enumerate(text[start:].split("\n")[1:])]
    rows = [(number, count) for number, count in lines if count]
    for number, count in rows:
        if count != width:
            expected = f"{width}, one for each channel"
            remedy = "the file is cut off there, or its CHANNELS are not those of its frames"
            raise refusal(path, f"line {number}", f"{count} values", expected, remedy)
    remedy = f"the file is cut off, or correct the line to Frames: {len(rows)}"
    raise refusal(path, "Frames", f"{frames}, but {len(rows)} lines of values", "as many lines", remedy)


def _line(text: str, at: int) -> int:
    return text.count("\n", 0, at) + 1
