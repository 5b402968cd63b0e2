"""Key points in tables: DeepLabCut's CSV, one row per picture (SLEAP, MediaPipe), one row per point (Caliscope)."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np

from posekit.errors import refusal
from posekit.following.detections import Detections
from posekit.formats.detection_rows import Rows, detections_of
from posekit.formats.layout import load_layout, plain
from posekit.formats.options import Options
from posekit.formats.tables import Table, by_row, columns_of_points, numbers
from posekit.geometry import Array

DEEPLABCUT_LEVELS: Final = ("scorer", "individuals", "bodyparts", "coords")
#: Columns of Caliscope's ``xy_HOLISTIC.csv``: points 0 to 32 are MediaPipe's body landmarks, a port is a camera.
CALISCOPE: Final = {
    **{"sync_index": "frame", "port": "port", "frame_time": "time"},
    **{"point_id": "id", "img_loc_x": "x", "img_loc_y": "y"},
}
PICTURE: Final = "frame frameidx frameid frameindex framenumber image imageid filename".split()
TIME: Final = ("time", "timestamp", "seconds", "times")
PERSON: Final = ("person", "personid", "track", "trackid", "individual")
#: Coordinates and confidence of a point, in their order in arrays.
COORDS: Final = ("x", "y", "sure")
#: Minimum number of points in a table with one row per picture.
LEAST_POINTS: Final = 4


def looks_like(table: Table) -> bool:
    """Return whether a table contains key points in pictures."""
    return _reader(table) is not None


def _reader(table: Table) -> Callable[[Table, Rows], None] | None:
    """Return the function that reads a table; None for 3D points, which have a z coordinate and no confidence."""
    if table.head and table.head[0][:1] == ["scorer"]:
        return _deeplabcut
    if set(CALISCOPE) <= set(table.names):
        return _caliscope
    points = _in_pictures(table.names)
    deep = any("z" in parts for parts in columns_of_points(table.names).values())
    sure = any("sure" in parts for parts in points.values())
    in_space = any(name.endswith("_ncams") for name in table.names)  # Anipose's 3D points have a score, too
    return _row_a_picture if len(points) >= LEAST_POINTS and (sure or not deep) and not in_space else None


def _in_pictures(names: Sequence[str]) -> dict[str, dict[str, str]]:
    """Group column names, such as ``nose_x``, by point, and by ``x``, ``y`` or ``sure`` (confidence)."""
    found = columns_of_points(names).items()
    return {
        name: parts for name, parts in found if {"x", "y"} <= set(parts) and "world" not in name.casefold()
    }


def read(table: Table, path: str | Path, options: Options) -> Detections:
    """Read key points from a table.

    Raises
    ------
    InputError
        If a cell is not a number, or no layout fits the names of the points.
    """
    rows = Rows(source=str(path))
    (_reader(table) or _row_a_picture)(table, rows)
    return detections_of(rows, options)


def _deeplabcut(table: Table, rows: Rows) -> None:
    """Read DeepLabCut's columns (scorer[, individuals], bodyparts, coords); an empty cell is a missing point."""
    rows.kind = "deeplabcut"
    cells = [table.parted(line) for line in table.lines]
    levels = {row[0]: row for row in cells[: len(DEEPLABCUT_LEVELS)] if row[0] in DEEPLABCUT_LEVELS}
    body, coords = cells[len(levels) :], levels.get("coords", [])
    lead = next((k for k, coord in enumerate(coords) if coord in ("x", "y", "likelihood")), len(coords))
    odd = next((k for k, row in enumerate(cells) if len(row) != len(coords)), None)
    if odd is not None or "bodyparts" not in levels or lead == len(coords):
        got = "no rows bodyparts and coords" if odd is None else f"{len(cells[odd])} cells in row {odd + 1}"
        raise refusal(rows.source, "", got, "DeepLabCut's header and rows of one length", "save it again")
    values = numbers([cell for row in body for cell in row[lead:]]).reshape(len(body), len(coords) - lead)
    individuals = levels.get("individuals", [""] * len(coords))
    columns: dict[str, dict[str, dict[str, int]]] = {}
    for k in range(lead, len(coords)):
        part = columns.setdefault(individuals[k], {}).setdefault(levels["bodyparts"][k], {})
        part.setdefault("sure" if coords[k] == "likelihood" else coords[k], k - lead)
    # Points outside all individuals have other names; they belong to no person.
    most = max(columns.values(), key=len)
    rows.names = tuple(most)
    labels = [rows.picture("/".join(row[:lead])) for row in body]
    people = [parts for parts in columns.values() if list(parts) == list(most)]
    for person, parts in enumerate(people):
        points = _stacked(parts, lambda k: values[:, k], len(labels))
        for label, one in zip(labels, points, strict=True):
            rows.add(label, one, person if len(people) > 1 else None)


def _stacked(parts: Mapping[str, Mapping[str, Any]], column: Callable[[Any], Array], count: int) -> Array:
    """Return x, y and confidence of the points (T, P, 3); NaN for values without a column."""
    points = np.full((count, len(parts), len(COORDS)), np.nan)
    for k, part in enumerate(parts.values()):
        for axis, name in enumerate(COORDS):
            if name in part:
                points[:, k, axis] = column(part[name])
    return points


def _caliscope(table: Table, rows: Rows) -> None:
    """Read the pixels of one person in each camera's pictures; times are clock times in seconds."""
    rows.kind, rows.by_camera = "mediapipe", True
    rows.names = load_layout("mediapipe_33").points
    data = {ours: table.checked(name) for name, ours in CALISCOPE.items()}
    whole = np.stack([data["frame"], data["port"], data["id"]], axis=1)
    whole = np.clip(np.nan_to_num(whole, nan=-1), -1, 2**31).astype(np.intp)
    body = (whole >= 0).all(axis=1) & (whole[:, 2] < len(rows.names))
    pictures, first = np.unique(whole[:, 0], return_index=True)
    for number, time in zip(pictures.tolist(), data["time"][first].tolist(), strict=True):
        rows.picture(number, time=time)
    places = np.stack([data["x"], data["y"], np.full(len(whole), np.nan)], axis=1)[body]
    found, _, points = by_row(whole[body, :2], whole[body, 2], places, len(rows.names))
    for (frame, port), one in zip(found.tolist(), points, strict=True):
        rows.add(frame, one, port)


def _row_a_picture(table: Table, rows: Rows) -> None:
    parts = _in_pictures(table.names)
    rows.kind = "a row a picture"
    numbered = [re.fullmatch(r"(?:landmark|point|kp|lm)?[\s._-]*(\d+)", one, re.IGNORECASE) for one in parts]
    rows.names = tuple(parts)
    if all(numbered):
        order = sorted(parts, key=lambda name: int(re.findall(r"\d+", name)[0]))
        parts, rows.names = {name: parts[name] for name in order}, ()
    picture, time, person = (_column(table, wanted) for wanted in (PICTURE, TIME, PERSON))
    points = _stacked(parts, table.checked, len(table.cells))
    times = table.column(time) if time else np.full(len(points), np.nan)
    texts = [re.findall(r"\d+", text) for text in table.texts(person)] if person else []
    labels = table.texts(picture) if picture else [str(k) for k in range(len(points))]
    for k, label in enumerate(labels):
        rows.picture(label, time=float(times[k]))
        rows.add(label, points[k], int(texts[k][0]) if texts and texts[k] else None)


def _column(table: Table, wanted: Sequence[str]) -> Any:
    """Return the first column whose name is one of the wanted names; None without such a column."""
    words = {plain(name): name for name in reversed(table.names)}
    return next((words[one] for one in wanted if one in words), None)
