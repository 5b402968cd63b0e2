"""OpenPose: a folder of one JSON file a picture, or one such file.

``{"version": 1.3, "people": [{"person_id": [-1], "pose_keypoints_2d": [x, y, c] * K, …}]}`` (OpenPose's
doc/02_output.md): K is 25 for BODY_25 and BODY_25B, which `tell_apart` tells apart, and 18 for COCO. A missing point is
(0, 0, 0). Points are pixels of the picture unless OpenPose ran with ``--keypoint_scale``: 3 gives fractions, 4 numbers
from -1 to 1 (src/openpose/core/keypointScaler.cpp), which both become fractions here. Scales 1 and 2, pixels of
another size, cannot be seen in the file.

Not read: faces, hands, points in space, candidates. Not written: sizes and times of pictures, scores of people, which
points are occluded.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any, Final

import numpy as np

from posekit.formats.given_file import GivenFile
from posekit.formats.keypoints.coco_triples import triples
from posekit.formats.keypoints.key_point_format import KeyPointFormat
from posekit.formats.keypoints.keypoints import KeyPoints
from posekit.formats.keypoints.named_layout import by_count
from posekit.formats.keypoints.openpose_layout import tell_apart
from posekit.formats.keypoints.openpose_names import check_one_camera, picture_name
from posekit.formats.skeleton_maps import SkeletonMap, load_skeleton_map
from posekit.geometry import Array
from posekit.safe_io import refusal, shown

POINTS_FIELDS: Final = ("pose_keypoints_2d", "pose_keypoints")
"""Where a person's points are; the second in files older than 2018."""
OPENPOSE_LAYOUTS: Final = ("body_25", "body_25b", "coco_18")


def looks_like(given: GivenFile) -> bool:
    """Tell whether a file, or a folder's first one, has people with ``pose_keypoints_2d``."""
    document = given.document
    if not isinstance(document, dict) or not isinstance(document.get("people"), list):
        return False
    return all(isinstance(one, dict) and _points(one) is not None for one in document["people"])


def read(given: GivenFile, layout: SkeletonMap | None) -> KeyPoints:
    """Read a folder, or one file.

    Raises
    ------
    InputError
        Where a folder mixes cameras or formats, a file is malformed, or the layout is not clear.
    """
    if given.is_folder:
        check_one_camera(given.path, given.files)
    pictures: list[str] = []
    lists: list[Any] = []
    frame: list[int] = []
    person: list[int] = []
    places: list[str] = []
    people = 0
    for index, (path, document) in enumerate(given.documents()):
        pictures.append(picture_name(path))
        where = f"{path.name}: " if given.is_folder else ""
        for number, one in enumerate(_people(path, document)):
            field = f"{where}people[{number}]"
            values = _points(one)
            if values is None:
                expected = f'an object with "{POINTS_FIELDS[0]}"'
                raise refusal(given.path, field, shown(one), expected, "check how it was written")
            people += 1
            if values != []:
                lists.append(values)
                frame.append(index)
                person.append(_identity(given.path, f"{field}.person_id", one))
                places.append(f"{field}.{POINTS_FIELDS[0]}")
    if people and not lists:
        got = f"{people} without points of the body"
        remedy = "run OpenPose with its body detector (not --body 0)"
        raise refusal(given.path, "people", got, f'points in "{POINTS_FIELDS[0]}"', remedy)
    values = triples(given.path, lists, places.__getitem__)
    points, confidence, normalised = _known(values)
    found = _layout(given.path, points, layout)
    some = ~np.isnan(points[..., 0]).all(axis=1)
    return KeyPoints(
        format=OPENPOSE_FORMAT.name,
        source=str(given.path),
        layout=found,
        pictures=tuple(pictures),
        frame=np.array(frame, dtype=np.intp)[some],
        points=points[some] if some.size else np.empty((0, len(found.points), 2)),
        confidence=confidence[some],
        person=np.array(person, dtype=np.intp)[some],
        normalised=normalised,
    )


def _people(path: Path, document: Any) -> list[Any]:
    people = document.get("people") if isinstance(document, dict) else None
    if not isinstance(people, list):
        got = shown(document if people is None else people)
        remedy = "keep files of other formats out of the folder"
        raise refusal(path, "people", got, '{"people": [...]} as OpenPose writes it', remedy)
    return people


def _points(person: Any) -> Any:
    if not isinstance(person, dict):
        return None
    return next((person[name] for name in POINTS_FIELDS if name in person), None)


def _identity(source: Path, field: str, person: dict[str, Any]) -> int:
    """Return who a person is along the pictures, -1 where OpenPose did not track."""
    value = person.get("person_id", -1)
    if isinstance(value, list):
        value = value[0] if len(value) == 1 else (-1 if not value else value)
    if type(value) is not int or not -1 <= value < 2**31:
        raise refusal(source, field, shown(value), "a number, or -1 for unknown")
    return value


def _known(values: Array) -> tuple[Array, Array, bool]:
    """Part what OpenPose wrote into points, confidences, and whether the points are fractions of the picture."""
    points, confidence = values[..., :2].copy(), values[..., 2].copy()
    sure = (confidence != 0) & ~np.isnan(points).any(axis=-1) & (points != 0).any(axis=-1)
    inside = points[sure]
    normalised = bool(inside.size and np.abs(inside).max() <= 1)
    if normalised and inside.min() < 0:
        missing = (confidence == 0) | np.isnan(points).any(axis=-1)  # the middle of the picture is (0, 0)
        points = (points + 1) / 2
    else:
        missing = np.isnan(points).all(axis=-1) | (points == 0).all(axis=-1)
    points[missing] = np.nan
    confidence[missing] = np.nan
    return points, confidence, normalised


def _layout(source: Path, points: Array, layout: SkeletonMap | None) -> SkeletonMap:
    usual = {25: load_skeleton_map("body_25"), 18: load_skeleton_map("coco_18")}
    found = by_count(points.shape[1], layout, source, usual)
    candidates = tell_apart(points) if layout is None and found is usual[25] and len(points) else [found]
    if len(candidates) > 1:
        got = "25 points that could be of either order"
        expected = " or ".join(f"{OPENPOSE_FORMAT.name}-{one.name}" for one in candidates)
        raise refusal(source, "format", got, expected, "say which with --format")
    return candidates[0]


OPENPOSE_FORMAT: Final = KeyPointFormat(
    name="openpose",
    title="OpenPose: a folder of one JSON file a picture (BODY_25, BODY_25B, COCO-18)",
    suffixes=(".json",),
    folder=True,
    looks_like=looks_like,
    read=read,
    skeletons=OPENPOSE_LAYOUTS,
)
