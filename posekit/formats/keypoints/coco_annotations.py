"""The file around COCO's annotations: pictures, people, and the category that they are of."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np

from posekit.formats.keypoints.coco_images import Images, image_ids, images_from, images_of
from posekit.formats.keypoints.coco_people import identities_of
from posekit.formats.keypoints.given import Given
from posekit.formats.keypoints.keypoints import KeyPoints
from posekit.safe_io import refusal, shown, write_text
from posekit.safe_io.writing import json_pieces

FIELD: Final = "annotations"


def annotations_of(given: Given) -> tuple[list[dict[str, Any]], Images]:
    """Return a file's people, crowds and annotations without key points left out, and its pictures.

    Raises
    ------
    InputError
        Where it has no list of annotations, or a picture is not told.
    """
    source, document = given.path, None if given.is_folder else given.document
    listed = document.get(FIELD) if isinstance(document, dict) else None
    if not isinstance(document, dict) or not isinstance(listed, list) or not all(map(_is_object, listed)):
        got = shown(document if listed is None else listed)
        raise refusal(source, FIELD, got, f'{{"images": [...], "{FIELD}": [...]}}', "check that it is COCO's")
    people = [one for one in listed if "keypoints" in one and not one.get("iscrowd")]
    if listed and not any("keypoints" in one for one in listed):
        raise refusal(
            source,
            f"{FIELD}[0]",
            shown(listed[0]),
            'a person with "keypoints"',
            "take the file of key points: person_keypoints_….json, not instances_….json",
        )
    if "images" in document:
        return people, images_of(source, document["images"])
    return people, images_from(identities_of(source, FIELD, people))


def _is_object(entry: Any) -> bool:
    return isinstance(entry, dict)


def check_pixels(path: Path, keypoints: KeyPoints) -> None:
    """Refuse fractions of pictures: COCO's points are pixels."""
    if keypoints.normalised:
        raise refusal(
            path, "points", "fractions of the picture", "pixels", "give the picture's size with --size"
        )


def write_annotations(
    path: Path, keypoints: KeyPoints, names: Sequence[str], points: Sequence[dict[str, Any]]
) -> None:
    """Write annotations, each with its points as they are spelled in `points`, for one category of people."""
    numbers = image_ids(keypoints, 1, ascending=False)
    images: list[dict[str, Any]] = [
        {"id": number, "file_name": name} for number, name in zip(numbers, keypoints.pictures, strict=True)
    ]
    for image, (width, height) in zip(images, keypoints.size, strict=True):
        image.update({} if np.isnan(width) else {"width": plain_number(width)})
        image.update({} if np.isnan(height) else {"height": plain_number(height)})
    annotations: list[dict[str, Any]] = []
    for row in np.flatnonzero(~np.isnan(keypoints.points[..., 0]).all(axis=1)).tolist():
        known = keypoints.points[row][~np.isnan(keypoints.points[row, :, 0])]
        (left, top), (width, height) = known.min(axis=0), np.ptp(known, axis=0)
        one: dict[str, Any] = {
            "id": len(annotations) + 1,
            "image_id": numbers[int(keypoints.frame[row])],
            "category_id": 1,
            "iscrowd": 0,
            "num_keypoints": len(known),
            "bbox": [float(left), float(top), float(width), float(height)],
            "area": float(width * height),
        }
        if not np.isnan(keypoints.score[row]):
            one["score"] = float(keypoints.score[row])
        if keypoints.person[row] >= 0:
            one["track_id"] = int(keypoints.person[row])
        annotations.append(one | points[row])
    category = {
        "id": 1,
        "name": "person",
        "supercategory": "person",
        "keypoints": list(names),
        "skeleton": [],
    }
    write_text(path, json_pieces({"images": images, "categories": [category]}, FIELD, annotations))


def plain_number(value: float) -> float | int:
    """Return a whole number as such, as COCO writes sizes."""
    return int(value) if float(value).is_integer() else float(value)
