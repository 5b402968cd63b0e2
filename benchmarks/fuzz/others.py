"""Whole files that posekit reads and does not write: cameras, points and choices as others spell them."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
from PIL import Image

from posekit.formats.cameras import read_cameras, write_cameras
from posekit.formats.skeleton_maps import load_skeleton_map
from posekit.skeleton import JOINT
from tests.detector_files import landmarks_of, scatter

FOCAL_35MM_TAG = 41989
K_WIDTH_HEIGHT = ([[1000.0, 0.0, 640.0], [0.0, 1000.0, 360.0], [0.0, 0.0, 1.0]], 1280, 720)


def write_cameras_of_others(folder: Path) -> list[Path]:
    """Write a camera as OpenCV, ROS, NumPy, COLMAP and a photograph have it; return the files."""
    K, width, height = K_WIDTH_HEIGHT
    flat = [value for row in K for value in row]
    [(name, camera), *_] = read_cameras(folder / "calibration.toml").items()
    write_cameras(folder / "camera.yaml", {name: camera})
    matrix = f"<rows>3</rows><cols>3</cols><dt>d</dt><data>{' '.join(map(str, flat))}</data>"
    texts = {
        "storage.xml": "<?xml version='1.0'?><opencv_storage><camera_matrix type_id='opencv-matrix'>"
        f"{matrix}</camera_matrix><image_width>{width}</image_width><image_height>{height}</image_height>"
        "<dist_coeffs type_id='opencv-matrix'><rows>1</rows><cols>5</cols><dt>d</dt><data>0 0 0 0 0</data>"
        "</dist_coeffs></opencv_storage>",
        "camera.json": json.dumps({"K": K, "dist": [0.1, 0, 0, 0, 0], "width": width, "height": height}),
        "cameras.txt": f"# cameras\n1 OPENCV {width} {height} 1000 1000 640 360 0.1 0 0 0\n",
    }
    for name, text in texts.items():
        (folder / name).write_text(text, encoding="utf-8")
    np.savez(folder / "camera.npz", K=np.array(K), dist=np.zeros(5), size=np.array([width, height]))
    picture = Image.new("RGB", (width, height))
    exif = picture.getexif()
    exif.get_ifd(0x8769)[FOCAL_35MM_TAG] = 28
    picture.save(folder / "photograph.jpg", exif=exif)
    names = ("calibration.toml", "camera.yaml", *texts, "camera.npz", "photograph.jpg")
    return [folder / name for name in names]


def write_points_of_others(folder: Path) -> list[Path]:
    """Write a walk as lifters and Caliscope do: Human3.6M's points without names, MediaPipe's by number."""
    with np.load(folder / "walk.npz") as held:
        joints = held["joints"][:20]
    place = {name: joints[:, k] for name, k in JOINT.items()}
    root = (place["right_hip"] + place["left_hip"]) / 2
    middle, head = (root + place["neck"]) / 2, 1.4 * place["neck"] - 0.4 * root
    legs = [place[f"{side}_{joint}"] for side in ("right", "left") for joint in ("hip", "knee", "ankle")]
    arms = [
        place[f"{side}_{joint}"] for side in ("left", "right") for joint in ("shoulder", "elbow", "wrist")
    ]
    lifted = [root, *legs, middle, place["neck"], (place["neck"] + head) / 2, head, *arms]
    np.save(folder / "lifted.npy", np.stack(lifted, axis=1).astype(np.float32))
    points = scatter(load_skeleton_map("mediapipe_33"), landmarks_of(joints))
    rows = ["sync_index,point_id,x_coord,y_coord,z_coord,frame_time"]
    rows += [
        f"{k},{number},{x:.4f},{y:.4f},{z:.4f},{k / 30:.4f}"
        for k, frame in enumerate(points)
        for number, (x, y, z) in enumerate(frame)
        if np.isfinite(x)
    ]
    (folder / "xyz_POSE.csv").write_text("\n".join(rows), encoding="utf-8")
    return [folder / "lifted.npy", folder / "xyz_POSE.csv"]


def write_choices(folder: Path) -> dict[str, list[Path]]:
    """Write flips by hand, and lengths of a person; return the files by kind."""
    nearer = {"schema": "posekit.nearer/1", "frames": [{"right_elbow-right_wrist": "right_wrist"}]}
    (folder / "nearer.json").write_text(json.dumps(nearer), encoding="utf-8")
    (folder / "lengths.toml").write_text(
        'schema = "posekit.lengths/1"\nunit = "cm"\nsource = "a tape"\n[lengths]\nelbow-wrist = 25\n',
        encoding="utf-8",
    )
    return {"nearer": [folder / "nearer.json"], "lengths": [folder / "lengths.toml"]}
