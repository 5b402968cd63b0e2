"""A folder of files to try posekit with, each made from code and seeds."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Final

import numpy as np

from posekit.body import load_figure
from posekit.errors import InputError
from posekit.formats.own import View, write_object_view, write_view
from posekit.objects import draw_view, load_object
from posekit.safe_io.writing import make_folder
from posekit.samples.detected_walk import write_detected_walk
from posekit.samples.robot_squat import write_robot_squat
from posekit.samples.walking_person import configurations, figure, write_defective_walk, write_walk
from posekit.synthesis import Walker, random_views, walker_scene
from posekit.views.builtin import forget_camera, view_of

PHOTO_SEED: Final = 4
GRIPPER_SEED: Final = 1
PHOTO_DEVIATION: Final = 2.0
"""Pixels: what points are off that are set by hand."""
WALK_CAMERA: Final = (3.0, 0.0, 3.0)
"""The camera of Lee & Chen's SEQ2 (1985), metres, as they count it."""

SAMPLE_FILES: Final = {
    "walk.json": "a view of five exact frames of somebody who walks, with the truth",
    "walk.npz": "three seconds of walking in space, 30 frames a second",
    "keypoints/": "what a detector wrote of that walk: OpenPose's files, a picture each, 2 px off",
    "calibration.toml": "the camera of those pictures, cam_01",
    "photo.json": "the fourteen points of one photograph; no camera is known",
    "gripper.json": "a Panda robot in a picture; no camera is known",
    "jump.bvh": "the walk with an elbow bent backward and a jump, to be found",
    "robot.npz": "a Unitree G1 that squats, with mistakes to be found",
}
"""What is in the folder, in the order in which it is listed."""


def write_samples(folder: str | Path) -> dict[str, str]:
    """Write the files of `SAMPLE_FILES` into a folder, which is made where it is not there; each is written anew.

    Parameters
    ----------
    folder : path
        Where to write.

    Returns
    -------
    dict
        What each file is, by its name.

    Raises
    ------
    InputError
        Where the folder is a file, or cannot be written.
    """
    folder = Path(folder)
    if folder.exists() and not folder.is_dir():
        raise InputError(f"{folder}: is a file; expected a folder, or a name that is free; choose another")
    make_folder(folder)
    scene = walker_scene(Walker(), camera=WALK_CAMERA)
    write_view(folder / "walk.json", view_of(scene))
    person = figure()
    q = configurations(person)
    write_walk(folder / "walk.npz", person, q)
    points = person.forward_kinematics(q)
    write_detected_walk(folder / "keypoints", folder / "calibration.toml", points)
    write_view(folder / "photo.json", photograph())
    gripper = draw_view(load_object("panda"), 1, np.random.default_rng(GRIPPER_SEED), scale_known=False)
    write_object_view(folder / "gripper.json", gripper)
    write_defective_walk(folder / "jump.bvh", person, q)
    write_robot_squat(folder / "robot.npz")
    return dict(SAMPLE_FILES)


def photograph() -> View:
    """Return the points of one photograph, to whole pixels, and the truth."""
    rng = np.random.default_rng(PHOTO_SEED)
    scene = random_views(load_figure(), 1, rng)
    view = forget_camera(view_of(scene))
    return replace(view, image=view.image.round(), deviation=PHOTO_DEVIATION)
