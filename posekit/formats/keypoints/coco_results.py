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

from posekit.formats.given_file import GivenFile
from posekit.formats.keypoints.coco_annotations import results_of
from posekit.formats.keypoints.coco_layout import layout_of
from posekit.formats.keypoints.coco_parts import is_wholebody
from posekit.formats.keypoints.coco_people import as_confidences, key_points_of
from posekit.formats.keypoints.coco_triples import triples
from posekit.formats.keypoints.key_point_format import KeyPointFormat
from posekit.formats.keypoints.keypoints import KeyPoints
from posekit.formats.skeleton_maps import SkeletonMap


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
    source = given.path
    people, images = results_of(given, lambda one: "keypoints" in one)
    values = triples(source, [one["keypoints"] for one in people], lambda k: f"[{k}].keypoints")
    count = values.shape[1] or (len(layout.points) if layout is not None else 17)
    return key_points_of(
        source,
        "",
        people,
        images,
        as_confidences(values),
        layout_of(source, COCO_RESULTS_FORMAT.name, count, (), layout),
        format=COCO_RESULTS_FORMAT.name,
        sequence=True,
    )


COCO_RESULTS_FORMAT: Final = KeyPointFormat(
    name="coco-results",
    title="COCO results: a flat list of people with image_id, keypoints and score",
    suffixes=(".json",),
    looks_like=looks_like,
    read=read,
    skeletons=("coco_17", "halpe_26", "halpe_136", "h36m_17", "body_25", "body_25b", "coco_18"),
)
