"""MMPose's instances: a person as its demos and its Inferencer write one, in either layout.

``mmpose.structures.split_instances`` makes of every person ``{keypoints: [[x, y], …], keypoint_scores: […],
bbox: [[x1, y1, x2, y2]], bbox_score}`` (MMPose 1.x, open-mmlab/mmpose, mmpose/structures/utils.py). Decoders put a
point whose score is not positive at -1 of the crop (mmpose/codecs/utils/post_processing.py: ``locs[vals <= 0.] = -1``),
which lands at the corner of the box: it is missing.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from posekit.formats.keypoints.rows import DetectionRows, numbers, pairs, whole
from posekit.geometry import Array
from posekit.safe_io import refusal, shown


def is_instance(entry: object) -> bool:
    """Tell whether something looks like a person of MMPose."""
    return isinstance(entry, dict) and "keypoints" in entry and "keypoint_scores" in entry


def is_frame(entry: object) -> bool:
    """Tell whether something looks like a picture of MMPose: its people, and its number."""
    return isinstance(entry, dict) and isinstance(entry.get("instances"), list) and "frame_id" in entry


def add_frames(rows: DetectionRows, frames: list[Any], field: str) -> None:
    """Note pictures ``{frame_id, instances}``."""
    for index, frame in enumerate(frames):
        place = f"{field}[{index}]"
        if not is_frame(frame):
            raise refusal(
                rows.source, place, shown(frame), "a picture {frame_id, instances}", "save the file again"
            )
        label = frame["frame_id"]
        if whole(label) is None and not isinstance(label, str):
            raise refusal(rows.source, f"{place}.frame_id", shown(label), "the picture's number")
        add_instances(rows, rows.picture(label), frame["instances"], f"{place}.instances")


def add_instances(rows: DetectionRows, label: str, instances: list[Any], field: str) -> None:
    """Note the people of one picture."""
    rows.picture(label)
    for index, instance in enumerate(instances):
        place = f"{field}[{index}]"
        if not is_instance(instance):
            raise refusal(
                rows.source, place, shown(instance), "keypoints and keypoint_scores", "save the file again"
            )
        points = pairs(instance["keypoints"], rows.source, f"{place}.keypoints")
        if points.shape[1] != 2:
            what = "three: points in space" if points.shape[1] == 3 else str(points.shape[1])
            got = f"{what} coordinates a point"
            remedy = "save the predictions of a 2-D model: a lifted pose is no picture"
            raise refusal(rows.source, f"{place}.keypoints", got, "two, pixels", remedy)
        scores = _scores(rows.source, f"{place}.keypoint_scores", instance["keypoint_scores"], len(points))
        points = np.where((scores <= 0)[:, None], np.nan, points)
        rows.add(label, points, scores, person=instance.get("track_id"), score=instance.get("bbox_score"))


def _scores(source: str | Path, field: str, scores: object, count: int) -> Array:
    array = numbers(scores, source, field, 1)[:, 0]
    if len(array) != count:
        raise refusal(source, field, f"{len(array)} scores", f"{count}, one a point", "save the file again")
    return array
