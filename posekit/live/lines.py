"""Live key points as JSON lines: what a line asks of a tracker, and what it answers."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator
from typing import IO, Any, Final

import numpy as np

from posekit.answers.depth_order import ANSWER_SEGMENTS
from posekit.errors import InputError
from posekit.formats.own import OpenCVModel
from posekit.formats.own.live_schema import LiveFrame, LiveHeader, live_frame, live_header
from posekit.geometry import Array
from posekit.live.tracked_posture import TrackedPosture
from posekit.safe_io.json_file import parse_json
from posekit.safe_io.refusal import nearest, refusal, shown
from posekit.skeleton import JOINTS

MAX_LINE_BYTES: Final = 1_000_000
"""The longest line that is read: a picture of 133 points takes ten thousand."""

WRITTEN_DECIMALS: Final = 6
"""Of metres, seconds and probabilities that are written."""


def read_lines(stream: IO[bytes]) -> Iterator[tuple[str, bytes]]:
    """Yield the lines of a stream as they come, each with what errors call it; lines are counted from 1, as in JSON.

    Empty lines are passed over. Of a line that is too long only the beginning is kept.
    """
    number = 0
    while line := stream.readline(MAX_LINE_BYTES + 1):
        number += 1
        kept = line
        while not line.endswith(b"\n") and len(line) > MAX_LINE_BYTES:
            line = stream.readline(MAX_LINE_BYTES + 1)
        if kept.strip():
            yield f"line {number}", kept


def parse_line(where: str, line: bytes) -> LiveHeader | LiveFrame:
    """Read a line: a picture if it has points, else a header.

    Raises
    ------
    InputError
        Where it is too long, no JSON, or neither of the two.
    """
    if len(line) > MAX_LINE_BYTES:
        raise refusal(
            where, "", "a longer line", f"at most {MAX_LINE_BYTES:,} bytes", "leave out what is not read"
        )
    try:
        document = parse_json(where, line)
    except InputError as error:
        raise InputError(str(error).replace(f"{where}: line 1 column", f"{where}: column")) from None
    if not isinstance(document, dict):
        raise refusal(where, "", shown(document), "an object with time and points", "see docs: live")
    if "points" in document or "time" in document:
        return live_frame(document, where)
    return live_header(document, where)


def camera_of(header: LiveHeader) -> OpenCVModel | None:
    """Return the camera of a header; None where it has none."""
    if header.camera is None:
        return None
    said = header.camera
    K, distortion, R, t = (
        None if values is None else np.array(values, dtype=np.float64)
        for values in (said.K, said.distortion, said.R, said.t)
    )
    size = None if said.size is None else (said.size[0], said.size[1])
    return OpenCVModel(K=np.array(K), distortion=distortion, R=R, t=t, size=size)


def points_of(frame: LiveFrame, names: tuple[str, ...], where: str) -> Array:
    """Lay the points of a line out in the order of `names`: (K, 3), pixels and confidences, NaN for what is missing.

    Raises
    ------
    InputError
        Where a name is none of these.
    """
    given = frame.points
    if isinstance(given, dict):
        unknown = [name for name in given if name not in names]
        if unknown:
            raise refusal(
                where, f"points.{unknown[0]}", "an unknown name", "a point's name", nearest(unknown[0], names)
            )
        given = [given.get(name) for name in names]
    out = np.full((len(given), 3), np.nan)
    for row, point in zip(out, given, strict=True):
        if point is not None:
            row[: len(point)] = [np.nan if value is None else value for value in point]
    return out


def document_of(told: TrackedPosture) -> dict[str, Any]:
    """Return what is told of a picture as JSON has it: metres, joints by name, those that are not known left out."""
    path = told.path
    return {
        "frame": told.frame,
        "time": told.time,
        "survivors": told.survivors,
        "probability": _short(told.probability),
        "joints": _by_joint(told.joints),
        "deviation": _by_joint(told.deviation),
        "near": {} if told.answer is None else _by_segment(told.answer.depth.near),
        "far": {} if told.answer is None else _by_segment(told.answer.depth.far),
        "reason": told.reason,
        "path": None
        if path is None
        else {
            "frame": path.frame,
            "time": path.time,
            "joints": _by_joint(path.joints),
            "interpolated": [name for name, so in zip(JOINTS, path.interpolated, strict=True) if so],
        },
    }


def line_of(document: dict[str, Any]) -> str:
    """Write one line."""
    return json.dumps(document, ensure_ascii=False, separators=(",", ":"), allow_nan=False) + "\n"


def _by_joint(values: Array) -> dict[str, Any]:
    """Name the joints of an array (14, ...) that are known."""
    known = np.asarray(np.isfinite(values.reshape(len(JOINTS), -1)).all(axis=1)).tolist()
    rounded = np.round(values, WRITTEN_DECIMALS).tolist()
    return {name: one for name, one, there in zip(JOINTS, rounded, known, strict=True) if there}


def _by_segment(values: Array) -> dict[str, float]:
    """Name the segments of an answer (11,) of which something is known."""
    return {
        f"{JOINTS[start]}-{JOINTS[end]}": _short(one)
        for (start, end), one in zip(ANSWER_SEGMENTS, values.tolist(), strict=True)
        if not math.isnan(one)
    }


def _short(value: float) -> float:
    return round(value, WRITTEN_DECIMALS)
