"""The file around COCO's annotations: pictures, people, and the category that they are of."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final

from posekit.formats.given_file import GivenFile
from posekit.formats.keypoints.coco_images import Images, images_from, images_of
from posekit.formats.keypoints.coco_people import identities_of
from posekit.safe_io import refusal, shown

ANNOTATIONS_FIELD: Final = "annotations"


def annotations_of(given: GivenFile) -> tuple[list[dict[str, Any]], Images]:
    """Return a file's people, crowds and annotations without key points left out, and its pictures.

    Raises
    ------
    InputError
        Where it has no list of annotations, or a picture is not told.
    """
    source, document = given.path, None if given.is_folder else given.document
    listed = document.get(ANNOTATIONS_FIELD) if isinstance(document, dict) else None
    if not isinstance(document, dict) or not isinstance(listed, list) or not all(map(_is_object, listed)):
        got = shown(document if listed is None else listed)
        expected = f'{{"images": [...], "{ANNOTATIONS_FIELD}": [...]}}'
        raise refusal(source, ANNOTATIONS_FIELD, got, expected, "check that it is COCO's")
    people = [one for one in listed if "keypoints" in one and not one.get("iscrowd")]
    if listed and not any("keypoints" in one for one in listed):
        expected = 'a person with "keypoints"'
        remedy = "take the file of key points: person_keypoints_….json, not instances_….json"
        raise refusal(source, f"{ANNOTATIONS_FIELD}[0]", shown(listed[0]), expected, remedy)
    if "images" in document:
        return people, images_of(source, document["images"])
    return people, images_from(identities_of(source, ANNOTATIONS_FIELD, people))


def _is_object(entry: Any) -> bool:
    return isinstance(entry, dict)


def results_of(
    given: GivenFile, is_person: Callable[[dict[str, Any]], bool]
) -> tuple[list[dict[str, Any]], Images]:
    """Return the people of a flat list, and their pictures.

    Parameters
    ----------
    given : GivenFile
        The file.
    is_person : callable
        Tells whether an entry has key points.

    Raises
    ------
    InputError
        Where it is no list of people with key points, or the picture of one is not told.
    """
    source, document = given.path, None if given.is_folder else given.document
    if not isinstance(document, list):
        raise refusal(source, "", shown(document), "a list of people", "check that it is COCO results")
    for place, one in enumerate(document):
        if not _is_object(one) or not is_person(one):
            raise refusal(source, f"[{place}]", shown(one), 'an object with "keypoints"')
    return document, images_from(identities_of(source, "", document))
