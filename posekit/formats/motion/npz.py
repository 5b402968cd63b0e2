"""NPZ: NumPy's own archives, without pickles: captures in clips, posekit's postures, and plain arrays with names.

Keys: ``joints`` or ``points`` (T, P, 3), floats, NaN where one is missing; ``joint_names`` or ``names`` (P,); how fast,
as ``clip_fps`` (one a clip or one for all), ``fps``, ``rate`` or ``time`` (T,), seconds; and optionally ``clip`` (T,),
``clip_names``, ``clip_action`` (C,), ``up`` (``+z``; a capture with ``clip_fps`` has y up where it does not say),
``unit`` (``m``). Files of schema ``posekit.postures/1`` have no time: their frames count as a second each.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from posekit.errors import InputError
from posekit.formats.cameras.camera_format import is_intrinsics
from posekit.formats.given_file import GivenFile
from posekit.formats.motion.array_names import holds_body_angles, holds_robot
from posekit.formats.motion.motion import UP_DIRECTIONS, Motion
from posekit.formats.motion.motion_format import METRES_IN_UNIT, MotionFormat
from posekit.formats.motion.motion_table import rate_of, recorded_rate
from posekit.geometry import Array
from posekit.safe_io import open_npz, refusal, replacing, shown
from posekit.skeleton import HEAD_POINTS, JOINTS

MAX_BYTES: Final = 1_000_000_000
"""What the arrays of one file may take, unpacked."""
POSTURES_SCHEMA: Final = "posekit.postures/1"
_POINTS: Final[tuple[str, ...]] = ("joints", "points")
_NAMES: Final[tuple[str, ...]] = ("joint_names", "names")
_KEYS: Final[tuple[str, ...]] = (
    *(*_POINTS, *_NAMES, "head", "schema", "time", "rate", "up", "unit"),
    *("clip", "clip_names", "clip_action", "clip_fps", "fps"),
)
_RATES: Final[tuple[str, ...]] = ("clip_fps", "rate", "fps")
"""Where the frames a second stand."""

Arrays = Mapping[str, NDArray[Any]]


def read_npz(path: str | Path, unit: str | None = None, *, as_recorded: bool = False) -> Motion:
    """Read points from an NPZ.

    Parameters
    ----------
    path : path
        The file to read.
    unit : str, optional
        Instead of the file's; metres where neither says.
    as_recorded : bool
        Whether times may stand still or go back, and the rate may be missing or none.

    Raises
    ------
    InputError
        Where the file cannot be read, holds pickles, or a key is not as said above.
    """
    with open_npz(path, limit=MAX_BYTES) as archive:
        arrays = {key: archive.array(key, "iufU", None) for key in _KEYS if key in archive.names}
        others = ", ".join(archive.names)[:200]
    schema = _word(path, arrays, "schema", "", ("", POSTURES_SCHEMA))
    points, names = _points(path, arrays, schema, others)
    scale = METRES_IN_UNIT[unit or _word(path, arrays, "unit", "m", tuple(METRES_IN_UNIT))]
    up = _word(path, arrays, "up", "+y" if "clip_fps" in arrays else "", ("", *UP_DIRECTIONS))
    clip, clips, actions = _clips(path, arrays, len(points))
    time, rates = _time(path, arrays, clip, len(clips), schema, as_recorded=as_recorded)
    return Motion(
        names=names,
        points=scale * points,
        time=time,
        rate=float(rates[0]),
        up=up,
        source=str(path),
        clip=clip,
        clips=clips,
        actions=actions,
        rates=rates,
        as_recorded=as_recorded,
        told=tuple(key for key in ("unit", "up") if arrays.get(key, np.array("")).any()),
    )


def write_npz(path: str | Path, motion: Motion) -> None:
    """Write points as NPZ, nothing lost; whole or not at all. ``numpy.load`` reads it without pickles."""
    arrays = {
        "joints": motion.points,
        "joint_names": np.array(motion.names, dtype=np.str_),
        "time": motion.time,
        "clip": motion.clip.astype(np.int64),
        "clip_names": np.array(motion.clips, dtype=np.str_),
        "clip_action": np.array(motion.actions, dtype=np.str_),
        "clip_fps": motion.rates,
        "up": np.array(motion.up),
        "unit": np.array("m"),
    }
    with replacing(path) as file:
        np.savez_compressed(file, allow_pickle=False, **arrays)


def _points(path: str | Path, arrays: Arrays, schema: str, others: str) -> tuple[Array, tuple[str, ...]]:
    key = next((key for key in _POINTS if key in arrays), _POINTS[0])
    points = _required(path, arrays, key, others)
    if points.dtype.kind != "f" or points.ndim != 3 or points.shape[2] != 3 or len(points) == 0:
        raise _wrong(path, key, _kind(points), "floats (T, P, 3), T of one or more")
    if schema and "joint_names" not in arrays:
        names: tuple[str, ...] = JOINTS
    else:
        names = _words(path, arrays, next((one for one in _NAMES if one in arrays), _NAMES[0]), others)
    if points.shape[1] != len(names):
        raise _wrong(path, "joint_names", f"{len(names)} names", f"{points.shape[1]}, one a point of {key}")
    if schema and "head" in arrays:
        head = arrays["head"]
        if head.dtype.kind != "f" or head.shape != (len(points), len(HEAD_POINTS), 3):
            raise _wrong(path, "head", _kind(head), f"floats ({len(points)}, {len(HEAD_POINTS)}, 3)")
        points, names = np.concatenate([points, head], axis=1), (*names, *HEAD_POINTS)
    return points.astype(np.float64), names


def _clips(
    path: str | Path, arrays: Arrays, frames: int
) -> tuple[NDArray[np.intp], tuple[str, ...], tuple[str, ...]]:
    clip = arrays.get("clip", np.zeros(frames, dtype=np.intp))
    if clip.dtype.kind not in "iu" or clip.shape != (frames,):
        raise _wrong(path, "clip", _kind(clip), f"whole numbers ({frames},)")
    first, last = int(clip.min()), int(clip.max())
    if "clip_names" in arrays:
        names = _words(path, arrays, "clip_names", "")
    elif last < frames:
        names = tuple(str(k) for k in range(last + 1))
    else:
        raise _wrong(path, "clip", f"clip {last}", f"clips 0 to {frames - 1} at most")
    actions = _words(path, arrays, "clip_action", "") if "clip_action" in arrays else ("",) * len(names)
    if not names or len(set(names)) != len(names):
        raise _wrong(path, "clip_names", "a name twice" if names else "no name", "each clip named once")
    if len(actions) != len(names):
        raise _wrong(path, "clip_action", f"{len(actions)} for {len(names)} clips", "one a clip")
    if first < 0 or last >= len(names):
        raise _wrong(path, "clip", f"clips {first} to {last}", f"0 to {len(names) - 1}, as clip_names counts")
    return clip.astype(np.intp), names, actions


def _time(
    path: str | Path,
    arrays: Arrays,
    clip: NDArray[np.intp],
    clips: int,
    schema: str,
    *,
    as_recorded: bool,
) -> tuple[Array, Array]:
    """Return the time of each frame and the rate of each clip."""
    key = next((key for key in _RATES if key in arrays), None)
    time = arrays.get("time")
    if time is not None and (time.dtype.kind not in "fiu" or time.shape != clip.shape):
        raise _wrong(path, "time", _kind(time), f"numbers ({len(clip)},), seconds")
    if key is not None:
        fps = arrays[key]
        if fps.dtype.kind not in "fiu" or fps.shape not in {(), (1,), (clips,)}:
            raise _wrong(path, key, _kind(fps), f"numbers ({clips},), one a clip")
        rates = np.broadcast_to(fps.astype(np.float64), (clips,)).copy()
        positive = np.isfinite(rates) & (rates > 0)
        if as_recorded:
            rates[~positive] = np.nan
        elif not positive.all():
            raise _wrong(path, key, shown(rates.tolist()[:5]), "positive, finite frames a second")
    elif time is not None:
        told_by = recorded_rate if as_recorded else rate_of
        rates = np.array([told_by(time[clip == index].astype(np.float64)) for index in range(clips)])
    elif as_recorded:
        rates = np.full(clips, np.nan)
    elif schema:
        rates = np.ones(clips)
    else:
        raise _wrong(
            path, "clip_fps", "nothing", "how fast: clip_fps, rate (frames a second) or time (seconds)"
        )
    if time is not None:
        return time.astype(np.float64), rates
    order = np.argsort(clip, kind="stable")
    counts = np.bincount(clip, minlength=clips)
    place = np.empty(len(clip), dtype=np.intp)
    place[order] = np.arange(len(clip)) - np.repeat(np.cumsum(counts) - counts, counts)
    return place / rates[clip], rates


def _required(path: str | Path, arrays: Arrays, key: str, others: str) -> NDArray[Any]:
    if key not in arrays:
        raise _wrong(path, key, "nothing", f"an array; the file has {others or 'none'}")
    return arrays[key]


def _words(path: str | Path, arrays: Arrays, key: str, others: str) -> tuple[str, ...]:
    """Return a 1-D array of text."""
    words = _required(path, arrays, key, others)
    if words.dtype.kind != "U" or words.ndim != 1:
        raise _wrong(path, key, _kind(words), "text of shape (K,)")
    return tuple(str(word) for word in words)


def _word(path: str | Path, arrays: Arrays, key: str, default: str, known: tuple[str, ...]) -> str:
    """Return one word of those known."""
    value = arrays.get(key, np.array(default))
    word = str(value.reshape(-1)[0]) if value.size == 1 else f"shape {value.shape}"
    word = f"+{word}" if key == "up" and f"+{word}" in known else word
    if word not in known:
        raise _wrong(path, key, repr(word[:40]), f"one of {', '.join(filter(None, known))}")
    return word


def _wrong(path: str | Path, key: str, got: str, expected: str) -> InputError:
    return refusal(path, key, got, expected, "correct the file")


def _kind(array: NDArray[Any]) -> str:
    size = math.prod(array.shape)
    return f"{array.dtype} of shape {array.shape}" if size else f"{array.dtype} of shape {array.shape}, empty"


def _looks_like(given: GivenFile) -> bool:
    """Take every archive for points that is of nothing else: the reader says which arrays it misses."""
    if not given.start.startswith(b"PK\x03\x04"):
        return False
    return bool(given.arrays & set(_POINTS)) or not (
        any(map(is_intrinsics, given.arrays)) or holds_robot(given.arrays) or holds_body_angles(given.arrays)
    )


NPZ_FORMAT: Final = MotionFormat(
    name="npz",
    title="NPZ, NumPy arrays: captures in clips, posekit's postures, plain points with names",
    suffixes=(".npz",),
    read=read_npz,
    read_recorded=partial(read_npz, as_recorded=True),
    write_points=write_npz,
    looks_like=_looks_like,
)
