"""Write MediaPipe's landmarks: JSON of frames, or a table with a row a landmark."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from posekit.formats.keypoints.keypoints import KeyPoints
from posekit.formats.keypoints.mediapipe_names import NAMES
from posekit.formats.keypoints.rows import whole
from posekit.safe_io import write_text
from posekit.safe_io.writing import json_pieces


def write_json_of(path: Path, keypoints: KeyPoints) -> None:
    """Write ``{frames: [{frame, time, image_width, image_height, people: [{pose_landmarks}]}]}``, a frame a line."""
    write_text(path, json_pieces({"landmarks": "mediapipe pose 33"}, "frames", _frames(keypoints)))


def _frames(keypoints: KeyPoints) -> Iterator[dict[str, Any]]:
    start = np.searchsorted(keypoints.frame, np.arange(len(keypoints.pictures) + 1))
    for index, label in enumerate(keypoints.pictures):
        number = whole(label)
        frame: dict[str, Any] = {"frame": label if number is None or str(number) != label else number}
        if not np.isnan(keypoints.time[index]):
            frame["time"] = float(keypoints.time[index])
        if not np.isnan(keypoints.size[index]).any():
            frame["image_width"], frame["image_height"] = map(float, keypoints.size[index])
        frame["pose_landmarks"] = [
            [_landmark(keypoints, row, k) for k in range(len(NAMES))]
            for row in range(start[index], start[index + 1])
        ]
        yield frame


def _landmark(keypoints: KeyPoints, row: int, k: int) -> dict[str, float | None]:
    x, y = map(float, keypoints.points[row, k])
    if np.isnan(x):
        return {"x": None, "y": None}
    sure = float(keypoints.confidence[row, k])
    return {"x": x, "y": y} if np.isnan(sure) else {"x": x, "y": y, "visibility": sure}


def write_table_of(path: Path, keypoints: KeyPoints) -> None:
    """Write ``frame,time,person,landmark,x,y,visibility``: a row a landmark that is known."""
    write_text(path, _table(keypoints))


def _table(keypoints: KeyPoints) -> Iterator[str]:
    yield "frame,time,person,landmark,x,y,visibility\n"
    count: dict[int, int] = {}
    for row, frame in enumerate(keypoints.frame):
        person = count[int(frame)] = count.get(int(frame), -1) + 1
        time = keypoints.time[frame]
        lines = io.StringIO()
        table = csv.writer(lines, lineterminator="\n")
        for k, name in enumerate(NAMES):
            x, y = map(float, keypoints.points[row, k])
            if not np.isnan(x):
                sure = float(keypoints.confidence[row, k])
                described = [
                    keypoints.pictures[frame],
                    "" if np.isnan(time) else repr(float(time)),
                    person,
                    name,
                ]
                table.writerow([*described, repr(x), repr(y), "" if np.isnan(sure) else repr(sure)])
        yield lines.getvalue()
