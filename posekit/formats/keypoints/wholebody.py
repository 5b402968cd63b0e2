"""COCO-WholeBody: 133 points of body, feet, face and hands, in parts or in one list.

The annotations of Jin et al. 2020 have COCO's 17 points and beside them ``foot_kpts``, ``face_kpts``,
``lefthand_kpts``, ``righthand_kpts`` with a flag each whether the part could be labelled; results have the same parts
with confidences (data format and evaluation of jin-s13/COCO-WholeBody). Detectors write the 133 in one list of
``keypoints``.

In annotations v = 1 is a hidden point for body and feet, and just a labelled one for face and hands, where a fraction
says how reliable it is. Not written: times, and confidences other than such fractions.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any, Final

import numpy as np

from posekit.formats.given_file import GivenFile
from posekit.formats.keypoints.coco_annotations import ANNOTATIONS_FIELD, annotations_of, results_of
from posekit.formats.keypoints.coco_parts import (
    FLAGGED_POINTS,
    WHOLEBODY_PARTS,
    WHOLEBODY_POINTS,
    is_wholebody,
    joined,
)
from posekit.formats.keypoints.coco_people import Parted, as_confidences, key_points_of
from posekit.formats.keypoints.key_point_format import KeyPointFormat
from posekit.formats.keypoints.keypoints import KeyPoints
from posekit.formats.keypoints.named_layout import by_count
from posekit.formats.skeleton_maps import SkeletonMap, load_skeleton_map
from posekit.geometry import Array
from posekit.safe_io import refusal

WHOLEBODY_LAYOUT: Final = "coco_wholebody_133"


def looks_like(given: GivenFile) -> bool:
    """Tell whether the first person with key points has the parts, or 133 points."""
    document = None if given.is_folder else given.document
    people = document.get(ANNOTATIONS_FIELD) if isinstance(document, dict) else document
    if not isinstance(people, list):
        return False
    first = next((one for one in people if isinstance(one, dict) and is_person(one)), None)
    return first is not None and is_wholebody(first) and type(first.get("image_id")) in (int, str)


def is_person(entry: dict[str, Any]) -> bool:
    """Tell whether an entry has key points of any part."""
    return any(name in entry for name, *_ in WHOLEBODY_PARTS)


def read(given: GivenFile, layout: SkeletonMap | None) -> KeyPoints:
    """Read annotations, or a flat list of results.

    Raises
    ------
    InputError
        Where the file is malformed, or the given layout has not 133 points.
    """
    source = given.path
    usual = {WHOLEBODY_POINTS: load_skeleton_map(WHOLEBODY_LAYOUT)}
    found = by_count(WHOLEBODY_POINTS, layout, source, usual)
    is_results = not given.is_folder and isinstance(given.document, list)
    field = "" if is_results else ANNOTATIONS_FIELD
    people, images = results_of(given, is_person) if is_results else annotations_of(given)
    values = joined(source, field, people)
    parted = as_confidences(values) if is_results else _flagged(source, values)
    return key_points_of(source, field, people, images, parted, found, format=WHOLEBODY_FORMAT.name)


def _flagged(source: Path, values: Array) -> Parted:
    """Part triples into points, confidences, and which points are hidden."""
    third = values[..., 2]
    if not ((third >= 0) & (third <= 2)).all():
        odd = float(third[~((third >= 0) & (third <= 2))][0])
        raise refusal(source, "v", f"{odd:g}", "0, 1, 2, or a fraction")
    fraction = third % 1 != 0
    fraction[:, :FLAGGED_POINTS] |= fraction[
        :, :FLAGGED_POINTS
    ].any()  # body and feet of a detector, not labelled by hand
    points = values[..., :2].copy()
    points[(third == 0) & ~fraction] = np.nan
    points[fraction & (points == 0).all(axis=-1)] = np.nan
    confidence = np.where(fraction & ~np.isnan(points[..., 0]), third, np.nan)
    occluded = (third == 1) & ~fraction
    occluded[:, FLAGGED_POINTS:] = False
    return Parted(points, confidence, occluded)


WHOLEBODY_FORMAT: Final = KeyPointFormat(
    name="coco-wholebody",
    title="COCO-WholeBody annotations or results: 133 points, in parts or in one list",
    suffixes=(".json",),
    looks_like=looks_like,
    read=read,
    skeletons=(WHOLEBODY_LAYOUT,),
)
