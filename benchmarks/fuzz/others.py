"""Whole files that posekit reads and does not write: cameras, points, robots and choices as others spell them."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Final

import numpy as np
from PIL import Image

from posekit.formats.cameras import read_cameras, write_cameras
from posekit.formats.own import read_view
from posekit.formats.skeleton_maps import load_skeleton_map
from posekit.skeleton import JOINT, JOINTS
from tests.detector_files import landmarks_of, scatter
from tests.formats.test_body_angles import clip_arrays, model_arrays
from tests.robots.test_hostile_models import OBJ, VALID, dae, stl, triangle

FOCAL_35MM_TAG = 41989
COLMAP_CAMERA: Final = "# cameras\n1 OPENCV 1280 720 1000 1000 640 360 0.1 0 0 0\n"
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
        "cameras.txt": COLMAP_CAMERA,
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


def write_body_angles(folder: Path) -> dict[str, list[Path]]:
    """Write a clip as AMASS has it, and a body model; return the files by kind."""
    np.savez(folder / "angles.npz", **clip_arrays())
    np.savez(folder / "model.npz", **model_arrays())
    return {"body angles": [folder / "angles.npz"], "body model": [folder / "model.npz"]}


def write_robot_folders(folder: Path) -> dict[str, list[Path]]:
    """Write an arm with meshes of three formats, its motion, and a model of COLMAP; return the files by kind."""
    arm, model = folder / "arm", folder / "colmap"
    arm.mkdir()
    model.mkdir()
    urdf = VALID
    shapes = ('<sphere radius="0.1"/>', '<box size="0.1 0.2 0.3"/>', '<cylinder radius="0.1" length="0.5"/>')
    meshes = {"a.stl": stl(1, triangle()), "b.obj": OBJ + b"f 1 2 3\n", "c.dae": dae()}
    for shape, (name, data) in zip(shapes, meshes.items(), strict=True):
        urdf = urdf.replace(shape, f'<mesh filename="{name}" scale="0.1 0.1 0.1"/>')
        (arm / name).write_bytes(data)
    (arm / "arm.urdf").write_text(urdf, encoding="utf-8")
    (arm / "arm.srdf").write_text(
        '<robot name="r"><disable_collisions link1="a" link2="c" reason="x"/></robot>', encoding="utf-8"
    )
    names = "time,root_pos_x,root_pos_y,root_pos_z,root_rot_x,root_rot_y,root_rot_z,root_rot_w,j,k"
    rows = [f"{k / 30:.4f},0,0,1,0,0,0,1,{k / 20},{k / 10}" for k in range(10)]
    (folder / "arm.csv").write_text("\n".join([names, *rows]), encoding="utf-8")
    (model / "cameras.txt").write_text(COLMAP_CAMERA, encoding="utf-8")
    (model / "images.txt").write_text("1 1 0 0 0 0.1 0.2 3 1 a.jpg\n1.5 2.5 -1\n", encoding="utf-8")
    return {
        "arm folder": sorted(arm.iterdir()),
        "arm motion": [folder / "arm.csv"],
        "COLMAP folder": sorted(model.iterdir()),
    }


def write_object_views(folder: Path, linkages: dict[str, tuple[str, ...]]) -> None:
    """Write a view of each of some linkages by its points, on a parabola."""
    for name, points in linkages.items():
        image = {point: [40.0 * k, 7.0 * k * k] for k, point in enumerate(points)}
        view = {
            "schema": "posekit.view/1",
            "camera": {"model": "scaled-orthographic", "scale": None},
            "frames": [{"time": 0.0, "image": image}],
        }
        (folder / f"{name}.json").write_text(json.dumps(view), encoding="utf-8")


def write_lines(folder: Path) -> dict[str, list[Path]]:
    """Write a walk as lines of a live detector, by name and by number."""
    view = read_view(folder / "walk.json")
    header = json.dumps({"size": [1280, 720], "stature": 1.75, "deviation": 2})
    lines = [
        json.dumps({"time": k / 30, "points": dict(zip(JOINTS, points.tolist(), strict=True))})
        for k, points in enumerate(view.image)
    ]
    lines += [
        json.dumps({"time": 1 + k / 30, "points": points.tolist()}) for k, points in enumerate(view.image)
    ]
    (folder / "lines.jsonl").write_text("\n".join([header, *lines, ""]), encoding="utf-8")
    return {"live lines": [folder / "lines.jsonl"]}
