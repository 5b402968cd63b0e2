"""TRC, tables of marker positions (OpenSim, Pose2Sim, Motion Analysis); MOT and STO, joint angles of OpenSim.

TRC has five header lines: ``PathFileType``; the names of the trial's parameters (``DataRate``, ``NumFrames``,
``Units``, …); their values; ``Frame#``, ``Time`` and the markers' names, each above three columns; the coordinates'
names (``X1``, ``Y1``, ``Z1``, …). Each further line is a frame; the cells of a missing marker are empty (OpenSim
documentation, *Marker (.trc) Files*). By convention y is up. MOT and STO have a header that ends in ``endheader``
(*Motion (.mot) Files*).
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from posekit.errors import refusal, shown
from posekit.files import write_bytes
from posekit.formats.body_checks import points_motion, times
from posekit.formats.options import Options
from posekit.formats.tables import Table, checked, numbers
from posekit.geometry import UNIT_WORDS, Array

if TYPE_CHECKING:
    from posekit.motion import Motion

MAX_POINTS: Final = 10_000
#: Largest deviation of a frame's time from evenly spaced times, as a share of the time step.
UNEVEN_STEP_SHARE: Final = 0.1


def looks_like(document: Any) -> bool:
    """Return whether a table is TRC, MOT or STO by its first lines."""
    if not isinstance(document, Table) or not document.lines:
        return False
    return document.lines[0].lstrip().startswith("PathFileType") or _end_of_header(document) is not None


def _end_of_header(table: Table) -> int | None:
    ends = [k for k, line in enumerate(table.lines[:200]) if line.strip().lower() == "endheader"]
    return ends[0] if ends else None


def read(document: Table, path: str, options: Options) -> Motion:
    """Read a TRC, MOT or STO file.

    Raises
    ------
    InputError
        If the header is missing, or a row is incomplete.
    """
    end = _end_of_header(document)
    return _read_trc(document, path, options) if end is None else _read_mot(document, end, path, options)


def _read_trc(table: Table, path: str, options: Options) -> Motion:
    lines = table.lines
    if len(lines) < 5:
        raise refusal(path, "", f"{len(lines)} lines", "five lines of header, and rows", "check the format")
    fields = dict(zip(_title_cells(table, lines[1]), _title_cells(table, lines[2]), strict=False))
    titles = _title_cells(table, lines[3])
    first = [title.casefold() for title in titles[:2]]
    if len(titles) < 3 or first[0].rstrip("# ") != "frame" or not first[1].startswith("time"):
        raise refusal(path, "line 4", shown(lines[3][:60]), "Frame#, Time and names", "check the header")
    labels = _title_cells(table, lines[4])
    named_axes = bool(labels) and all(re.fullmatch(r"[XYZxyz]\d*|", cell) for cell in labels)
    axes = sum(bool(cell) for cell in labels) if named_axes else 0
    start = 5 if axes else 4
    names = _names(titles[2:], axes // 3 if axes % 3 == 0 else 0)
    if not 0 < len(names) <= MAX_POINTS or len(set(names)) != len(names):
        got = f"{len(names)} names" if len(set(names)) == len(names) else "a name twice"
        raise refusal(path, "line 4", got, f"1 to {MAX_POINTS:,} different names", "name the points")
    counted = _whole(fields.get("NumMarkers", ""))
    if counted is not None and counted != len(names):
        options.warn(f"NumMarkers is {counted}, but {len(names)} markers are named: the names are used")
    values = _rows(table, start, 2 + 3 * len(names), path)
    frames = _whole(fields.get("NumFrames", ""))
    if frames is not None and frames != len(values):
        options.warn(f"NumFrames is {frames}, but the file has {len(values)}: it may be cut off")
    unit = UNIT_WORDS.get(fields.get("Units", "").strip("\"'").casefold(), "")
    if not unit and fields.get("Units"):
        options.note(f"the unit {shown(fields['Units'])} is not known")
    rate = numbers([fields.get("DataRate", "")])[0]
    return points_motion(
        values[:, 2:].reshape(len(values), len(names), 3),
        names,
        path,
        options,
        time=values[:, 1],
        rate=float(rate) if rate > 0 else None,
        unit=unit,
        up_by_custom="+y",
        partial=True,
    )


def _title_cells(table: Table, line: str) -> list[str]:
    """Split a header line into cells; some files have spaces in the header and tabs in the rows."""
    cells = table.parted(line)
    if table.delimiter == "\t" and len(cells) > 1:
        cells = [one for cell in cells for one in re.split(r"\s{2,}", cell)]
    while cells and not cells[-1]:
        cells.pop()
    return cells


def _names(cells: Sequence[str], count: int) -> tuple[str, ...]:
    """Return the markers' names; the header has each name once for three columns, or once for every column."""
    every_third = tuple(cells[::3])
    if all(every_third) and not any(cells[1::3]) and not any(cells[2::3]):
        return every_third
    named = tuple(cell for cell in cells if cell)
    if count and len(named) > count and len(set(named)) == count:  # a name over each of its columns
        return tuple(dict.fromkeys(named))
    return named


