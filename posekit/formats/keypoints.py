"""Key points in JSON files of detectors: COCO, MMPose, OpenPose, Halpe, MediaPipe.

Sources: cocodataset.org, "Data format" and "Results format"; jin-s13/COCO-WholeBody; MMPose 1.x,
``demo/topdown_demo_with_mmdet.py --save-predictions`` and ``MMPoseInferencer``; OpenPose, ``doc/02_output.md``;
AlphaPose, ``docs/output.md``; MediaPipe, ``NormalizedLandmark``.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np

from posekit.files import read_bytes
from posekit.following.detections import Detections
from posekit.formats import json_file
from posekit.formats.detection_rows import Rows, detections_of
from posekit.formats.node import Node
from posekit.formats.options import Options
from posekit.formats.tables import TIMES
from posekit.geometry import Array

#: Fields of a person's points in OpenPose's files; files from before 2018 have the second name.
OPENPOSE_POINTS: Final = ("pose_keypoints_2d", "pose_keypoints")
#: Fields of a person's landmarks in MediaPipe's frames.
LANDMARKS: Final = ("pose_landmarks", "poseLandmarks", "landmarks")
N_LANDMARKS: Final = 33
#: Largest width or height of a picture, pixels.
LARGEST_SIDE: Final = 10**6


def looks_like(document: Any) -> bool:
    """Return whether a JSON document, or a folder of JSON files, contains key points in pictures."""
    if isinstance(document, Path):
        return any(True for _ in document.glob("*.json"))
    return bool(_kind(document))


def read(document: Any, path: str | Path, options: Options) -> Detections:
    """Read the key points of people in pictures.

    Parameters
    ----------
    document : object
        Parsed JSON, or the path of a folder with one JSON file per picture.
    path : path
        Path of the file or the folder.
    options : Options
        Options with the `layout` of points without names, and the `rate` of a file without times.

    Raises
    ------
    InputError
        If the file is malformed, or the layout of its points is unknown.
    """
    rows = Rows(source=str(path))
    if isinstance(document, Path):
        files = sorted(document.glob("*.json"), key=lambda file: _counted(file.name))
        for file in files:
            content = json_file.parse(read_bytes(file), str(file))
            if len(files) > 1 or content != []:
                _add(Node(content, file), rows, file.stem.removesuffix("_keypoints"))
        rows.in_folder = len(files) > 1
    else:
        _add(Node(document, path), rows, Path(path).name.partition(".")[0])
    return detections_of(rows, options)


def _counted(name: str) -> list[tuple[int, str]]:
    """Return a key that sorts names by the numbers in them."""
    return [(int(part), "") if part.isdecimal() else (-1, part) for part in re.split(r"(\d+)", name)]


def _kind(document: Any) -> str:
    """Return the name of a document's format; empty for a document without key points."""
    if isinstance(document, dict):
        if isinstance(document.get("annotations"), list):
            holders = (*_dicts(document["annotations"]), *_dicts(document.get("categories")))
            return "coco" if any("keypoints" in one for one in holders) else ""
        if "instance_info" in document and "meta_info" in document:
            return "mmpose"
        people = document.get("people")
        if isinstance(people, list) and all(_has(one, OPENPOSE_POINTS) for one in people):
            return "openpose"
        frames = document.get("frames")
        held = frames if isinstance(frames, list) else [document]
        return "mediapipe" if any(_has(frame, LANDMARKS) for frame in held) else ""
    if document == []:
        return "mmpose"
    first = next(_dicts(document), {})
    if "keypoint_scores" in first or ("instances" in first and "frame_id" in first):
        return "mmpose"
    if "image_id" in first and "keypoints" in first:
        return "results"
    return "mediapipe" if any(_has(frame, LANDMARKS) for frame in _dicts(document)) else ""


def _dicts(value: Any) -> Iterator[dict[str, Any]]:
    return (one for one in value if isinstance(one, dict)) if isinstance(value, list) else iter(())


def _has(entry: Any, names: Sequence[str]) -> bool:
    return isinstance(entry, dict) and any(name in entry for name in names)


