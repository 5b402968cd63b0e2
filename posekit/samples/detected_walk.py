"""What a detector would write of a walk that one calibrated camera films: OpenPose's files, and the camera's."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Final

import numpy as np

from posekit.cameras.calibrated import CalibratedCamera
from posekit.formats.cameras import write_cameras
from posekit.formats.skeleton_maps import load_skeleton_map
from posekit.geometry import Array
from posekit.safe_io.writing import make_folder, write_text
from posekit.skeleton import POINTS
from posekit.synthesis.viewpoints import look_at, to_camera

PICTURE_SIZE: Final = (1280, 720)
FOCAL_LENGTH: Final = 1000.0
"""Pixels."""
CAMERA_POSITION: Final = np.array([4.6, 1.3, 3.2])
"""Metres, in the walk's world: ahead of the walker, to the right, at the height of the chest."""
POINT_DEVIATION: Final = 2.0
"""Pixels: how far off the points are, along each axis of the picture."""
PICTURE_COUNT: Final = 12
FRAMES_A_PICTURE: Final = 3
"""One frame in three is a picture: ten a second."""
NOISE_SEED: Final = 175
WORLD_UP: Final = np.array([0.0, 1.0, 0.0])
R_CALIBRATION_WALK: Final = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
"""From the walk's world, y up, to the calibration's, z up, as Pose2Sim has it."""
MIDDLE_OF: Final = {"mid_shoulders": "shoulder", "mid_hips": "hip"}


def write_detected_walk(keypoints: Path, calibration: Path, points: Array) -> None:
    """Write a folder of key points, a file a picture, and the camera that saw them.

    Parameters
    ----------
    keypoints, calibration : Path
        The folder, and the TOML.
    points : array (T, 19, 3)
        Joints and head points of the walk, metres.
    """
    middle = (points.min(axis=(0, 1)) + points.max(axis=(0, 1))) / 2
    R = look_at(CAMERA_POSITION, middle, WORLD_UP)
    K = np.array(
        [[FOCAL_LENGTH, 0, PICTURE_SIZE[0] / 2], [0, FOCAL_LENGTH, PICTURE_SIZE[1] / 2], [0, 0, 1.0]]
    )
    camera = CalibratedCamera(
        name="cam_01",
        K=K,
        distortion=np.zeros(4),
        size=PICTURE_SIZE,
        R=R @ R_CALIBRATION_WALK.T,
        t=-R @ CAMERA_POSITION,
        up="+z",
    )
    write_cameras(calibration, {camera.name: camera})
    seen = to_camera(points[::FRAMES_A_PICTURE][:PICTURE_COUNT], R, CAMERA_POSITION) @ K.T
    pixels = seen[..., :2] / seen[..., 2:]
    make_folder(keypoints)
    rng = np.random.default_rng(NOISE_SEED)
    for index, frame in enumerate(pixels):
        rows = _body_25(frame + rng.normal(scale=POINT_DEVIATION, size=frame.shape), rng)
        people = [{"person_id": [-1], "pose_keypoints_2d": rows.round(3).ravel().tolist()}]
        name = f"walk_{index:012d}_keypoints.json"
        write_text(keypoints / name, [json.dumps({"version": 1.3, "people": people}), "\n"])


def _body_25(pixels: Array, rng: np.random.Generator) -> Array:
    """Return x, y and confidence (25, 3) of one picture's points (19, 2): feet are not seen."""
    layout = load_skeleton_map("body_25")
    rows = np.zeros((len(layout.points), 3))
    for landmark, names in layout.landmarks.items():
        if landmark in MIDDLE_OF:
            sides = [POINTS.index(f"{side}_{MIDDLE_OF[landmark]}") for side in ("right", "left")]
            place = pixels[sides].mean(axis=0)
        elif landmark in POINTS:
            place = pixels[POINTS.index(landmark)]
        else:
            continue
        if len(names) == 1:
            rows[layout.points.index(names[0])] = [*place, rng.uniform(0.8, 0.95)]
    return rows
