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

import secrets
import shutil
from pathlib import Path
from typing import Any, Final

import numpy as np

from posekit.errors import InputError
from posekit.formats.keypoints.coco_triples import flat, triples
from posekit.formats.keypoints.format import Format
from posekit.formats.keypoints.given import Given
from posekit.formats.keypoints.keypoints import KeyPoints
from posekit.formats.keypoints.openpose_layout import tell_apart
from posekit.formats.keypoints.openpose_names import check_one_camera, file_names, picture_name
from posekit.formats.skeleton_maps import SkeletonMap, load_skeleton_map
from posekit.geometry import Array
from posekit.safe_io import cut, refusal, shown, write_text
from posekit.safe_io.writing import json_pieces, make_folder

POINTS: Final = ("pose_keypoints_2d", "pose_keypoints")
"""Where a person's points are; the second in files older than 2018."""
LAYOUTS: Final = ("body_25", "body_25b", "coco_18")
NUDGE: Final = 1e-6
"""Pixels: a point at exactly (0, 0) would be a missing one, and is written here instead."""


def suits(given: Given) -> bool:
    """Tell whether a file, or a folder's first one, has people with ``pose_keypoints_2d``."""
    document = given.document
    if not isinstance(document, dict) or not isinstance(document.get("people"), list):
        return False
    return all(isinstance(one, dict) and _points(one) is not None for one in document["people"])


def read(given: Given, layout: SkeletonMap | None) -> KeyPoints:
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
                raise refusal(
                    given.path, field, shown(one), f'an object with "{POINTS[0]}"', "check how it was written"
                )
            people += 1
            if values != []:
                lists.append(values)
                frame.append(index)
                person.append(_identity(given.path, f"{field}.person_id", one))
                places.append(f"{field}.{POINTS[0]}")
    if people and not lists:
        raise refusal(
            given.path,
            "people",
            f"{people} without points of the body",
            f'points in "{POINTS[0]}"',
            "run OpenPose with its body detector (not --body 0)",
        )
    values = triples(given.path, lists, places.__getitem__)
    points, confidence, normalised = _known(values)
    found = _layout(given.path, points, layout)
    some = ~np.isnan(points[..., 0]).all(axis=1)
    return KeyPoints(
        format=FORMAT.name,
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
        raise refusal(
            path,
            "people",
            shown(document if people is None else people),
            '{"people": [...]} as OpenPose writes it',
            "keep files of other formats out of the folder",
        )
    return people


def _points(person: Any) -> Any:
    if not isinstance(person, dict):
        return None
    return next((person[name] for name in POINTS if name in person), None)


def _identity(source: Path, field: str, person: dict[str, Any]) -> int:
    """Return who a person is along the pictures, -1 where OpenPose did not track."""
    value = person.get("person_id", -1)
    if isinstance(value, list):
        value = value[0] if len(value) == 1 else (-1 if not value else value)
    if type(value) is not int or not -1 <= value < 2**31:
        raise refusal(source, field, shown(value), "a number, or -1 for unknown", "correct it")
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
    if not len(points):
        return layout if layout is not None and layout.points else load_skeleton_map(LAYOUTS[0])
    count = points.shape[1]
    if layout is not None:
        if len(layout.points) != count:
            raise refusal(
                source,
                "points of a person",
                f"{count}",
                f"{len(layout.points)}, as skeleton map {cut(layout.name)} has",
                "choose the map of the detector's model, with its points in order",
            )
        return layout
    candidates = [one for one in map(load_skeleton_map, LAYOUTS) if len(one.points) == count]
    if not candidates:
        raise refusal(
            source,
            "points of a person",
            f"{count}",
            "25 (BODY_25, BODY_25B) or 18 (COCO)",
            "give a map that names them in order with --skeleton",
        )
    if len(candidates) > 1:
        candidates = tell_apart(points)
    if len(candidates) > 1:
        raise refusal(
            source,
            "format",
            "25 points that could be of either order",
            " or ".join(f"{FORMAT.name}-{one.name}" for one in candidates),
            "say which with --format",
        )
    return candidates[0]


def write(path: Path, keypoints: KeyPoints) -> None:
    """Write a new folder of one file a picture; one file, if the name ends so and there is one picture.

    Key points of a layout that OpenPose has not are brought into BODY_25. A confidence that is not known is written as
    1, and people without points are left out.

    Raises
    ------
    InputError
        Where points are fractions beyond the picture, or the folder exists and has something in it.
    """
    if keypoints.layout.points not in [load_skeleton_map(name).points for name in LAYOUTS]:
        keypoints = keypoints.in_layout(load_skeleton_map(LAYOUTS[0]))
    documents = _documents(path, keypoints)
    if path.suffix.lower() == ".json":
        if len(documents) != 1:
            raise refusal(
                path, "", f"{len(documents)} pictures", "one for one file", "name a folder, without .json"
            )
        write_text(path, documents[0])
        return
    _write_folder(path, dict(zip(file_names(keypoints.pictures), documents, strict=True)))


def _documents(path: Path, keypoints: KeyPoints) -> list[list[str]]:
    """Spell each picture's file."""
    points = keypoints.points.copy()
    points[(points == 0).all(axis=-1)] = NUDGE
    if keypoints.normalised and not (np.isnan(points) | ((points >= 0) & (points <= 1))).all():
        raise refusal(
            path, "points", "fractions beyond the picture", "pixels", "give the picture's size with --size"
        )
    confidence = np.where(np.isnan(keypoints.confidence), 1, keypoints.confidence)
    rows = flat(points, confidence)
    some = ~np.isnan(points[..., 0]).all(axis=1)
    pictures: list[list[dict[str, Any]]] = [[] for _ in keypoints.pictures]
    for index in np.flatnonzero(some):
        person = {"person_id": [int(keypoints.person[index])], POINTS[0]: rows[index]}
        others = ("face", "hand_left", "hand_right")
        person |= {f"{name}_keypoints_2d": [] for name in others}
        person |= {f"{name}_keypoints_3d": [] for name in ("pose", *others)}
        pictures[int(keypoints.frame[index])].append(person)
    return [list(json_pieces({"version": 1.3}, "people", people)) for people in pictures]


def _write_folder(path: Path, files: dict[str, list[str]]) -> None:
    """Write a folder whole or not at all: beside its place first."""
    try:
        taken = path.exists() and (not path.is_dir() or any(path.iterdir()))
    except OSError as error:
        raise _not_written(path, error) from None
    if taken:
        raise refusal(path, "", "something that exists", "a new or an empty folder", "choose another name")
    target = path.absolute()
    make_folder(target.parent)
    beside = target.with_name(f".{secrets.token_hex(8)}.part")
    try:
        make_folder(beside)
        for name, pieces in files.items():
            write_text(beside / name, pieces)
        beside.replace(target)
    except OSError as error:
        raise _not_written(path, error) from None
    finally:
        shutil.rmtree(beside, ignore_errors=True)


def _not_written(path: Path, error: OSError) -> InputError:
    reason = cut(error.strerror or str(error))
    return refusal(path, "", reason, "a folder that can be written", "check permissions and free space")


FORMAT = Format(
    name="openpose",
    says="OpenPose: a folder of one JSON file a picture (BODY_25, BODY_25B, COCO-18)",
    suits=suits,
    read=read,
    write=write,
    skeletons=LAYOUTS,
)
