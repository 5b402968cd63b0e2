"""Detectors' files for tests: key points as OpenPose, COCO, MediaPipe, MMPose, AlphaPose and DeepLabCut write them."""

import csv
import io
import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path, PurePosixPath
from typing import Any

import numpy as np

from posekit.formats.given_file import GivenFile
from posekit.formats.keypoints import KeyPoints, chosen, key_point_formats
from posekit.formats.keypoints.coco_parts import FLAGGED_POINTS, WHOLEBODY_PARTS
from posekit.formats.keypoints.mediapipe_names import LANDMARK_NAMES
from posekit.formats.keypoints.rows import whole
from posekit.formats.own import OpenCVModel, View
from posekit.formats.skeleton_maps import LANDMARK_INDEX, LANDMARK_ORDER, SkeletonMap, load_skeleton_map
from posekit.formats.skeleton_maps.skeleton_map import plain
from posekit.skeleton import HEAD, JOINT, JOINTS

NUDGE = 1e-6
"""Pixels: a point at exactly (0, 0) would be a missing one in OpenPose's files, and is written here instead."""
OPENPOSE = ("body_25", "body_25b", "coco_18")
COUNTED = ("coco_17", "halpe_26", "coco_wholebody_133", "halpe_136", "h36m_17")
ALPHAPOSE = ("coco_17", "halpe_26", "halpe_136")


def write_keypoints(path: Path, keypoints: KeyPoints, format: str) -> None:
    """Write key points as a detector would, in a format with or without one of its layouts."""
    one, layout = chosen(format)
    WRITERS[one.name](path, keypoints if layout is None else in_layout(keypoints, layout))


def suiting(path: Path) -> list[str]:
    """List the formats of key points that a file or folder looks like, whatever its name."""
    given = GivenFile(path)
    return [one.name for one in key_point_formats().values() if one.looks_like(given)]


def view_keypoints(view: View, format: str, skeleton: str = "") -> KeyPoints:
    """Make key points of a view's image points, in the first layout of a format or one that is named."""
    one, layout = chosen(format)
    if skeleton or layout is None:
        layout = load_skeleton_map(skeleton or (one.skeletons[0] if one.skeletons else "coco_17"))
    size = view.camera.size if isinstance(view.camera, OpenCVModel) else None
    return KeyPoints(
        format=format,
        source="view",
        layout=layout,
        pictures=tuple(f"{k:06d}" for k in range(len(view))),
        size=np.full((len(view), 2), np.nan if size is None else 0.0) + (size or (0.0, 0.0)),
        time=view.time,
        frame=np.arange(len(view)),
        person=np.zeros(len(view), dtype=np.intp),
        points=scatter(layout, landmarks_of(np.concatenate([view.image, view.head_image], axis=1))),
        confidence=scatter(layout, landmarks_of(view.confidence[..., None]))[..., 0],
    )


def landmarks_of(values: np.ndarray) -> np.ndarray:
    """Add the girdles' middles to joints and head points (F, 19, n)."""
    found = np.full((len(values), len(LANDMARK_ORDER), values.shape[-1]), np.nan)
    found[:, : len(JOINTS) + len(HEAD)] = values
    for middle, part in (("mid_shoulders", "shoulder"), ("mid_hips", "hip")):
        sides = [JOINT[f"{side}_{part}"] for side in ("right", "left")]
        found[:, LANDMARK_INDEX[middle]] = values[:, sides].mean(axis=1)
    return found


def scatter(layout: SkeletonMap, landmarks: np.ndarray) -> np.ndarray:
    """Put landmarks (..., 21, n) into a layout's points (..., K, n): those that are one point; NaN else."""
    values = np.full((*landmarks.shape[:-2], len(layout.points), landmarks.shape[-1]), np.nan)
    for landmark, parts in layout.landmarks.items():
        if len(parts) == 1 and parts[0] in layout.points:
            values[..., layout.points.index(parts[0]), :] = landmarks[..., LANDMARK_INDEX[landmark], :]
    return values


