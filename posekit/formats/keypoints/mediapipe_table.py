"""MediaPipe's landmarks in CSV: a row a frame (wide), or a row a landmark (long), as caliscope writes it too.

Caliscope's ``xy_HOLISTIC.csv`` (mprib/caliscope) has what each of its cameras, a ``port``, saw of one person: pixels,
points 0 to 32 MediaPipe's of the body, ``frame_time`` seconds of a clock.
"""

from __future__ import annotations

import csv
import re
from collections.abc import Iterable, Iterator

import numpy as np

from posekit.formats.keypoints.mediapipe_names import (
    LANDMARK_NAMES,
    PICTURE_LABEL_NAMES,
    PRESENCE_NAMES,
    TIME_NAMES,
    VISIBILITY_NAMES,
    landmark,
    nobody,
    note_times,
    one_of,
)
from posekit.formats.keypoints.rows import LARGEST_NUMBER, DetectionRows, whole
from posekit.formats.skeleton_maps.skeleton_map import plain
from posekit.geometry import Array
from posekit.safe_io import cut, refusal, shown

LANDMARK_COLUMN_NAMES = (
    "landmarkname",
    "landmark",
    "name",
    "landmarkid",
    "landmarkindex",
    "landmarkidx",
    "keypoint",
    "joint",
    "id",
)
PERSON_COLUMN_NAMES = ("person", "personid", "pose", "poseid", "posenumber", "trackid")
MIN_NAMED_LANDMARKS = 4
"""Landmarks by name that a wide table must have to be taken for one."""
VALUE_COLUMN_NAMES = {
    "x": "x",
    "y": "y",
    **dict.fromkeys(VISIBILITY_NAMES, "visibility"),
    **dict.fromkeys(PRESENCE_NAMES, "presence"),
}
PORT_NAME = "caliscopeport"
"""What caliscope's ``port`` is called here: a port of another table is no camera."""
CALISCOPE_COLUMN_NAMES = {
    "sync_index": "frame",
    "port": PORT_NAME,
    "frame_time": "time",
    "point_id": "landmark",
    "img_loc_x": "x",
    "img_loc_y": "y",
}
_PART = "|".join(sorted(VALUE_COLUMN_NAMES, key=len, reverse=True))
_BEHIND = re.compile(rf"(?P<name>.+?)[\s._-]+(?P<part>{_PART})\Z", re.IGNORECASE)
_BEFORE = re.compile(rf"(?P<part>{_PART})[\s._-]*(?P<name>[^\s._-].*)\Z", re.IGNORECASE)
_COUNTED = re.compile(
    r"(?:pose)?[\s._-]*(?:landmarks?|lm|keypoint|kp|point|p|l)?[\s._-]*(\d{1,3})\Z", re.IGNORECASE
)
"""``nose_x``, ``x_nose``, ``x0``, ``landmark_0_x``."""


def looks_like_table(text: str) -> bool:
    """Tell by the first line whether it is a table of MediaPipe's landmarks."""
    header = _header(text)
    if any(name.endswith("_ncams") for name in header):
        return False  # points in space that were triangulated from these
    return _is_long(header) or len(_columns(header)) >= MIN_NAMED_LANDMARKS


def _header(text: str) -> list[str]:
    first = text.lstrip().partition("\n")[0][:20_000]
    try:
        names = [name.strip() for name in next(csv.reader([first]), [])]
    except csv.Error:
        return []
    if set(CALISCOPE_COLUMN_NAMES) <= set(names):
        return [CALISCOPE_COLUMN_NAMES.get(name, "") for name in names]
    return names


def _is_long(header: list[str]) -> bool:
    names = {plain(name) for name in header}
    return (
        {"x", "y"} <= names
        and bool(names & set(LANDMARK_COLUMN_NAMES))
        and bool(names & {*PICTURE_LABEL_NAMES, *TIME_NAMES})
    )


def _columns(header: list[str]) -> dict[int, dict[str, int]]:
    """Return for each landmark its columns by part: x, y, visibility; world landmarks are left out."""
    named: dict[int, dict[str, int]] = {}
    counted: dict[int, dict[str, int]] = {}
    for column, name in enumerate(header):
        match = _BEHIND.match(name) or _BEFORE.match(name)
        if match is None or "world" in name.casefold():
            continue
        part = VALUE_COLUMN_NAMES[match["part"].lower()]
        count = _COUNTED.match(match["name"])
        if count is not None:
            counted.setdefault(int(count[1]), {}).setdefault(part, column)
        elif (index := landmark(match["name"])) is not None:
            named.setdefault(index, {}).setdefault(part, column)
    if not named:
        first = 1 if 0 not in counted and len(LANDMARK_NAMES) in counted else 0
        named = {index - first: parts for index, parts in counted.items()}
    return {k: parts for k, parts in named.items() if k < len(LANDMARK_NAMES) and {"x", "y"} <= set(parts)}


