"""MediaPipe's landmarks in JSON: frames in any of the ways in which results are dumped."""

from __future__ import annotations

from typing import Any

import numpy as np

from posekit.formats.keypoints.mediapipe_names import (
    LANDMARK_NAMES,
    PICTURE_LABEL_NAMES,
    PRESENCE_NAMES,
    TIME_NAMES,
    VISIBILITY_NAMES,
    landmark,
    nobody,
    note_times,
    one_of,
)
from posekit.formats.keypoints.rows import COORDINATE_TYPES, LARGEST_NUMBER, DetectionRows, number, whole
from posekit.formats.skeleton_maps.skeleton_map import plain
from posekit.geometry import Array
from posekit.safe_io import cut, refusal, shown

FRAMES_NAMES = ("frames", "posedata", "framesdata", "framedata", "poses", "results", "data")
PICTURE_LANDMARKS_NAMES = ("poselandmarks", "poselandmark", "landmarks", "landmark", "pose", "keypoints")
"""Where a frame has its landmarks, plain; world landmarks are called otherwise."""
WORLD_LANDMARKS_NAMES = ("poseworldlandmarks", "worldlandmarks")
PEOPLE_NAMES = ("people", "persons", "poses")
SIZE_HOLDER_NAMES = (
    "metadata",
    "meta",
    "videoinfo",
    "video",
    "info",
    "shape",
    "imagesize",
    "framesize",
    "resolution",
)
PICTURE_WIDTH_NAMES = ("imagewidth", "framewidth", "videowidth", "width", "w")
PICTURE_HEIGHT_NAMES = ("imageheight", "frameheight", "videoheight", "height", "h")


def looks_like_landmarks(document: object) -> bool:
    """Tell whether something in it looks like landmarks of MediaPipe: {x, y, …} under a name that is used for them."""
    frame = next(iter(frames_of_document(document)), None)
    for candidate in (frame, *_first_full(document)):
        if isinstance(candidate, dict):
            field = one_of(candidate, (*PICTURE_LANDMARKS_NAMES, *WORLD_LANDMARKS_NAMES))
            people = one_of(candidate, PEOPLE_NAMES)
            inner = candidate.get(field) if field else candidate.get(people) if people else None
            if _holds_landmarks(inner) or (
                field is not None and plain(field) in WORLD_LANDMARKS_NAMES + PICTURE_LANDMARKS_NAMES[:2]
            ):
                return True
        elif _holds_landmarks(candidate):
            return True
    return False


def _first_full(document: object) -> list[object]:
    """Return the first frame with somebody in it: the first ones may be empty."""
    for frame in frames_of_document(document):
        if isinstance(frame, dict) and any(
            frame.get(field) for field in frame if plain(str(field)) in PICTURE_LANDMARKS_NAMES + PEOPLE_NAMES
        ):
            return [frame]
    return []


def _holds_landmarks(value: object) -> bool:
    for _ in range(3):
        if _is_named(value) or (
            isinstance(value, list) and len(value) == len(LANDMARK_NAMES) and _is_point(value[0])
        ):
            return True
        if isinstance(value, dict) and value:
            inner = one_of(value, PICTURE_LANDMARKS_NAMES)
            value = value[inner] if inner else next(iter(value.values()))
        elif isinstance(value, list) and value:
            value = value[0]
        else:
            return False
    return _is_named(value)


def frames_of_document(document: object) -> list[Any]:
    """Return the frames of a document: a list of them, an object that has one, or one frame alone."""
    if isinstance(document, list):
        return [document] if document and (_is_named(document[0]) or _is_point(document[0])) else document
    if isinstance(document, dict):
        field = one_of(document, FRAMES_NAMES)
        if field is not None and isinstance(document[field], list):
            return list(document[field])
        return [document]
    return []


def add_document(rows: DetectionRows, document: object, name: str) -> None:
    """Note the frames of a document; a frame alone is called `name`.

    Raises
    ------
    InputError
        Where a frame holds what are no landmarks, or world landmarks alone.
    """
    frames = frames_of_document(document)
    size = _size(document)
    labels: list[str] = []
    times: list[float] = []
    unit = ""
    world = seen = 0
    for index, frame in enumerate(frames):
        label: object = name if len(frames) == 1 and not isinstance(document, list) else index
        time = np.nan
        if isinstance(frame, dict):
            field = one_of(frame, PICTURE_LABEL_NAMES)
            if field is not None and isinstance(frame[field], str | int | float):
                label = frame[field]
            field = one_of(frame, TIME_NAMES)
            if field is not None:
                time, unit = number(frame[field]), plain(field)
            world += (
                one_of(frame, WORLD_LANDMARKS_NAMES) is not None
                and one_of(frame, PICTURE_LANDMARKS_NAMES) is None
            )
            seen += one_of(frame, (*PICTURE_LANDMARKS_NAMES, *PEOPLE_NAMES)) is not None
        whole_label = whole(label)
        labels.append(rows.picture(label if whole_label is None else whole_label, size=_size(frame, size)))
        times.append(time)
        _add_frame(rows, labels[-1], frame, f"frame {cut(str(label))}")
    if not (world or seen or rows.points):
        raise refusal(rows.source, "", shown(document), "frames with pose_landmarks", "save them so")
    if world and not seen:
        got = "world landmarks alone: metres around the hips"
        raise refusal(rows.source, "", got, "landmarks in the picture", "save pose_landmarks too")
    note_times(rows, labels, times, unit)