def _rows(table: Table, start: int, width: int, path: str) -> Array:
    """Return the rows (T, width) after the header; missing cells at the end of a row mean unseen markers."""
    cells: list[str] = []
    for k in range(start, len(table.lines)):
        row = table.parted(table.lines[k])
        if len(row) > width and not any(row[width:]):
            row = row[:width]
        elif len(row) < width and len(row) % 3 == 2 and table.delimiter and k < len(table.lines) - 1:
            row += [""] * (width - len(row))  # some editors remove tabs at the end of a line
        elif len(row) == width - 1 and table.delimiter:
            row.append("")
        if len(row) != width:
            remedy = "the file is cut off there" if k == len(table.lines) - 1 else "complete the row"
            raise refusal(path, f"line {table.numbers_of_lines[k]}", f"{len(row)} cells", f"{width}", remedy)
        cells += row
    if not cells:
        raise refusal(path, "", "no frames", "one row per frame", "check how it was written")
    lines = table.numbers_of_lines[start:]
    values = checked(cells, path, lambda k: f"line {lines[k // width]}, column {k % width + 1}").reshape(
        -1, width
    )
    return values


def _whole(text: str) -> int | None:
    value = numbers([text])[0]
    return int(value) if np.isfinite(value) and value == int(value) else None


def _read_mot(table: Table, end: int, path: str, options: Options) -> Motion:
    """Read the joint angles of OpenSim's inverse kinematics; the user states the URDF of the model."""
    header = " ".join(table.lines[:end]).lower()
    names = table.parted(table.lines[end + 1]) if end + 1 < len(table.lines) else []
    if not names or names[0].casefold() != "time":
        raise refusal(path, "columns", shown(" ".join(names[:4])), "time, then coordinates", "check it")
    body = Table(table.lines[end + 2 :], "", path, table.numbers_of_lines[end + 2 :])
    values = _rows(body, 0, len(names), path)
    degrees = re.search(r"indegrees\s*=\s*yes", header) is not None
    options.note(f"angles are in {'degrees' if degrees else 'radians'}, as the header says")
    places = [k for k, name in enumerate(names) if re.search(r"_t[xyz]$", name)]
    turned = [k for k in range(1, len(names)) if k not in places]
    values[:, turned] = np.radians(values[:, turned]) if degrees else values[:, turned]
    from posekit.motion import Motion

    if not options.urdf:
        options.note(
            "these are coordinates of an OpenSim model: give a URDF of it (--urdf), or the .trc of the markers"
        )
    return Motion(
        q=values[:, 1:],
        q_names=names[1:],
        robot=options.urdf,
        time=times(len(values), values[:, 0], None, options),
        up=options.up or "+y",
        source=path,
        layout="opensim",
        notes=options.notes,
        warnings=options.warnings,
    )


def write(path: str | Path, motion: Motion) -> None:
    """Write the points of one recording as TRC in metres, rounded to nanometres; y is up if the up axis is known.

    Raises
    ------
    InputError
        If the motion has no points or several recordings.
    """
    points = one_recording(motion.rotated("+y") if motion.up else motion, "TRC")
    rate = f"{motion.rate or 30.0:.10g}"
    count = len(motion.joint_names)
    head = [
        f"PathFileType\t4\t(X/Y/Z)\t{Path(path).name}",
        "DataRate\tCameraRate\tNumFrames\tNumMarkers\tUnits\tOrigDataRate\tOrigDataStartFrame\tOrigNumFrames",
        f"{rate}\t{rate}\t{len(motion)}\t{count}\tm\t{rate}\t1\t{len(motion)}",
        "\t".join(["Frame#", "Time", *(cell for point in motion.joint_names for cell in (point, "", ""))]),
        "\t".join(["", "", *(f"{axis}{k}" for k in range(1, count + 1) for axis in "XYZ")]),
        "",
    ]
    row = "\t".join(["%d", "%.9f", *["%.9f"] * (3 * count)])
    time = seconds(motion)
    rows = [row % (k + 1, time[k], *points[k].ravel().tolist()) for k in range(len(motion))]
    text = "\n".join([*head, *(line.replace("nan", "") for line in rows)]) + "\n"
    write_bytes(path, text.encode())


def one_recording(motion: Motion, format: str) -> Array:
    """Return the points (T, J, 3) of a motion; refuse a motion without points or with several recordings."""
    if motion.joints is None:
        got = "configurations without points"
        raise refusal(motion.source, "", got, f"points for {format}", "write csv or npz, or give --urdf")
    if len(np.unique(np.asarray(motion.clip))) > 1 or (len(motion) > 1 and not motion.in_time):
        got = f"{len(np.unique(np.asarray(motion.clip)))} recordings, or several postures per frame"
        raise refusal(motion.source, "", got, f"one recording for {format}", "write csv or npz")
    return motion.joints


def seconds(motion: Motion) -> Array:
    """Return the times of a motion, seconds; if they are unknown, times at 30 Hz."""
    time = np.asarray(motion.time)
    return time if np.isfinite(time).all() else np.arange(len(motion)) / 30.0


def even_step(motion: Motion, format: str) -> float:
    """Return the time step, seconds; refuse uneven times, which the format cannot represent."""
    time = seconds(motion)
    if len(time) == 1:
        return 1 / 30
    step = float(time[-1] - time[0]) / (len(time) - 1)
    beside = np.abs(time - time[0] - step * np.arange(len(time))) / (step or np.nan)
    if not beside.max() <= UNEVEN_STEP_SHARE:
        got = f"steps from {np.diff(time).min():.4g} to {np.diff(time).max():.4g} s"
        raise refusal(
            motion.source, "time", got, f"even time steps, as {format} requires", "write csv, npz or trc"
        )
    return step
