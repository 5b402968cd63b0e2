"""Motion as a table of named columns, long or wide: what CSV and Parquet hold.

Wide has a row a frame: ``time``, ``neck_x``, ``neck_y``, ``neck_z``, …; long a row a frame and point: ``frame``,
``time``, ``name``, ``x``, ``y``, ``z``. Both may have ``clip``, a name. Metres and seconds; what is missing is empty.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import Any, Final, TypeAlias

import numpy as np
from numpy.typing import NDArray

from posekit.formats.motion.motion import Motion
from posekit.formats.motion.motion_format import METRES_IN_UNIT
from posekit.geometry import Array
from posekit.safe_io import refusal, shown

LONG_COLUMNS: Final = ("name", "x", "y", "z")
PERSON_COLUMNS: Final = ("person", "person_id", "track_id", "subject")
"""Who a row is of, where several people are in one table: each is a clip."""
MAX_POINTS: Final = 10_000
MAX_VALUES: Final = 100_000_000
_COORDINATE: Final = re.compile(r"(.+)[_. ]([xyz])", re.IGNORECASE | re.DOTALL)

Column: TypeAlias = NDArray[Any]


def number_columns(columns: Sequence[str]) -> set[str]:
    """Return the columns of a motion's table that must be numbers; others may be text."""
    return {
        name for name in columns if name in ("frame", "time", "x", "y", "z") or _COORDINATE.fullmatch(name)
    }


def points_in(columns: Sequence[str]) -> tuple[str, ...]:
    """Return the points whose three coordinates are among the columns of a wide table, in their order."""
    found: dict[str, set[str]] = {}
    for column in columns:
        if match := _COORDINATE.fullmatch(column):
            found.setdefault(match[1], set()).add(match[2].lower())
    return tuple(name for name, axes in found.items() if axes == set("xyz"))


def is_motion(columns: Sequence[str]) -> bool:
    """Tell whether columns are those of a motion, long or wide, and not of sets of survivors."""
    if "survivor" in columns or "time" not in columns:
        return False
    return set(LONG_COLUMNS) <= set(columns) or bool(points_in(columns))


def is_triangulated(columns: Sequence[str]) -> bool:
    """Tell whether columns are points that were triangulated, a row a frame, without times: anipose's, caliscope's."""
    counted = bool({"fnum", "sync_index"} & set(columns)) or any(name.endswith("_ncams") for name in columns)
    return counted and "survivor" not in columns and bool(points_in(columns))


def motion_of(
    columns: Mapping[str, Column],
    source: str,
    unit: str | None = None,
    up: str = "",
    rate: float | None = None,
    *,
    as_recorded: bool = False,
) -> Motion:
    """Make a motion of a table's columns.

    Parameters
    ----------
    columns : mapping
        Arrays of one length by name: ``name`` and ``clip`` of text, the others of numbers.
    source : str
        What to call it in errors.
    unit : str, optional
        Of the coordinates; metres if not given.
    up, rate : str, float, optional
        Where the file says them; else the rate is that of the times.
    as_recorded : bool
        Whether times may be missing, stand still or go back.

    Raises
    ------
    InputError
        Where they are of sets of survivors, there is no ``time``, no point with three coordinates, frames are out of
        order, or a point comes twice in a frame.
    """
    if "survivor" in columns:
        remedy = "read it as survivors, or choose one of each frame"
        raise refusal(source, "columns", "survivor", "points of one posture a frame", remedy)
    if "time" not in columns and not as_recorded:
        raise refusal(source, "columns", _listed(columns), "a column time, seconds", "add it")
    count = len(next(iter(columns.values()), ()))
    if count == 0:
        raise refusal(source, "", "no rows", "a row a frame", "check how it was written")
    columns = {"time": np.full(count, np.nan), **columns}
    person = next((name for name in PERSON_COLUMNS if name in columns), "")
    if as_recorded and person and "clip" not in columns:
        columns["clip"] = np.array([f"person {who}" for who in columns[person].tolist()])
    names, points, rows = (
        _long(columns, source) if set(LONG_COLUMNS) <= set(columns) else _wide(columns, source)
    )
    time = np.asarray(columns["time"], dtype=np.float64)[rows]
    clips, clip = _clips(columns, rows)
    told_by = recorded_rate if as_recorded else rate_of
    rates = np.array([rate or told_by(time[clip == index]) for index in range(len(clips))])
    return Motion(
        names=names,
        points=METRES_IN_UNIT[unit or "m"] * points,
        time=time,
        rate=float(rates[0]),
        up=up,
        source=source,
        clip=clip,
        clips=clips,
        rates=rates,
        as_recorded=as_recorded,
        told=("up",) if up else (),
    )


def wide_columns(motion: Motion) -> dict[str, Column]:
    """Return a motion's columns, a row a frame."""
    columns: dict[str, Column] = {"time": motion.time}
    if len(motion.clips) > 1:
        columns["clip"] = np.array(motion.clips)[motion.clip]
    if motion.pictures:
        columns["picture"] = np.array(motion.pictures)
    for k, name in enumerate(motion.names):
        for axis in range(3):
            columns[f"{name}_{'xyz'[axis]}"] = motion.points[:, k, axis]
    return columns