def _add(root: Node, rows: Rows, label: str) -> None:
    """Add the pictures and people of one document to rows; a picture without a name gets the name `label`."""
    kind = _kind(root.value)
    if not kind:
        expected = "key points of COCO, MMPose, OpenPose or MediaPipe"
        raise root.refused(expected, "keep other files out of the folder, or convert it to one of these")
    if rows.kind and rows.kind != kind:
        expected = f"a file of {rows.kind}, as the files before"
        raise root.refused(expected, "split the folder", f"a file of {kind}")
    rows.kind = kind
    KINDS[kind](root, rows, label)


def _coco(root: Node, rows: Rows, label: str) -> None:
    """Read COCO's annotations: ``{"images": […], "annotations": […], "categories": […]}``."""
    rows.film = None
    named: dict[Any, str] = {}
    listed = list(root.at("images", []).list())
    titles = [one.object().get("file_name") for one in listed]
    own = len(set(map(str, titles))) == len(titles) and all(isinstance(one, str) and one for one in titles)
    for image, name in zip(listed, titles, strict=True):
        identity = image.at("id").value
        if type(identity) not in (int, str) or identity in named:
            raise image.at("id").refused("an id of its own for each image", "renumber the images")
        sides = [image.at(side).positive() if image.has(side) else np.nan for side in ("width", "height")]
        named[identity] = rows.picture(name if own else identity, size=(sides[0], sides[1]))
    everyone = list(root.at("annotations").list())
    people = [one for one in everyone if "keypoints" in one.object() and not one.value.get("iscrowd")]
    names = {
        str(one.get("id")): tuple(map(str, one["keypoints"]))
        for one in _dicts(root.value.get("categories"))
        if isinstance(one.get("keypoints"), list)
    }
    # Categories can be animals or objects: the category with shoulders is the person.
    category = [str(one.value.get("category_id")) for one in people]
    used = [names[key] for key in category if key in names] or list(names.values())
    rows.names = next((one for one in used if "shoulder" in " ".join(one).lower()), used[0] if used else ())
    kept = zip(people, category, strict=True)
    people = [one for one, key in kept if names.get(key, rows.names) == rows.names]
    triples = [_by_three(one.at("keypoints")) for one in people]
    thirds = np.concatenate([one[:, 2] for one in triples]) if triples else np.empty(0)
    flags = bool(np.isin(thirds, (0, 1, 2)).all())
    for one, values in zip(people, triples, strict=True):
        identity = one.at("image_id").value
        if listed and (type(identity) not in (int, str) or identity not in named):
            raise one.at("image_id").refused(f"the id of one of the {len(named)} images", "add the image")
        if flags:
            values[:, 2] = np.where(values[:, 2] > 0, np.nan, 0.0)
        rows.add(named.get(identity, identity), values, one.value.get("track_id"))


def _results(root: Node, rows: Rows, label: str) -> None:
    """Read a flat list of people: results of COCO, or of AlphaPose, whose picture id is the picture's name."""
    rows.film = None
    for one in root.list():
        identity = one.at("image_id").value
        if type(identity) not in (int, str):
            raise one.at("image_id").refused("a number, or a picture's name")
        values = _by_three(one.at("keypoints"))
        person = one.value.get("track_id", one.value.get("idx"))
        while isinstance(person, list):  # AlphaPose lists the detections that it merged
            person = person[0] if person else None
        values[values[:, 2] == 2, 2] = np.nan
        rows.add(identity, values, person)


def _mmpose(root: Node, rows: Rows, label: str) -> None:
    """Read MMPose's ``{meta_info, instance_info}`` of demos, or the Inferencer's list of people or of pictures."""
    listed = root
    if isinstance(root.value, dict):
        listed = root.at("instance_info")
        table = root.at("meta_info").at("keypoint_id2name").object()
        names = [table.get(str(k)) for k in range(len(table))]
        if not all(isinstance(name, str) and name for name in names):
            raise root.at("meta_info").at("keypoint_id2name").refused("a name for each point, by its number")
        rows.names = tuple(map(str, names))
    for entry in list(listed.list()):
        if "instances" not in entry.object():
            _instance(entry, rows, rows.picture(label))
            continue
        number = rows.picture(entry.at("frame_id").value)
        for one in entry.at("instances").list():
            _instance(one, rows, number)
    if not rows.pictures or listed.value == []:
        rows.picture(label)


