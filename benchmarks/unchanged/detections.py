"""Detectors' files, of the points of views: written by the formats' own descriptions, not by posekit."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np

COCO_POINTS = (
    "nose left_eye right_eye left_ear right_ear left_shoulder right_shoulder left_elbow right_elbow "
    "left_wrist right_wrist left_hip right_hip left_knee right_knee left_ankle right_ankle"
).split()
BODY_25 = (
    "nose mid_shoulders right_shoulder right_elbow right_wrist left_shoulder left_elbow left_wrist mid_hips "
    "right_hip right_knee right_ankle left_hip left_knee left_ankle right_eye left_eye right_ear left_ear"
).split() + [""] * 6
HUMAN36M_POINTS = (
    "mid_hips right_hip right_knee right_ankle left_hip left_knee left_ankle spine mid_shoulders nose head "
    "left_shoulder left_elbow left_wrist right_shoulder right_elbow right_wrist"
).split()
MEDIAPIPE_LANDMARKS = {0: "nose", 2: "left_eye", 5: "right_eye", 7: "left_ear", 8: "right_ear"} | dict(
    zip(
        (11, 12, 13, 14, 15, 16, 23, 24, 25, 26, 27, 28),
        [
            name
            for part in ("shoulder", "elbow", "wrist", "hip", "knee", "ankle")
            for name in (f"left_{part}", f"right_{part}")
        ],
        strict=True,
    )
)
JOINT_NAMES = (
    "neck right_shoulder left_shoulder pelvis right_hip left_hip right_elbow left_elbow right_wrist left_wrist "
    "right_knee left_knee right_ankle left_ankle"
).split()
HEAD_NAMES = "nose right_eye left_eye right_ear left_ear".split()
PICTURE_SIZE = (1920, 1080)

Points = dict[str, tuple[float, float]]


def write_detections(folder: Path, frames: list[Points]) -> None:
    """Write the same people in every detector's format that is read, and as a table of image points.

    Parameters
    ----------
    folder : Path
        Where the files go.
    frames : list of dict of str to tuple of float
        What was seen, a dict a picture, pixels.
    """
    _openpose(folder / "openpose", frames[:2])
    _coco(folder, frames)
    _mediapipe(folder, frames)
    _mmpose(folder, frames)
    _deeplabcut(folder, frames)
    _table(folder, frames)


def _triples(seen: Points, names: list[str], known: float) -> list[float]:
    return [x for name in names for x in ((*seen[name], known) if name in seen else (0.0, 0.0, 0.0))]


def _openpose(folder: Path, frames: list[Points]) -> None:
    folder.mkdir()
    for k, seen in enumerate(frames):
        people = [{"person_id": [-1], "pose_keypoints_2d": _triples(seen, BODY_25, 0.9)}]
        _write(folder / f"walk_{k:012d}_keypoints.json", {"version": 1.3, "people": people})


def _coco(folder: Path, frames: list[Points]) -> None:
    """Write COCO's annotations and results, and what has their form: Halpe, WholeBody, Human3.6M, AlphaPose."""
    width, height = PICTURE_SIZE
    images = [
        {"id": k, "file_name": f"frame{k}.jpg", "width": width, "height": height} for k in range(len(frames))
    ]
    for name, points, category in (
        ("coco", COCO_POINTS, {"id": 1, "name": "person", "keypoints": COCO_POINTS, "skeleton": []}),
        ("coco-25", BODY_25, {"id": 1, "name": "person"}),
    ):
        annotations = [
            {
                "id": k,
                "image_id": k,
                "category_id": 1,
                "keypoints": _triples(seen, points, 2),
                "num_keypoints": 17,
            }
            for k, seen in enumerate(frames)
        ]
        _write(
            folder / f"{name}.json", {"images": images, "categories": [category], "annotations": annotations}
        )
    for name, points in (
        ("coco-results", COCO_POINTS),
        ("h36m", HUMAN36M_POINTS),
        ("halpe", [*COCO_POINTS, "", "mid_shoulders", "mid_hips", *[""] * 6]),
        ("wholebody", [*COCO_POINTS, *[""] * 116]),
    ):
        results: list[dict[str, Any]] = [
            {"image_id": k, "category_id": 1, "keypoints": _triples(seen, points, 0.75), "score": 0.5 + k / 8}
            for k, seen in enumerate(frames)
        ]
        _write(folder / f"{name}.json", results)
        if points is COCO_POINTS:
            tracked = [
                dict(one, image_id=f"frame{one['image_id']}.jpg", idx=1, box=[0, 0, 9, 9]) for one in results
            ]
            _write(folder / "alphapose.json", tracked)