def long_columns(motion: Motion) -> dict[str, Column]:
    """Return a motion's columns, a row a frame and point; points that are missing are left out."""
    frame, point = np.nonzero(np.isfinite(motion.points).all(axis=-1))
    columns: dict[str, Column] = {"frame": frame.astype(np.float64), "time": motion.time[frame]}
    if len(motion.clips) > 1:
        columns["clip"] = np.array(motion.clips)[motion.clip[frame]]
    if motion.pictures:
        columns["picture"] = np.array(motion.pictures)[frame]
    columns["name"] = np.array(motion.names)[point]
    for axis in range(3):
        columns["xyz"[axis]] = motion.points[frame, point, axis]
    return columns


def rate_of(time: Array) -> float:
    """Return the frames a second of times that ascend; 1 for a single frame.

    Times are often rounded (0.033, 0.067, …): over all of them, where frames are even, the rounding is spread thin. A
    rate that is whole within a ten-thousandth is whole.
    """
    steps = np.diff(time)
    if len(steps) == 0 or not (steps > 0).all():
        return 1.0  # a motion refuses times that do not ascend
    step = float(np.median(steps))
    if (np.abs(steps - step) < 0.2 * step).all():
        step = float(steps.mean())
    rate = 1 / step
    return float(round(rate)) if round(rate) and abs(rate - round(rate)) < 1e-4 * rate else rate


def recorded_rate(time: Array) -> float:
    """Return the frames a second of times in whatever order, by their median step ahead; NaN where none is known."""
    steps = np.diff(time)
    ahead = steps[steps > 0]
    if not len(ahead):
        return float("nan")
    return rate_of(np.cumsum(ahead)) if len(ahead) == len(steps) > 1 else float(1 / np.median(ahead))


def _wide(columns: Mapping[str, Column], source: str) -> tuple[tuple[str, ...], Array, NDArray[np.intp]]:
    names = points_in(list(columns))
    if not names or len(names) > MAX_POINTS:
        expected = f"name, x, y, z; or triples as neck_x, neck_y, neck_z, up to {MAX_POINTS:,}"
        raise refusal(source, "columns", _listed(columns), expected, "rename the columns")
    by_name: dict[tuple[str, str], Column] = {}
    for column, values in columns.items():
        if match := _COORDINATE.fullmatch(column):
            coordinate = match[1], match[2].lower()
            if coordinate in by_name:
                raise refusal(
                    source, "columns", f"{shown(column)} twice", "each once", "rename one of the two"
                )
            by_name[coordinate] = values
    points = np.stack(
        [np.stack([by_name[name, axis] for axis in "xyz"], axis=-1) for name in names], axis=1
    ).astype(np.float64)
    return names, points, np.arange(len(points))


def _long(columns: Mapping[str, Column], source: str) -> tuple[tuple[str, ...], Array, NDArray[np.intp]]:
    names, point = _codes(columns["name"])
    time = np.asarray(columns["time"], dtype=np.float64)
    frame = np.asarray(columns.get("frame", time), dtype=np.float64)
    _, clip = _clips(columns, np.arange(len(time)))
    if not np.isfinite(frame).all() or np.isnan(time).any() != np.isnan(time).all():
        raise refusal(
            source, "frame", "a row without frame or time", "both in every row", "complete the rows"
        )
    new = np.append(True, (np.diff(frame) != 0) | (np.diff(clip) != 0))
    index = np.cumsum(new) - 1
    rows = np.flatnonzero(new)
    if len(np.unique(np.stack([clip[rows], frame[rows]]), axis=1).T) != len(rows):
        raise refusal(source, "frame", "a frame whose rows are apart", "rows in order", "sort them by frame")
    if ((time != time[rows][index]) & np.isfinite(time)).any():
        row = int(np.argmax(time != time[rows][index]))
        raise refusal(source, f"row {row + 1}", f"time {time[row]:g} s", "one time a frame")
    if len(names) > MAX_POINTS or len(rows) * len(names) * 3 > MAX_VALUES:
        got = f"{len(rows):,} frames of {len(names):,} points"
        raise refusal(source, "name", got, f"at most {MAX_VALUES:,} numbers", "split it")
    if len(np.unique(index * len(names) + point)) != len(index):
        cells, counts = np.unique(index * len(names) + point, return_counts=True)
        twice = int(cells[np.argmax(counts > 1)])
        where = f"frame {frame[rows][twice // len(names)]:g}"
        got = f"{shown(names[twice % len(names)])} twice"
        raise refusal(source, where, got, "each point once a frame", "remove one of the two")
    points = np.full((len(rows), len(names), 3), np.nan)
    points[index, point] = np.stack([columns[axis] for axis in "xyz"], axis=-1)
    return names, points, rows


def _clips(columns: Mapping[str, Column], rows: NDArray[np.intp]) -> tuple[tuple[str, ...], NDArray[np.intp]]:
    if "clip" not in columns:
        return ("",), np.zeros(len(rows), dtype=np.intp)
    return _codes(columns["clip"][rows])


def _codes(texts: NDArray[Any]) -> tuple[tuple[str, ...], NDArray[np.intp]]:
    """Return the different texts in the order in which they come, and which each is."""
    found, first, inverse = np.unique(texts, return_index=True, return_inverse=True)
    order = np.argsort(first)
    place = np.empty(len(found), dtype=np.intp)
    place[order] = np.arange(len(found))
    return tuple(str(text) for text in found[order]), place[inverse.reshape(-1)]


def _listed(columns: Mapping[str, Column]) -> str:
    return shown(", ".join(columns))