def in_layout(keypoints: KeyPoints, layout: SkeletonMap) -> KeyPoints:
    """Put points into another layout: those that are a landmark or have the same name; the others are missing."""
    if layout.points == keypoints.layout.points and layout.landmarks == keypoints.layout.landmarks:
        return keypoints
    extra = [keypoints.confidence[..., None], keypoints.occluded[..., None].astype(float)]
    values = np.concatenate([keypoints.points, *extra], axis=-1)
    own = {plain(name): k for k, name in enumerate(keypoints.layout.points)}
    moved = np.full((len(keypoints), len(layout.points), 4), np.nan)
    for k, name in enumerate(layout.points):
        if plain(name) in own:
            moved[:, k] = values[:, own[plain(name)]]
    landmarks = scatter(layout, keypoints.layout.gather(values))
    placed = scatter(layout, np.ones((1, len(LANDMARK_ORDER), 1)))[0, :, 0] == 1
    moved[:, placed] = landmarks[:, placed]
    moved[np.isnan(moved[..., 0])] = np.nan
    return replace(
        keypoints,
        layout=layout,
        points=moved[..., :2],
        confidence=moved[..., 2],
        occluded=moved[..., 3] > 0,
    )


def _flat(points: np.ndarray, third: np.ndarray) -> list[list[float]]:
    """Spell points (D, K, 2) and a number each (D, K) as flat lists; a missing point becomes (0, 0, 0)."""
    values = np.concatenate([points, third[..., None]], axis=-1)
    values[np.isnan(points[..., 0])] = 0
    rows = values.reshape(len(values), points.shape[1] * 3).tolist()
    return [[int(value) if value.is_integer() else value for value in row] for row in rows]


def _known(keypoints: KeyPoints) -> list[int]:
    return np.flatnonzero(~np.isnan(keypoints.points[..., 0]).all(axis=1)).tolist()


def _sure(keypoints: KeyPoints) -> np.ndarray:
    return np.where(np.isnan(keypoints.confidence), 1.0, keypoints.confidence)


def _openpose(path: Path, keypoints: KeyPoints) -> None:
    if keypoints.layout.points not in [load_skeleton_map(name).points for name in OPENPOSE]:
        keypoints = in_layout(keypoints, load_skeleton_map(OPENPOSE[0]))
    points = keypoints.points.copy()
    points[(points == 0).all(axis=-1)] = NUDGE
    rows = _flat(points, _sure(keypoints))
    pictures: list[list[dict[str, Any]]] = [[] for _ in keypoints.pictures]
    for row in _known(keypoints):
        person = {"person_id": [int(keypoints.person[row])], "pose_keypoints_2d": rows[row]}
        pictures[int(keypoints.frame[row])].append(person)
    documents = [json.dumps({"version": 1.3, "people": people}) for people in pictures]
    if path.suffix == ".json":
        (document,) = documents
        path.write_text(document, encoding="utf-8")
        return
    path.mkdir(parents=True, exist_ok=True)
    for name, document in zip(keypoints.pictures, documents, strict=True):
        (path / f"{name}_keypoints.json").write_text(document, encoding="utf-8")


def _image_ids(keypoints: KeyPoints, first: int, *, ascending: bool) -> list[int]:
    stems = [PurePosixPath(name).stem for name in keypoints.pictures]
    if all(stem.isascii() and stem.isdigit() and len(stem) <= 15 for stem in stems):
        numbers = [int(stem) for stem in stems]
        if len(set(numbers)) == len(numbers) and (not ascending or numbers == sorted(numbers)):
            return numbers
    return list(range(first, first + len(stems)))


def _described(keypoints: KeyPoints, row: int, score: str, person: str) -> dict[str, Any]:
    found: dict[str, Any] = {}
    if not np.isnan(keypoints.score[row]):
        found[score] = float(keypoints.score[row])
    if keypoints.person[row] >= 0:
        found[person] = int(keypoints.person[row])
    return found


def _annotations(path: Path, keypoints: KeyPoints, names: tuple[str, ...], points: list[dict]) -> None:
    numbers = _image_ids(keypoints, 1, ascending=False)
    images: list[dict[str, Any]] = [
        {"id": number, "file_name": name} for number, name in zip(numbers, keypoints.pictures, strict=True)
    ]
    for image, sides in zip(images, keypoints.size.tolist(), strict=True):
        image.update(
            {
                name: int(side) if side.is_integer() else side
                for name, side in zip(("width", "height"), sides, strict=True)
                if not np.isnan(side)
            }
        )
    people: list[dict[str, Any]] = []
    for row in _known(keypoints):
        known = keypoints.points[row][~np.isnan(keypoints.points[row, :, 0])]
        one = {
            "id": len(people) + 1,
            "image_id": numbers[int(keypoints.frame[row])],
            "category_id": 1,
            "iscrowd": 0,
            "num_keypoints": len(known),
            "bbox": [*known.min(axis=0).tolist(), *np.ptp(known, axis=0).tolist()],
        }
        people.append(one | _described(keypoints, row, "score", "track_id") | points[row])
    category = {"id": 1, "name": "person", "keypoints": list(names), "skeleton": []}
    document = {"images": images, "categories": [category], "annotations": people}
    path.write_text(json.dumps(document), encoding="utf-8")