def _mediapipe(folder: Path, frames: list[Points]) -> None:
    """Write landmarks as JSON, and a row a frame as CSV."""
    width, height = PICTURE_SIZE

    def landmark(seen: Points, k: int) -> dict[str, float]:
        u, v = seen[MEDIAPIPE_LANDMARKS.get(k, "nose")]
        return {
            "x": u / width,
            "y": v / height,
            "z": 0.0,
            "visibility": 0.9 if k in MEDIAPIPE_LANDMARKS else 0.1,
        }

    landmarks = [
        {"frame": k, "timestamp_ms": 40 * k, "pose_landmarks": [landmark(seen, n) for n in range(33)]}
        for k, seen in enumerate(frames)
    ]
    _write(folder / "mediapipe.json", {"image_width": width, "image_height": height, "frames": landmarks})
    names = list(MEDIAPIPE_LANDMARKS.values())
    rows = [["frame", *(f"{name}_{what}" for name in names for what in ("x", "y", "visibility"))]]
    for k, seen in enumerate(frames):
        rows.append(
            [str(k), *(str(x) for n in names for x in (seen[n][0] / width, seen[n][1] / height, 0.8))]
        )
    _write(folder / "mediapipe.csv", _lines(rows))


def _mmpose(folder: Path, frames: list[Points]) -> None:
    """Write the demos' layout, with names, and the Inferencer's, without."""
    rest = {"keypoint_scores": [0.9] * len(COCO_POINTS), "bbox": [[0, 0, 9, 9]], "bbox_score": 0.8}
    people = [[{"keypoints": [seen[name] for name in COCO_POINTS]} | rest] for seen in frames]
    meta = {"dataset_name": "coco", "keypoint_id2name": {str(k): name for k, name in enumerate(COCO_POINTS)}}
    info = [{"frame_id": k + 1, "instances": one} for k, one in enumerate(people)]
    _write(folder / "mmpose.json", {"meta_info": meta, "instance_info": info})
    _write(folder / "mmpose-list.json", [{"frame_id": k, "instances": one} for k, one in enumerate(people)])


def _deeplabcut(folder: Path, frames: list[Points]) -> None:
    """Write a table whose points have names of a user's own, one of them missing."""
    own = [name.replace("left_", "L ").replace("right_", "R ") for name in COCO_POINTS]
    header = [
        ["scorer", *["net"] * 51],
        ["bodyparts", *(name for name in own for _ in range(3))],
        ["coords", *["x", "y", "likelihood"] * 17],
    ]
    table = [[str(k), *(str(x) for x in _triples(seen, COCO_POINTS, 0.9))] for k, seen in enumerate(frames)]
    table[0][4:7] = ["", "", ""]
    _write(folder / "deeplabcut.csv", _lines([*header, *table]))


def _table(folder: Path, frames: list[Points]) -> None:
    """Write the table of image points that `posekit batch` reads."""
    camera = {"model": "opencv", "K": [[1500, 0, 960], [0, 1500, 540], [0, 0, 1]], "size": list(PICTURE_SIZE)}
    first = {"time": 0.0, "image": {"neck": [960.0, 540.0]}}
    np.savez(
        folder / "table.npz",
        image=np.array([[seen[name] for name in JOINT_NAMES] for seen in frames]),
        head_image=np.array([[seen[name] for name in HEAD_NAMES] for seen in frames]),
        time=np.arange(len(frames)) / 4,
        view=json.dumps({"schema": "posekit.view/1", "unit": "m", "camera": camera, "frames": [first]}),
    )


def _lines(rows: list[list[str]]) -> str:
    return "".join(",".join(row) + "\n" for row in rows)


def points_of(frame: dict[str, Any]) -> Points:
    """Return what was seen in one frame, with the middles that detectors give, to a hundredth of a pixel."""
    seen = {**frame["image"], **frame["head_image"]}
    for name, side in (("mid_shoulders", "shoulder"), ("mid_hips", "hip")):
        seen[name] = np.mean([seen[f"left_{side}"], seen[f"right_{side}"]], axis=0).tolist()
    seen["spine"] = np.mean([seen["mid_shoulders"], seen["mid_hips"]], axis=0).tolist()
    seen["head"] = seen["right_ear"]
    return {name: (round(u, 2), round(v, 2)) for name, (u, v) in seen.items()}


def _write(path: Path, content: Any) -> None:
    path.write_text(content if isinstance(content, str) else json.dumps(content))
