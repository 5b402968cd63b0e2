"""AlphaPose: a flat list of people with the picture's name, or one object by pictures.

MVIG-SJTU/AlphaPose, docs/output.md and alphapose/utils/pPose_nms.py (``write_json``): ``[{image_id, category_id,
keypoints: [x, y, c]*K, score, box, idx}]``, `image_id` a text. With ``--format cmu`` or ``open`` it is one object,
``{image_id: {version, bodies: [{joints}]}}`` or ``{…: {version, people: [{pose_keypoints_2d}]}}``, of OpenPose's 18
COCO points; the same without `image_id` stands in a file a picture. `idx` is who it is where people were tracked, a
list where several detections were merged. Confidences of old COCO models go up to 6, and stay.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any, Final

import numpy as np

from posekit.formats.given_file import GivenFile
from posekit.formats.keypoints.key_point_format import KeyPointFormat
from posekit.formats.keypoints.keypoints import KeyPoints
from posekit.formats.keypoints.named_layout import by_count
from posekit.formats.keypoints.rows import DetectionRows, numbers
from posekit.formats.skeleton_maps import SkeletonMap, load_skeleton_map
from posekit.safe_io import cut, refusal, shown

POINTS_FIELD_OF_PEOPLE = {"bodies": "joints", "people": "pose_keypoints_2d"}
"""Where the people of a picture are and where their points, by ``--format cmu`` and ``open``."""


def looks_like(given: GivenFile) -> bool:
    """Tell whether it is one of AlphaPose's layouts; a file a picture of ``--format open`` is OpenPose's."""
    document = given.document
    if isinstance(document, list):
        return bool(document) and _is_row(document[0]) and isinstance(document[0]["image_id"], str)
    if not isinstance(document, dict) or not document:
        return False
    return _is_picture(document, ("bodies",)) or _is_picture(
        next(iter(document.values())), tuple(POINTS_FIELD_OF_PEOPLE)
    )


def _is_row(entry: object) -> bool:
    return isinstance(entry, dict) and "image_id" in entry and isinstance(entry.get("keypoints"), list)


def _is_picture(entry: object, kinds: tuple[str, ...]) -> bool:
    return isinstance(entry, dict) and any(isinstance(entry.get(kind), list) for kind in kinds)


def read(given: GivenFile, layout: SkeletonMap | None) -> KeyPoints:
    """Read AlphaPose's results.

    Raises
    ------
    InputError
        Where it is none of its layouts, or nothing tells what the points are.
    """
    rows = DetectionRows(str(given.path))
    by_pictures = False
    for path, document in rows.documents(given):
        if isinstance(document, list):
            _read_list(rows, document)
            continue
        by_pictures = True
        pictures = {path.stem: document} if _is_picture(document, tuple(POINTS_FIELD_OF_PEOPLE)) else document
        if not isinstance(pictures, dict):
            raise refusal(
                path, "", shown(document), "a list of people, or pictures by name", "check the file"
            )
        for label, picture in pictures.items():
            _read_picture(rows, label, picture)
    usual = {18: load_skeleton_map("coco_18")} if by_pictures else _usual()
    return rows.keypoints("alphapose", by_count(rows.count, layout, given.path, usual))


def _usual() -> dict[int, SkeletonMap]:
    """List what AlphaPose's models write (docs/MODEL_ZOO.md): COCO, Halpe, and Halpe without the face."""
    body, full = load_skeleton_map("halpe_26"), load_skeleton_map("halpe_136")
    without_face = replace(body, name="halpe_68", points=body.points + full.points[26 + 68 :])
    return {17: load_skeleton_map("coco_17"), 26: body, 68: without_face, 136: full}


def _read_list(rows: DetectionRows, people: list[Any]) -> None:
    for index, person in enumerate(people):
        place = f"[{index}]"
        if not _is_row(person) or not isinstance(person["image_id"], str | int):
            expected = "a person with image_id and keypoints"
            raise refusal(rows.source, place, shown(person), expected, "check the file")
        _add(rows, person["image_id"], person["keypoints"], f"{place}.keypoints", person)


def _read_picture(rows: DetectionRows, label: str, picture: object) -> None:
    kind = next((kind for kind in POINTS_FIELD_OF_PEOPLE if _is_picture(picture, (kind,))), None)
    if kind is None or not isinstance(picture, dict):
        raise refusal(rows.source, cut(label), shown(picture), "bodies or people", "check the file")
    rows.picture(label)
    field = POINTS_FIELD_OF_PEOPLE[kind]
    for index, person in enumerate(picture[kind]):
        place = f"{cut(label)}.{kind}[{index}]"
        if not isinstance(person, dict):
            raise refusal(rows.source, place, shown(person), f"{{{field}}}", "check the file")
        _add(rows, label, person.get(field), f"{place}.{field}", person)


def _add(rows: DetectionRows, label: object, keypoints: object, field: str, person: dict[str, Any]) -> None:
    found = numbers(keypoints, rows.source, field, 3)
    found[(found == 0).all(axis=1)] = np.nan
    identity = person.get("idx")
    while isinstance(identity, list) and identity:
        identity = identity[0]
    rows.add(label, found[:, :2], found[:, 2], person=identity, score=person.get("score"))


ALPHAPOSE_FORMAT: Final = KeyPointFormat(
    name="alphapose",
    title="AlphaPose: a list of people with the picture's name, or an object by pictures (cmu, open)",
    suffixes=(".json",),
    folder=True,
    looks_like=looks_like,
    read=read,
    skeletons=("coco_17", "halpe_26", "halpe_136", "coco_18"),
)
