"""TRC: tables of marker positions, as OpenSim, Pose2Sim and Motion Analysis write them.

Five lines of header, separated by tabs: ``PathFileType``; names of the trial's numbers (``DataRate``, ``NumFrames``,
``NumMarkers``, ``Units``, …); the numbers; ``Frame#``, ``Time`` and the markers' names, one in three columns; ``X1``,
``Y1``, ``Z1``, …. Often an empty line, then a row a frame; empty cells where a marker is missing. See *Marker (.trc)
Files* in OpenSim's documentation. The file does not say which way is up: OpenSim, Pose2Sim and OpenCap have y up.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import chain
from pathlib import Path
from typing import Final

import numpy as np

from posekit.formats.motion.motion import Motion
from posekit.formats.motion.motion_axes import with_up
from posekit.formats.motion.motion_checks import the_one_clip
from posekit.formats.motion.motion_format import METRES_IN_UNIT, MotionFormat
from posekit.formats.motion.number_rows import numbers_of
from posekit.safe_io import read_text, refusal, shown, write_text

MAX_BYTES: Final = 500_000_000
MAX_POINTS: Final = 10_000
_UNIT_NAMES: Final = {
    "m": "m",
    "meters": "m",
    "metres": "m",
    "cm": "cm",
    "mm": "mm",
    "millimeters": "mm",
    "in": "in",
    "inches": "in",
}
_CHUNK: Final = 4096
"""Rows that are held as text at a time."""


def read_trc(path: str | Path, unit: str | None = None, *, as_recorded: bool = False) -> Motion:
    """Read a TRC file.

    Parameters
    ----------
    path : path
        The file to read.
    unit : str, optional
        Instead of the one in the header.
    as_recorded : bool
        Whether frames may be out of order, and ``DataRate`` missing.

    Raises
    ------
    InputError
        Where it is no TRC file, is cut off (fewer rows than ``NumFrames``, fewer columns than markers), or its frames
        are out of order.
    """
    text = read_text(path, limit=MAX_BYTES, too_large="split it by frames")
    lines = text.splitlines()
    header = _header(path, lines, as_recorded)
    scale = METRES_IN_UNIT[unit or header.unit]
    body = [
        (number, line) for number, line in enumerate(lines[header.rows :], header.rows + 1) if line.strip()
    ]
    if len(body) < header.frames:
        expected = f"{header.frames}, as the header says"
        remedy = "the file is cut off, or correct the header"
        raise refusal(path, "NumFrames", f"{len(body)} rows of data", expected, remedy)
    width = 2 + 3 * len(header.names)
    cut_off = body[-1][0] if body and not text.endswith(("\n", "\r")) else 0

    def cells_of(number: int, line: str) -> list[str]:
        return _row(line, width, number != cut_off)

    values = numbers_of(path, body, cells_of, width, f"{width}, three a marker and two")
    vague = np.isnan(values[:, :2]).any(axis=1)
    if vague.any():
        line = body[int(np.argmax(vague))][0]
        raise refusal(path, f"line {line}", "a frame or time that is missing", "both in every row")
    back = np.flatnonzero(np.diff(values[:, 0]) <= 0)
    if len(back) and not as_recorded:
        row = int(back[0]) + 1
        got = f"frame {values[row, 0]:g} after {values[row - 1, 0]:g}"
        raise refusal(path, f"line {body[row][0]}", got, "frames in order", "sort the rows, each frame once")
    return Motion(
        names=header.names,
        points=scale * values[:, 2:].reshape(len(values), len(header.names), 3),
        time=values[:, 1],
        rate=header.rate,
        up="+y",
        source=str(path),
        as_recorded=as_recorded,
        told=("unit",),
    )


def write_trc(path: str | Path, motion: Motion) -> None:
    """Write a TRC file, in metres to the nanometre, y up where the motion's up is known.

    Raises
    ------
    InputError
        Where the motion has several clips, a name holds a tab, or the file cannot be written.
    """
    motion = with_up(the_one_clip(path, motion, "TRC"), "+y")
    for name in motion.names:
        if not name or name != name.strip() or any(not letter.isprintable() for letter in name):
            raise refusal(path, "names", shown(name), "printable names without tabs", "rename the point")
    write_text(path, _pieces(Path(path).name, motion))


def _pieces(name: str, motion: Motion) -> Iterator[str]:
    count, rate = len(motion.names), _number(motion.rate)
    yield f"PathFileType\t4\t(X/Y/Z)\t{name}\n"
    yield "DataRate\tCameraRate\tNumFrames\tNumMarkers\tUnits\tOrigDataRate\tOrigDataStartFrame\tOrigNumFrames\n"
    yield f"{rate}\t{rate}\t{len(motion)}\t{count}\tm\t{rate}\t1\t{len(motion)}\n"
    yield (
        "\t".join(["Frame#", "Time", *chain.from_iterable((point, "", "") for point in motion.names)]) + "\n"
    )
    yield "\t".join(["", "", *(f"{axis}{k}" for k in range(1, count + 1) for axis in "XYZ")]) + "\n\n"
    row = "\t".join(["%d", "%.9f", *["%.9f"] * (3 * count)]) + "\n"
    points = motion.points.reshape(len(motion), -1)
    for start in range(0, len(motion), _CHUNK):
        chunk = range(start, min(start + _CHUNK, len(motion)))
        lines = [row % (k + 1, motion.time[k], *points[k].tolist()) for k in chunk]
        yield "".join(lines).replace("nan", "")


@dataclass(frozen=True, kw_only=True)
class _Header:
    names: tuple[str, ...]
    rate: float
    unit: str
    frames: int
    rows: int
    """Lines before the data."""


def _header(path: str | Path, lines: Sequence[str], as_recorded: bool) -> _Header:
    if len(lines) < 5 or not lines[0].startswith("PathFileType"):
        raise refusal(
            path, "", "no TRC file", "a first line PathFileType, and five lines of header", "check the format"
        )
    fields = dict(zip(_cells(lines[1]), _cells(lines[2]), strict=False))
    titles = _cells(lines[3])
    if len(titles) < 3 or titles[0].casefold().rstrip("#") != "frame" or titles[1].casefold() != "time":
        raise refusal(path, "line 4", shown(lines[3][:60]), "Frame#, Time and names")
    # Some programs write a name into one column of three, some leave no columns between; X1 Y1 Z1 say which.
    spread = titles[2::3] if not any(titles[3::3]) and not any(titles[4::3]) else titles[2:]
    names = tuple(name for name in spread if name)
    if len(names) != len(spread) or not names or len(names) > MAX_POINTS:
        got = f"{len(names)} names in {len(spread)} places"
        raise refusal(path, "line 4", got, f"1 to {MAX_POINTS:,}, one every three columns", "name the points")
    declared = _whole(path, fields, "NumMarkers", len(names))
    if declared != len(names):
        got = f"{declared}, but line 4 names {len(names)}"
        raise refusal(path, "NumMarkers", got, "as many as names", "correct one of the two")
    rate = _float(fields.get("DataRate", ""))
    if rate is None or rate <= 0:
        if not as_recorded:
            got = shown(fields.get("DataRate"))
            raise refusal(path, "DataRate", got, "frames a second, above 0", "write it into line 3")
        rate = math.nan
    unit = _UNIT_NAMES.get(fields.get("Units", "").casefold())
    if unit is None:
        expected = f"one of {', '.join(_UNIT_NAMES)}"
        raise refusal(path, "Units", shown(fields.get("Units")), expected, "write it into line 3")
    return _Header(names=names, rate=rate, unit=unit, frames=_whole(path, fields, "NumFrames", 0), rows=5)


def _row(line: str, width: int, whole: bool) -> list[str]:
    """Part a row into cells; one that is not `whole` is the last of a file that may be cut off."""
    cells = line.split("\t")
    if len(cells) > width and not any(cell.strip() for cell in cells[width:]):
        return cells[:width]
    if len(cells) < width and len(cells) % 3 == 2 and whole:  # editors strip tabs from line ends
        cells += [""] * (width - len(cells))
    return cells


def _cells(line: str) -> list[str]:
    cells = [cell.strip() for cell in line.split("\t")]
    while cells and not cells[-1]:
        cells.pop()
    return cells


def _float(text: str) -> float | None:
    try:
        value = float(text)
    except ValueError:
        return None
    return value if math.isfinite(value) and "_" not in text else None


def _whole(path: str | Path, fields: dict[str, str], name: str, missing: int) -> int:
    if name not in fields:
        return missing
    value = _float(fields[name])
    if value is None or value < 0 or value != int(value):
        raise refusal(path, name, shown(fields[name]), "a whole number", "correct the header")
    return int(value)


def _number(value: float) -> str:
    """Write 30 where times that are thirds of a tenth make it 30.000000000000004."""
    whole = round(value)
    return str(whole) if abs(value - whole) <= RATE_SHARE * value else repr(value)


RATE_SHARE: Final = 1e-9
"""By which share of it a rate may be off a whole number that is meant."""

TRC_FORMAT: Final = MotionFormat(
    name="trc",
    title="TRC, marker positions of OpenSim, Pose2Sim and Motion Analysis",
    suffixes=(".trc",),
    read=read_trc,
    read_recorded=partial(read_trc, as_recorded=True),
    write_points=write_trc,
    looks_like=lambda given: given.start.startswith(b"PathFileType"),
)