def _coco(path: Path, keypoints: KeyPoints) -> None:
    rows = _flat(keypoints.points, np.where(keypoints.occluded, 1, 2))
    _annotations(path, keypoints, keypoints.layout.points, [{"keypoints": row} for row in rows])


def _coco_results(path: Path, keypoints: KeyPoints) -> None:
    rows = _flat(keypoints.points, _sure(keypoints))
    numbers = _image_ids(keypoints, 0, ascending=True)
    people = [
        {
            "image_id": numbers[int(keypoints.frame[row])],
            "category_id": 1,
            "keypoints": rows[row],
            "score": 1.0,
            **_described(keypoints, row, "score", "track_id"),
        }
        for row in _known(keypoints)
    ]
    path.write_text(json.dumps(people), encoding="utf-8")


def _wholebody(path: Path, keypoints: KeyPoints) -> None:
    keypoints = in_layout(keypoints, load_skeleton_map("coco_wholebody_133"))
    visible = np.where(keypoints.occluded, 1.0, 2.0)
    sure = keypoints.confidence[:, FLAGGED_POINTS:]
    visible[:, FLAGGED_POINTS:] = np.where((sure > 0) & (sure < 1), sure, 1)
    people = []
    for row in _flat(keypoints.points, visible):
        one: dict[str, Any] = {}
        start = 0
        for name, count, flag in WHOLEBODY_PARTS:
            one[name] = row[3 * start : 3 * (start + count)]
            start += count
            if flag:
                one[flag] = any(one[name][2::3])
        people.append(one)
    _annotations(path, keypoints, keypoints.layout.points[:17], people)


def _mediapipe(path: Path, keypoints: KeyPoints) -> None:
    fitted = in_layout(keypoints, load_skeleton_map("mediapipe_33"))
    if not keypoints.normalised:
        size = keypoints.size[keypoints.frame][:, None]
        fitted = replace(fitted, points=fitted.points / size, normalised=True)
    text = _mediapipe_table(fitted) if path.suffix == ".csv" else _mediapipe_json(fitted)
    path.write_text(text, encoding="utf-8")


def _mediapipe_json(keypoints: KeyPoints) -> str:
    frames: list[dict[str, Any]] = []
    for index, label in enumerate(keypoints.pictures):
        number = whole(label)
        frame: dict[str, Any] = {"frame": label if number is None or str(number) != label else number}
        if not np.isnan(keypoints.time[index]):
            frame["time"] = float(keypoints.time[index])
        if not np.isnan(keypoints.size[index]).any():
            frame["image_width"], frame["image_height"] = keypoints.size[index].tolist()
        rows = np.flatnonzero(keypoints.frame == index).tolist()
        frame["pose_landmarks"] = [
            [_landmark(keypoints, row, k) for k in range(len(LANDMARK_NAMES))] for row in rows
        ]
        frames.append(frame)
    return json.dumps({"landmarks": "mediapipe pose 33", "frames": frames})


def _landmark(keypoints: KeyPoints, row: int, k: int) -> dict[str, float | None]:
    x, y = keypoints.points[row, k].tolist()
    if np.isnan(x):
        return {"x": None, "y": None}
    sure = float(keypoints.confidence[row, k])
    return {"x": x, "y": y} if np.isnan(sure) else {"x": x, "y": y, "visibility": sure}


def _mediapipe_table(keypoints: KeyPoints) -> str:
    rows: list[list[object]] = [["frame", "time", "person", "landmark", "x", "y", "visibility"]]
    count: dict[int, int] = {}
    for row, frame in enumerate(keypoints.frame.tolist()):
        person = count[frame] = count.get(frame, -1) + 1
        time = keypoints.time[frame]
        for k, name in enumerate(LANDMARK_NAMES):
            x, y = keypoints.points[row, k].tolist()
            if not np.isnan(x):
                sure = float(keypoints.confidence[row, k])
                when = "" if np.isnan(time) else repr(float(time))
                visible = "" if np.isnan(sure) else repr(sure)
                rows.append([keypoints.pictures[frame], when, person, name, repr(x), repr(y), visible])
    return _table(rows)


