"""COCO results: a flat list of what a detector found, ``[{"image_id", "category_id", "keypoints", "score"}, …]``.

The format of the key-point challenge (cocodataset.org, "Results format"), which most detectors can write:
``keypoints`` are ``[x, y, c] * K`` and the pictures are numbers. The points are not named, so 17 are COCO's unless a
layout is given.

A list has no pictures without people, no sizes, no times, and does not say which points are hidden: these are not
written. Pictures whose names are no ascending numbers are counted from 0. A score or a confidence that is not known is
written as 1.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np

from posekit.formats.keypoints.coco_annotations import check_pixels
from posekit.formats.keypoints.coco_images import image_ids, images_from
from posekit.formats.keypoints.coco_layout import layout_of
from posekit.formats.keypoints.coco_parts import is_wholebody
from posekit.formats.keypoints.coco_people import (
    as_confidences,
    by_picture,
    identities_of,
    pictures_of,
    scores_of,
    tracks_of,
)
from posekit.formats.keypoints.coco_triples import flat, triples
from posekit.formats.keypoints.format import Format
from posekit.formats.keypoints.given import Given
from posekit.formats.keypoints.keypoints import KeyPoints
from posekit.formats.skeleton_maps import SkeletonMap
from posekit.safe_io import refusal, shown, write_text


def suits(given: Given) -> bool:
    """Tell whether a file is a list of people with key points in pictures that are numbers.

    Pictures that are names are AlphaPose's.
    """
    document = None if given.is_folder else given.document
    first = document[0] if isinstance(document, list) and document else None
    return (
        isinstance(first, dict)
        and isinstance(first.get("keypoints"), list)
        and type(first.get("image_id")) is int
        and not is_wholebody(first)
    )


def read(given: Given, layout: SkeletonMap | None) -> KeyPoints:
    """Read a file; its pictures are those with people, by ascending number.

    Raises
    ------
    InputError
        Where it is malformed, or the layout is not clear.
    """
    source, document = given.path, None if given.is_folder else given.document
    if not isinstance(document, list):
        raise refusal(source, "", shown(document), "a list of people", "check that it is COCO results")
    for place, one in enumerate(document):
        if not isinstance(one, dict) or "keypoints" not in one:
            raise refusal(source, f"[{place}]", shown(one), 'an object with "keypoints"', "correct it")
    images = images_from(identities_of(source, "", document))
    values = triples(source, [one["keypoints"] for one in document], lambda k: f"[{k}].keypoints")
    points, confidence = as_confidences(values)
    count = values.shape[1] or (len(layout.points) if layout is not None else 17)
    frame = pictures_of(source, "", document, images)
    rows = by_picture(frame, points)
    return KeyPoints(
        format=FORMAT.name,
        source=str(source),
        layout=layout_of(source, FORMAT.name, count, (), layout),
        pictures=images.names,
        frame=frame[rows],
        points=points[rows] if points.size else np.empty((0, count, 2)),
        confidence=confidence[rows],
        score=scores_of(source, "", document)[rows],
        person=tracks_of(source, "", document)[rows],
    )


def write(path: Path, keypoints: KeyPoints) -> None:
    """Write a file.

    Raises
    ------
    InputError
        Where points are fractions of pictures of unknown size, or the file cannot be written.
    """
    check_pixels(path, keypoints)
    rows = flat(keypoints.points, np.where(np.isnan(keypoints.confidence), 1, keypoints.confidence))
    numbers = image_ids(keypoints, 0, ascending=True)
    people: list[dict[str, Any]] = []
    for row in np.flatnonzero(~np.isnan(keypoints.points[..., 0]).all(axis=1)):
        score = float(keypoints.score[row])
        one: dict[str, Any] = {
            "image_id": numbers[int(keypoints.frame[row])],
            "category_id": 1,
            "keypoints": rows[row],
            "score": 1.0 if np.isnan(score) else score,
        }
        if keypoints.person[row] >= 0:
            one["track_id"] = int(keypoints.person[row])
        people.append(one)
    write_text(path, _pieces(people))


def _pieces(people: list[dict[str, Any]]) -> list[str]:
    lines = [json.dumps(one, allow_nan=False) for one in people]
    return ["[\n", ",\n".join(lines), "\n]\n"]


FORMAT = Format(
    name="coco-results",
    says="COCO results: a flat list of people with image_id, keypoints and score",
    suits=suits,
    read=read,
    write=write,
    skeletons=("coco_17", "halpe_26", "halpe_136", "h36m_17", "body_25", "body_25b", "coco_18"),
)
