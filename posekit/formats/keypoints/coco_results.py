"""COCO results: a flat list of what a detector found, ``[{"image_id", "category_id", "keypoints", "score"}, …]``.

The format of the key-point challenge (cocodataset.org, "Results format"), which most detectors can write:
``keypoints`` are ``[x, y, c] * K`` and the pictures are numbers. The points are not named, so 17 are COCO's unless a
layout is given.

A list has no pictures without people, no sizes, no times, and does not say which points are hidden: these are not
written. Pictures whose names are no ascending numbers are counted from 0. A score or a confidence that is not known is
written as 1.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from posekit.formats.given_file import GivenFile
from posekit.formats.keypoints.coco_images import images_from
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
from posekit.formats.keypoints.coco_triples import triples
from posekit.formats.keypoints.key_point_format import KeyPointFormat
from posekit.formats.keypoints.keypoints import KeyPoints
from posekit.formats.skeleton_maps import SkeletonMap
from posekit.safe_io import refusal, shown


def looks_like(given: GivenFile) -> bool:
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


def read(given: GivenFile, layout: SkeletonMap | None) -> KeyPoints:
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
            raise refusal(source, f"[{place}]", shown(one), 'an object with "keypoints"')
    images = images_from(identities_of(source, "", document))
    values = triples(source, [one["keypoints"] for one in document], lambda k: f"[{k}].keypoints")
    points, confidence = as_confidences(values)
    count = values.shape[1] or (len(layout.points) if layout is not None else 17)
    frame = pictures_of(source, "", document, images)
    rows = by_picture(frame, points)
    return KeyPoints(
        format=COCO_RESULTS_FORMAT.name,
        source=str(source),
        layout=layout_of(source, COCO_RESULTS_FORMAT.name, count, (), layout),
        pictures=images.names,
        frame=frame[rows],
        points=points[rows] if points.size else np.empty((0, count, 2)),
        confidence=confidence[rows],
        score=scores_of(source, "", document)[rows],
        person=tracks_of(source, "", document)[rows],
    )


COCO_RESULTS_FORMAT: Final = KeyPointFormat(
    name="coco-results",
    title="COCO results: a flat list of people with image_id, keypoints and score",
    suffixes=(".json",),
    looks_like=looks_like,
    read=read,
    skeletons=("coco_17", "halpe_26", "halpe_136", "h36m_17", "body_25", "body_25b", "coco_18"),
)