def add_table(rows: DetectionRows, text: str) -> bool:
    """Note the rows of a table; return whether numbers of people are those of the cameras that saw one person.

    Raises
    ------
    InputError
        Where it is neither long nor wide, a line has another number of fields, or a field is no number.
    """
    header = _header(text)
    if _is_long(header):
        _add_long(rows, header, text)
        return PORT_NAME in header
    columns = _columns(header)
    if not columns:
        expected = "columns as nose_x, nose_y, nose_visibility, or frame, landmark, x, y, visibility"
        raise refusal(rows.source, "line 1", shown(",".join(header)), expected, "name the columns so")
    _add_wide(rows, header, columns, text)
    return False


def _lines(rows: DetectionRows, header: list[str], text: str) -> Iterator[tuple[int, list[str]]]:
    reader = csv.reader(text.lstrip().splitlines())
    try:
        next(reader)
        for fields in reader:
            if not fields:
                continue
            if len(fields) != len(header):
                got, expected = f"{len(fields)} fields", f"{len(header)}, as in the first line"
                raise refusal(rows.source, f"line {reader.line_num}", got, expected, "correct the line")
            yield reader.line_num, fields
    except csv.Error as error:
        raise refusal(
            rows.source, f"line {reader.line_num}", cut(str(error)), "CSV", "save it again"
        ) from None


def _value(rows: DetectionRows, line: int, name: str, text: str) -> float:
    """Read a field; empty and NaN are not known."""
    text = text.strip()
    if not text or text.casefold() in ("nan", "none", "null"):
        return np.nan
    try:
        value = float(text)
    except ValueError:
        value = np.inf
    if not abs(value) <= LARGEST_NUMBER:
        raise refusal(rows.source, f"line {line}: {cut(name)}", shown(text), "a number, or nothing")
    return value


def _time(text: str) -> float:
    """Read a time; a date or nothing is not known."""
    try:
        value = float(text)
    except ValueError:
        return np.nan
    return value if np.isfinite(value) else np.nan


def _column(header: list[str], wanted: Iterable[str]) -> int | None:
    """Return the place of the first column that is called as wanted; None where there is none."""
    found = one_of(header, wanted)
    return header.index(found) if found is not None else None


def _described(header: list[str]) -> tuple[int | None, int | None, str]:
    label, time = _column(header, PICTURE_LABEL_NAMES), _column(header, TIME_NAMES)
    return label, time, plain(header[time]) if time is not None else ""


def _label(text: str) -> str:
    """Spell a frame's number as a number: 3.0 is 3."""
    value = text.strip()
    try:
        index = whole(float(value))
    except ValueError:
        return value
    return value if index is None else str(index)


def _add_wide(rows: DetectionRows, header: list[str], columns: dict[int, dict[str, int]], text: str) -> None:
    label, time, unit = _described(header)
    labels, times = [], []
    for count, (line, fields) in enumerate(_lines(rows, header, text)):
        labels.append(rows.picture(_label(fields[label]) if label is not None else count))
        times.append(_time(fields[time]) if time is not None else np.nan)
        points, sure = nobody()
        for index, parts in columns.items():
            for axis, part in enumerate("xy"):
                points[index, axis] = _value(rows, line, header[parts[part]], fields[parts[part]])
            surest = parts.get("visibility", parts.get("presence"))
            if surest is not None:
                sure[index] = _value(rows, line, header[surest], fields[surest])
        if not np.isnan(points).all():
            rows.add(labels[-1], points, sure)
    note_times(rows, labels, times, unit)


def _add_long(rows: DetectionRows, header: list[str], text: str) -> None:
    label, time, unit = _described(header)
    which = header.index(one_of(header, LANDMARK_COLUMN_NAMES) or "")
    x, y = (header.index(one_of(header, (axis,)) or "") for axis in "xy")
    surest = _column(header, (*VISIBILITY_NAMES, *PRESENCE_NAMES))
    port = _column(header, (PORT_NAME,))
    who = _column(header, PERSON_COLUMN_NAMES) if port is None else port
    people: dict[tuple[str, str], tuple[Array, Array]] = {}
    labels: dict[str, float] = {}
    for line, fields in _lines(rows, header, text):
        key = _label(fields[label if label is not None else time or 0])
        labels.setdefault(key, _time(fields[time]) if time is not None else np.nan)
        rows.picture(key)
        index = landmark(fields[which].strip())
        if index is None:
            if not fields[which].strip() or port is not None:  # of hands and face
                continue
            expected = f"a landmark's name, or its number 0 to {len(LANDMARK_NAMES) - 1}"
            raise refusal(rows.source, f"line {line}: {header[which]}", shown(fields[which]), expected)
        points, sure = people.setdefault((key, fields[who] if who is not None else ""), nobody())
        if not np.isnan(points[index]).all():
            got, expected = f"{LANDMARK_NAMES[index]} twice in a picture", "once, or a column person"
            raise refusal(rows.source, f"line {line}", got, expected, "number the people")
        points[index] = [_value(rows, line, header[k], fields[k]) for k in (x, y)]
        if surest is not None:
            sure[index] = _value(rows, line, header[surest], fields[surest])
    for (key, person), (points, sure) in people.items():
        rows.add(key, points, sure, person=None if port is None else person)
    times = np.array(list(labels.values()))
    if port is not None and np.isfinite(times).any():
        times -= np.nanmin(times)
    note_times(rows, labels, times.tolist(), unit)
