"""COCO annotations of people: ``{"images": […], "annotations": […], "categories": […]}``.

A person's ``keypoints`` are ``[x, y, v] * K`` with v = 0 for a point without label (x = y = 0), 1 for one that is
labelled though hidden, 2 for a visible one (Lin et al. 2014; cocodataset.org, "Data format"). Halpe's files (26 or 136
points) are the same. Files of detectors in this shape have a confidence for v: where one of a file's numbers is a
fraction, all are taken so.

Crowds (``iscrowd`` = 1), and people of whom no point is labelled, are no detections. Not read: outlines, boxes, areas.
Not written: times, and confidences, for which there is `posekit.formats.keypoints.coco_results`.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any, Final

import numpy as np

from posekit.errors import InputError
from posekit.formats.given_file import GivenFile
from posekit.formats.keypoints.coco_annotations import ANNOTATIONS_FIELD, annotations_of
from posekit.formats.keypoints.coco_layout import layout_of
from posekit.formats.keypoints.coco_parts import is_wholebody
from posekit.formats.keypoints.coco_people import Parted, as_confidences, key_points_of
from posekit.formats.keypoints.coco_triples import triples
from posekit.formats.keypoints.key_point_format import KeyPointFormat
from posekit.formats.keypoints.keypoints import KeyPoints
from posekit.formats.skeleton_maps import SkeletonMap, find_by_names
from posekit.geometry import Array
from posekit.safe_io import refusal


def looks_like(given: GivenFile) -> bool:
    """Tell whether a file has annotations with key points, or categories with names for them."""
    document = None if given.is_folder else given.document
    if not isinstance(document, dict) or not isinstance(document.get(ANNOTATIONS_FIELD), list):
        return False
    first = next(
        (one for one in document[ANNOTATIONS_FIELD] if isinstance(one, dict) and "keypoints" in one), None
    )
    if first is None:
        return not document[ANNOTATIONS_FIELD] and any(_names(document).values())
    return not is_wholebody(first)


def read(given: GivenFile, layout: SkeletonMap | None) -> KeyPoints:
    """Read a file.

    Raises
    ------
    InputError
        Where it is malformed, or the layout is not clear.
    """
    source = given.path
    people, images = annotations_of(given)
    people, names = _of_one_kind(source, people, _names(given.document), layout)
    values = triples(
        source,
        [one["keypoints"] for one in people],
        lambda k: f"{ANNOTATIONS_FIELD}[…].keypoints, person {k}",
    )
    found = _layout(source, values, names, layout)
    parted = _flagged(source, values)
    return key_points_of(source, ANNOTATIONS_FIELD, people, images, parted, found, format=COCO_FORMAT.name)


def _names(document: Any) -> dict[Any, tuple[str, ...]]:
    """Return the names of the points of each category, by its id; leave out categories without any."""
    categories = document.get("categories") if isinstance(document, dict) else None
    found: dict[Any, tuple[str, ...]] = {}
    for one in categories if isinstance(categories, list) else ():
        names = one.get("keypoints") if isinstance(one, dict) else None
        if isinstance(names, list) and names and all(isinstance(name, str) for name in names):
            if isinstance(one.get("id"), int | str):
                found[one["id"]] = tuple(names)
    return found


def _of_one_kind(
    source: Path, people: list[dict[str, Any]], names: dict[Any, tuple[str, ...]], layout: SkeletonMap | None
) -> tuple[list[dict[str, Any]], tuple[str, ...]]:
    """Keep the people whose category names the points of a body; return them and the names."""
    kinds = {names.get(one.get("category_id"), ()) for one in people if _hashable(one.get("category_id"))}
    if len(kinds) <= 1 or not people:
        only = kinds.pop() if kinds else (next(iter(names.values())) if len(set(names.values())) == 1 else ())
        return people, only
    bodies = [kind for kind in kinds if kind and (layout is not None or find_by_names(kind, detectors=True))]
    if layout is not None:
        bodies = [kind for kind in bodies if _places(source, kind, layout)]
    if len(bodies) != 1:
        got = f"{len(kinds)} kinds of people with points of their own"
        remedy = "split the file by categories, or give a map that fits one with --skeleton"
        raise refusal(source, "categories", got, "one kind, with the points of a body", remedy)
    return [one for one in people if names.get(one.get("category_id"), ()) == bodies[0]], bodies[0]


def _hashable(value: Any) -> bool:
    return not isinstance(value, list | dict)


def _places(source: Path, names: tuple[str, ...], layout: SkeletonMap) -> bool:
    try:
        layout_of(source, COCO_FORMAT.name, len(names), names, layout)
    except InputError:
        return False
    return True


def _layout(source: Path, values: Array, names: tuple[str, ...], layout: SkeletonMap | None) -> SkeletonMap:
    count = values.shape[1] or len(names) or (len(layout.points) if layout is not None else 0) or 17
    return layout_of(source, COCO_FORMAT.name, count, names, layout)


def _flagged(source: Path, values: Array) -> Parted:
    """Part triples into points, confidences, and which points are hidden."""
    third = values[..., 2]
    if not np.isin(third, (0, 1, 2)).all():
        if not (third % 1 != 0).any():
            odd = float(third[~np.isin(third, (0, 1, 2))][0])
            raise refusal(source, "keypoints", f"v = {odd:g}", "0, 1, 2, or a confidence")
        return as_confidences(values)
    points = values[..., :2].copy()
    points[third == 0] = np.nan
    return Parted(points, np.full(third.shape, np.nan), third == 1)


COCO_FORMAT: Final = KeyPointFormat(
    name="coco",
    title="COCO annotations of people, and Halpe's: images, annotations, categories",
    suffixes=(".json",),
    looks_like=looks_like,
    read=read,
    skeletons=("coco_17", "halpe_26", "halpe_136", "h36m_17", "body_25", "body_25b", "coco_18"),
)