def _table(rows: list[list[object]]) -> str:
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerows(rows)
    return text.getvalue()


def _mmpose_frames(keypoints: KeyPoints, first: int) -> list[dict[str, Any]]:
    told = [whole(label) for label in keypoints.pictures]
    frames: list[dict[str, Any]] = [
        {"frame_id": first + k if None in told else told[k], "instances": []} for k in range(len(told))
    ]
    missing = np.isnan(keypoints.points[..., 0])
    points = np.where(missing[..., None], 0.0, keypoints.points).tolist()
    scores = np.where(missing, 0.0, _sure(keypoints)).tolist()
    for row, frame in enumerate(keypoints.frame.tolist()):
        seen = keypoints.points[row][~missing[row]]
        box = [*seen.min(axis=0).tolist(), *seen.max(axis=0).tolist()] if len(seen) else [0.0] * 4
        one = {"keypoints": points[row], "keypoint_scores": scores[row], "bbox": [box]}
        frames[frame]["instances"].append(one | _described(keypoints, row, "bbox_score", "track_id"))
    return frames


def _mmpose(path: Path, keypoints: KeyPoints) -> None:
    names = keypoints.layout.points
    meta = {
        "dataset_name": keypoints.layout.name,
        "num_keypoints": len(names),
        "keypoint_id2name": {str(k): name for k, name in enumerate(names)},
        "keypoint_name2id": {name: k for k, name in enumerate(names)},
    }
    document = {"meta_info": meta, "instance_info": _mmpose_frames(keypoints, 1)}
    path.write_text(json.dumps(document), encoding="utf-8")


def _tellable(keypoints: KeyPoints, names: tuple[str, ...]) -> KeyPoints:
    """Bring points into COCO's 17, where their number alone would not tell what they are."""
    layouts = [load_skeleton_map(name) for name in names]
    if keypoints.layout.points in [layout.points for layout in layouts]:
        return keypoints
    return in_layout(keypoints, load_skeleton_map("coco_17"))


def _mmpose_list(path: Path, keypoints: KeyPoints) -> None:
    path.write_text(json.dumps(_mmpose_frames(_tellable(keypoints, COUNTED), 0)), encoding="utf-8")


def _alphapose(path: Path, keypoints: KeyPoints) -> None:
    keypoints = _tellable(keypoints, ALPHAPOSE)
    people = []
    for row, frame in enumerate(keypoints.frame.tolist()):
        values = np.concatenate([keypoints.points[row], keypoints.confidence[row][:, None]], axis=1)
        values[np.isnan(values[:, 0])] = 0
        one = {
            "image_id": keypoints.pictures[frame],
            "category_id": 1,
            "keypoints": [None if np.isnan(value) else value for value in values.ravel().tolist()],
        }
        people.append(one | _described(keypoints, row, "score", "idx"))
    path.write_text(json.dumps(people), encoding="utf-8")


def _deeplabcut(path: Path, keypoints: KeyPoints) -> None:
    people, names = np.unique(keypoints.person), keypoints.layout.points
    count = max(len(people), 1)
    rows: list[list[object]] = [["scorer", *["posekit"] * (3 * len(names) * count)]]
    if len(people) > 1 or (people.size and people[0] >= 0):
        rows.append(["individuals", *[f"person{who}" for who in people for _ in range(3 * len(names))]])
    rows.append(["bodyparts", *[name for _ in range(count) for name in names for _ in range(3)]])
    rows.append(["coords", *["x", "y", "likelihood"] * (len(names) * count)])
    values = np.full((len(keypoints.pictures), count, len(names), 3), np.nan)
    place = np.searchsorted(people, keypoints.person)
    values[keypoints.frame, place, :, :2] = keypoints.points
    values[keypoints.frame, place, :, 2] = keypoints.confidence
    for label, row in zip(keypoints.pictures, values.reshape(len(values), -1).tolist(), strict=True):
        rows.append([label, *["" if np.isnan(value) else repr(value) for value in row]])
    path.write_text(_table(rows), encoding="utf-8")


WRITERS: dict[str, Callable[[Path, KeyPoints], None]] = {
    "openpose": _openpose,
    "coco": _coco,
    "coco-results": _coco_results,
    "coco-wholebody": _wholebody,
    "mediapipe": _mediapipe,
    "mmpose": _mmpose,
    "mmpose-list": _mmpose_list,
    "alphapose": _alphapose,
    "deeplabcut": _deeplabcut,
}
