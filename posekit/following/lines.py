"""Live key points as JSON lines: each picture is answered as soon as its line is read."""

from __future__ import annotations

import json
from collections.abc import Iterator
from typing import IO, Any, Final

import numpy as np

from posekit.errors import InputError, nearest, refusal, shown
from posekit.following.tracker import TrackedPosture, Tracker
from posekit.geometry import Array
from posekit.skeleton import JOINTS, TREE_SEGMENTS, segment_name

#: Decimals of metres, seconds and probabilities that are written.
DECIMALS: Final = 6


def answers(stream: IO[bytes], tracker: Tracker, *, keep_going: bool = False) -> Iterator[str]:
    """Yield one answer for each picture of a stream, before the next picture is read.

    Parameters
    ----------
    stream : binary file
        A line is ``{"time": seconds, "points": [[x, y, confidence], …]}``, with null for a point that is not seen, or
        with points by name.
    tracker : Tracker
    keep_going : bool
        Whether a line that cannot be read is answered by ``{"error": …}``; otherwise it ends the stream.

    Raises
    ------
    InputError
        If a line cannot be read.
    """
    for number, line in enumerate(iter(stream.readline, b""), start=1):
        if not line.strip():
            continue
        where = f"line {number}"
        try:
            time, points, root = _picture(where, line, tracker.names)
            answer = _document(tracker.update(points, time, root=root))
        except InputError as error:
            if not keep_going:
                raise error if str(error).startswith(where) else InputError(f"{where}: {error}") from None
            answer = {"error": str(error)}
        yield json.dumps(answer, ensure_ascii=False, separators=(",", ":"), allow_nan=False) + "\n"


def _picture(where: str, line: bytes, names: tuple[str, ...]) -> tuple[float, Array, Any]:
    """Read the time, the points (K, 3) and the neck position of a line."""
    try:
        document = json.loads(line)
        time, given = float(document["time"]), document["points"]
        if isinstance(given, dict):
            unknown = [name for name in given if name not in names]
            if unknown:
                near = nearest(unknown[0], names)
                raise refusal(where, "points", shown(unknown[0]), "a point's name", near)
            given = [given.get(name) for name in names]
        points = np.full((len(given), 3), np.nan)
        for row, point in zip(points, given, strict=True):
            if point is not None:
                row[: len(point)] = [np.nan if value is None else float(value) for value in point]
        return time, points, document.get("root")
    except (KeyError, TypeError, ValueError, AttributeError, RecursionError):
        got = shown(line.decode(errors="replace").strip())
        expected = '{"time": seconds, "points": [[x, y], …]}'
        raise refusal(where, "", got, expected, "see posekit follow --help") from None


def _document(posture: TrackedPosture) -> dict[str, Any]:
    """Return an answer as JSON values: metres, joints by name, without unknown joints."""
    found: dict[str, Any] = {
        "frame": posture.frame,
        "time": posture.time,
        "survivors": posture.survivors,
        "sure": round(posture.sure, DECIMALS),
        "joints": _by_joint(posture.joints),
        "nearer": {},
        "reason": posture.reason,
        "path": posture.path and posture.path._asdict() | {"joints": _by_joint(posture.path.joints)},
    }
    if posture.recovery is not None and posture.survivors:
        answer = posture.recovery.answer
        found["nearer"] = {
            segment_name(pair): [JOINTS[pair[1] if side > 0 else pair[0]], round(float(chance), DECIMALS)]
            for pair, side, chance in zip(TREE_SEGMENTS, answer.nearer[0], answer.nearer_sure[0], strict=True)
            if side
        }
    return found


def _by_joint(values: Array) -> dict[str, list[float]]:
    rounded = np.round(values, DECIMALS)
    return {name: one.tolist() for name, one in zip(JOINTS, rounded, strict=True) if np.isfinite(one).all()}