def _size(holder: object, known: tuple[float, float] = (np.nan, np.nan)) -> tuple[float, float]:
    """Return the width and height that an object names, or one that it holds does."""
    if not isinstance(holder, dict):
        return known
    fields = one_of(holder, PICTURE_WIDTH_NAMES), one_of(holder, PICTURE_HEIGHT_NAMES)
    if fields[0] and fields[1]:
        size = number(holder[fields[0]]), number(holder[fields[1]])
        return size if 0 < size[0] < LARGEST_NUMBER and 0 < size[1] < LARGEST_NUMBER else known
    for field in SIZE_HOLDER_NAMES:
        inner = one_of(holder, (field,))
        value = holder[inner] if inner else None
        if isinstance(value, list) and len(value) == 2 and all(number(side) > 0 for side in value):
            return number(value[0]), number(value[1])
        if isinstance(value, dict) and np.isfinite(_size(value)).all():
            return _size(value)
    return known


def _add_frame(rows: DetectionRows, label: str, frame: object, place: str) -> None:
    if isinstance(frame, dict) and not {"x", "y"} & set(frame):
        people, field = one_of(frame, PEOPLE_NAMES), one_of(frame, PICTURE_LANDMARKS_NAMES)
        if field is not None:
            _add_frame(rows, label, frame[field], f"{place}.{field}")
        elif people is not None and isinstance(frame[people], list):
            for index, person in enumerate(frame[people]):
                _add_frame(rows, label, person, f"{place}.{people}[{index}]")
        elif frame and all(landmark(name) is not None for name in frame):
            _add_person(rows, label, frame, place)
        return
    if frame is None or frame in ([], {}):
        return
    if isinstance(frame, list) and _is_person_of_several(frame[0]):
        for index, person in enumerate(frame):
            _add_frame(rows, label, person, f"{place}[{index}]")
        return
    _add_person(rows, label, frame, place)


def _is_person_of_several(entry: object) -> bool:
    """Tell whether what stands in a list is a whole person and no landmark."""
    if isinstance(entry, dict):
        return one_of(entry, PICTURE_LANDMARKS_NAMES) is not None
    return isinstance(entry, list) and not _is_point(entry)


def _is_point(entry: object) -> bool:
    """Tell whether something is [x, y], [x, y, z] or [x, y, z, visibility], perhaps with presence."""
    return isinstance(entry, list) and 2 <= len(entry) <= 5 and set(map(type, entry)) <= COORDINATE_TYPES


def _is_named(entry: object) -> bool:
    """Tell whether something is {x, y, …}."""
    return isinstance(entry, dict) and {"x", "y"} <= set(entry)


def _add_person(rows: DetectionRows, label: str, person: object, place: str) -> None:
    expected = f"a list of {len(LANDMARK_NAMES)} landmarks {{x, y, z, visibility}}"
    if isinstance(person, dict) and all(landmark(name) is not None for name in person):
        person = [{"name": name, **entry} for name, entry in person.items() if isinstance(entry, dict)]
    if not isinstance(person, list):
        raise refusal(rows.source, place, shown(person), expected, "save pose_landmarks")
    numbered = [_index(entry) for entry in person]
    if len(person) != len(LANDMARK_NAMES) and None in numbered:
        expected = f"{len(LANDMARK_NAMES)}, or a name or id each"
        remedy = "save all landmarks of the full-body model"
        raise refusal(rows.source, place, f"{len(person)} landmarks without names", expected, remedy)
    if None in numbered:
        numbered = list(range(len(LANDMARK_NAMES)))
    points, sure = nobody()
    for index, entry in zip(numbered, person, strict=True):
        if index is not None:
            points[index], sure[index] = _point(rows, entry, f"{place}: {LANDMARK_NAMES[index]}")
    rows.add(label, points, sure)


def _index(entry: object) -> int | None:
    if not isinstance(entry, dict):
        return None
    field = one_of(entry, ("name", "landmarkname", "id", "index", "landmarkid", "landmarkindex", "landmark"))
    return landmark(entry[field]) if field is not None else None


def _point(rows: DetectionRows, entry: object, place: str) -> tuple[Array, float]:
    """Read a landmark, as an object or as [x, y, z, visibility]."""
    if isinstance(entry, dict):
        x, y = entry.get("x"), entry.get("y")
        field = one_of(entry, VISIBILITY_NAMES) or one_of(entry, PRESENCE_NAMES)
        sure = number(entry[field]) if field else np.nan
    elif isinstance(entry, list) and _is_point(entry):
        x, y = entry[:2]
        sure = number(entry[3]) if len(entry) > 3 else np.nan
    else:
        raise refusal(rows.source, place, shown(entry), "{x, y, z, visibility}", "save it again")
    for value in (x, y):
        if type(value) not in COORDINATE_TYPES or abs(number(value)) > LARGEST_NUMBER:
            raise refusal(rows.source, place, shown(value), "a fraction of the picture")
    return np.array([number(x), number(y)]), sure