def _instance(one: Node, rows: Rows, label: str) -> None:
    points = one.at("keypoints").array(None, None, unknown=True)
    if points.shape[1] != 2:
        got = f"{points.shape[1]} coordinates a point"
        raise one.at("keypoints").refused("two, pixels", "save the predictions of a 2D model", got)
    sure = one.at("keypoint_scores").array(len(points), unknown=True)
    # For a point without a positive score MMPose writes -1 in the crop (mmpose/codecs/utils/post_processing.py).
    values = np.column_stack([points, np.where(sure <= 0, 0.0, sure)])
    rows.add(label, values, one.value.get("track_id"))


def _openpose(root: Node, rows: Rows, label: str) -> None:
    """Read one picture: ``{"people": [{"person_id": [-1], "pose_keypoints_2d": [x, y, c] * K}]}``."""
    rows.picture(label)
    for one in root.at("people").list():
        field = next(name for name in OPENPOSE_POINTS if name in one.object())
        if one.at(field).value == []:
            continue
        person = one.value.get("person_id")
        person = person[0] if isinstance(person, list) and len(person) == 1 else person
        rows.add(label, _by_three(one.at(field)), person)


def _by_three(node: Node) -> Array:
    """Convert a flat list of numbers to rows (K, 3): x, y, and visibility flag or confidence of each point."""
    flat = node.array(None, unknown=True)
    if not len(flat) or len(flat) % 3:
        raise node.refused("a list [x, y, v, x, y, v, …]", got=f"{len(flat)} numbers")
    return flat.reshape(-1, 3)


def _mediapipe(root: Node, rows: Rows, label: str) -> None:
    """Read frames ``{frame, pose_landmarks: [{x, y, z, visibility} * 33]}`` of one person or several people."""
    document = root.value
    listed = root if isinstance(document, list) else root.at("frames", None)
    frames = list(listed.list()) if listed.value is not None else [root]
    size = _size(document)
    for number, frame in enumerate(frames):
        entry = frame.object()
        own = next((entry[name] for name in ("frame", "frame_id", "image") if name in entry), None)
        named = own if isinstance(own, int | str) else label if frame is root else number
        picture = rows.picture(named, time=_time(frame), size=_size(entry, size))
        field = next((name for name in LANDMARKS if entry.get(name)), None)
        if field is None:  # nobody was found
            continue
        held = list(frame.at(field).list())
        for person in held if isinstance(held[0].value, list) else [frame.at(field)]:
            points = list(person.list())
            if len(points) != N_LANDMARKS:
                got = f"{len(points)} landmarks"
                raise person.refused(f"{N_LANDMARKS} landmarks", "save all of them", got)
            rows.add(picture, np.array([_landmark(one) for one in points]))


def _landmark(one: Node) -> tuple[float, float, float]:
    """Return x, y and visibility of ``{x, y, z, visibility}``."""
    x, y = (one.at(axis).number() for axis in "xy")
    name = next((name for name in ("visibility", "presence") if one.has(name)), None)
    return x, y, one.at(name).number() if name else np.nan


def _time(frame: Node) -> float:
    """Return a frame's time in seconds; NaN if it states no time."""
    name = next((name for name in TIMES if type(frame.value.get(name)) in (int, float)), None)
    return frame.at(name).number(most=1e18) * (TIMES[name] or 1.0) if name else np.nan


def _size(holder: Any, known: tuple[float, float] = (np.nan, np.nan)) -> tuple[float, float]:
    """Return the width and height that an object states, or else the known size."""
    sides = (holder.get("width"), holder.get("height")) if isinstance(holder, dict) else (None, None)
    if all(isinstance(side, int | float) and 0 < side < LARGEST_SIDE for side in sides):
        return float(sides[0]), float(sides[1])  # type: ignore[arg-type]
    return known


#: Reader of each format by its name.
KINDS: Final = dict(coco=_coco, results=_results, mmpose=_mmpose, openpose=_openpose, mediapipe=_mediapipe)
