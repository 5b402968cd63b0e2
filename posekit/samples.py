"""Sample files: a walking person, key points of the walk, one photograph, and robots.

All files are computed with fixed random seeds, so they are always the same.
"""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Final

import numpy as np

from posekit.errors import refusal
from posekit.geometry import Array

#: Contents of the folder, in the order in which they are listed.
SAMPLE_FILES: Final = {
    "walk.json": "a view of five exact frames of a walking person, with the truth",
    "walk.npz": "three seconds of walking in space, 30 frames per second",
    "keypoints/": "a detector's key points of that walk: OpenPose's files, one per picture, 2 px off",
    "calibration.toml": "the camera of those pictures, cam_01",
    "photo.json": "the fourteen points of one photograph; no camera is known",
    "gripper.json": "a Panda robot in a picture; no camera is known",
    "jump.bvh": "the walk with an elbow bent backward and a jump, to be found",
    "robot.npz": "a squatting Unitree G1, with mistakes to be found",
}

#: Camera position of Lee & Chen's SEQ2 (1985), metres, in the paper's convention.
WALK_CAMERA: Final = (3.0, 0.0, 3.0)

#: Height of the walking person, metres.
STATURE: Final = 1.75

RATE, WALK_FRAMES, ROBOT_FRAMES = 30.0, 90, 90

#: Height of the lowest ankle above the ground, metres, because the figure has no feet.
ANKLE_HEIGHT: Final = 0.08

#: Frames of `jump.bvh` in which the right elbow is bent backward, and the angle of the elbow.
ELBOW_BACK, ELBOW_DEGREES = slice(30, 36), -25.0

#: From this frame on, the walk of `jump.bvh` is moved to the side by this distance, as if two takes were joined.
JUMP_FRAME, JUMP_METRES = 70, 0.3

PICTURE_SIZE, FOCAL_LENGTH = (1280, 720), 1000.0
#: Position of the key points' camera in the walk's world, metres: in front, to the right, at chest height.
CAMERA_POSITION: Final = np.array([4.6, 1.3, 3.2])

PICTURES, FRAMES_PER_PICTURE = 12, 3
#: Standard deviation of key points and of manually marked points, pixels.
POINT_DEVIATION: Final = 2.0

NOISE_SEED, PHOTO_SEED, GRIPPER_SEED = 175, 4, 1

#: Rotation from the walk's world (y up) to the calibration's world (z up), as in Pose2Sim.
R_CALIBRATION_WALK: Final = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])

#: First points of OpenPose's BODY_25, with posekit's names; the six points of the feet are unseen.
BODY_25: Final = (
    *("nose", "mid_shoulder", "right_shoulder", "right_elbow", "right_wrist"),
    *("left_shoulder", "left_elbow", "left_wrist", "mid_hip", "right_hip", "right_knee"),
    *("right_ankle", "left_hip", "left_knee", "left_ankle", "right_eye", "left_eye", "right_ear", "left_ear"),
)

#: Largest flexion of the hips, radians.
SQUAT_DEPTH: Final = 0.6

#: Mistakes in `robot.npz`: frames, changed entry, and largest change (radians and metres). The elbow bends beyond its
#: range, the arm penetrates the trunk, and the feet penetrate the ground.
ROBOT_MISTAKES: Final = (
    (slice(10, 35), "left_elbow_joint", 2.6),
    (slice(46, 55), "left_shoulder_roll_joint", -0.75),
    (slice(65, 85), "height", -0.06),
)


def samples(folder: str | Path) -> list[str]:
    """Write the files of `SAMPLE_FILES` to a folder, which is created if it does not exist.

    Parameters
    ----------
    folder : path
        Existing files with these names are replaced.

    Returns
    -------
    list of str
        A line for each file: its name and its content.

    Raises
    ------
    InputError
        If the folder is a file.
    """
    from posekit.body import load_figure
    from posekit.formats import save
    from posekit.motion import Motion
    from posekit.skeleton import DOFS, POINTS
    from posekit.synthesis import Walker, forget_camera, random_views, walker_view

    folder = Path(folder)
    if folder.exists() and not folder.is_dir():
        raise refusal(folder, "", "a file", "a folder, or a free name", "choose another name")
    folder.mkdir(parents=True, exist_ok=True)
    save(walker_view(Walker(), camera=WALK_CAMERA), folder / "walk.json")
    photo = forget_camera(random_views(1, np.random.default_rng(PHOTO_SEED)))
    save(replace(photo, image=photo.image.round(), deviation=POINT_DEVIATION), folder / "photo.json")

    walker = Walker(figure=load_figure().scaled(_lengths_of_a_person()))
    figure, time = walker.figure, np.arange(WALK_FRAMES) / RATE
    q = walker.configurations(walker.phase(time))
    q[:, :3] += walker.travel(time)
    ankles = figure.forward_kinematics(q)[:, [POINTS.index("right_ankle"), POINTS.index("left_ankle")]]
    q[:, 1] += ANKLE_HEIGHT - ankles[..., 1].min()
    points = figure.forward_kinematics(q)
    save(Motion(joints=points, joint_names=POINTS, time=time, up="+y"), folder / "walk.npz")
    _write_key_points(folder, points)
    q[ELBOW_BACK, figure.angle_index[DOFS.index("right_elbow.flexion")]] = np.radians(ELBOW_DEGREES)
    q[JUMP_FRAME:, 2] += JUMP_METRES
    points = figure.forward_kinematics(q)
    jump = Motion(joints=points, joint_names=POINTS, q=q, robot="figure", time=time, up="+y")
    save(jump, folder / "jump.bvh")
    _write_robots(folder)
    return [f"{name:<18}{content}" for name, content in SAMPLE_FILES.items()]


def _lengths_of_a_person() -> dict[str, float]:
    """Draw random segment lengths of a walking person, metres, between the points that a detector reports."""
    from posekit.recovery.person import PROPORTIONS, by_segment

    people, rng = PROPORTIONS["people"], np.random.default_rng(NOISE_SEED)
    drawn = {
        name: share * rng.lognormal(0.0, people["deviations"][name])
        for name, share in people["shares"].items()
    }
    return {name: STATURE * share for name, share in by_segment(drawn).items()}


def _write_key_points(folder: Path, points: Array) -> None:
    """Project a walk (T, 19, 3); write its key points, one file per picture, and the camera's calibration."""
    from posekit.cameras import PinholeCamera
    from posekit.files import write_bytes
    from posekit.formats import save
    from posekit.skeleton import POINTS
    from posekit.synthesis import look_at, to_camera

    width, height = PICTURE_SIZE
    K = np.array([[FOCAL_LENGTH, 0, width / 2], [0, FOCAL_LENGTH, height / 2], [0, 0, 1.0]])
    middle = (points.min(axis=(0, 1)) + points.max(axis=(0, 1))) / 2
    R = look_at(CAMERA_POSITION, middle, np.array([0.0, 1.0, 0.0]))
    camera = PinholeCamera(
        name="cam_01", K=K, size=PICTURE_SIZE, R=R @ R_CALIBRATION_WALK.T, t=-R @ CAMERA_POSITION, up="+z"
    )
    save({camera.name: camera}, folder / "calibration.toml")
    seen = to_camera(points[::FRAMES_PER_PICTURE][:PICTURES], R, CAMERA_POSITION) @ K.T
    pixels, rng = seen[..., :2] / seen[..., 2:], np.random.default_rng(NOISE_SEED)
    (folder / "keypoints").mkdir(exist_ok=True)
    for index, frame in enumerate(pixels):
        noisy = frame + rng.normal(scale=POINT_DEVIATION, size=frame.shape)
        rows = np.zeros((25, 3))
        for row, name in enumerate(BODY_25):
            of = [f"{side}{name[3:]}" for side in ("right", "left")] if name.startswith("mid_") else [name]
            rows[row] = [*noisy[[POINTS.index(one) for one in of]].mean(axis=0), rng.uniform(0.8, 0.95)]
        people = [{"person_id": [-1], "pose_keypoints_2d": rows.round(3).ravel().tolist()}]
        path = folder / "keypoints" / f"walk_{index:012d}_keypoints.json"
        write_bytes(path, json.dumps({"version": 1.3, "people": people}).encode() + b"\n")


def _write_robots(folder: Path) -> None:
    """Write a view of a Panda robot arm, and a motion of a squatting G1 robot as arrays of configurations."""
    from posekit.files import write_bytes
    from posekit.formats.npz_file import packed
    from posekit.recovery.objects import load_linkage
    from posekit.robots import load_robot
    from posekit.robots.kinematics import frame_places
    from posekit.synthesis import object_document, object_view

    panda = load_robot("panda", bodies="none")
    names = load_linkage("panda").points
    image, truth = object_view(panda, names, 1, np.random.default_rng(GRIPPER_SEED))
    view = json.dumps(object_document(names, image, truth), indent=1)
    write_bytes(folder / "gripper.json", f"{view}\n".encode())

    robot = load_robot("g1", bodies="none")
    joints = [name for name in robot.configuration_names if name.endswith("_joint")]
    column = {name: 7 + k for k, name in enumerate(joints)} | {"height": 2}
    turn = 2 * np.pi * np.arange(ROBOT_FRAMES) / ROBOT_FRAMES
    bend, swing = SQUAT_DEPTH * (1 - np.cos(turn)) / 2, 0.4 * np.sin(turn)
    q = np.zeros((ROBOT_FRAMES, robot.model.nq))
    q[:, 6] = 1.0
    for side, sign in (("left", 1.0), ("right", -1.0)):
        for joint, angle in (("hip_pitch", -bend), ("knee", 2 * bend), ("ankle_pitch", -bend)):
            q[:, column[f"{side}_{joint}_joint"]] = angle
        q[:, column[f"{side}_shoulder_pitch_joint"]] = sign * swing
        q[:, column[f"{side}_shoulder_roll_joint"]] = sign * 0.3
    ankle = frame_places(robot.model, q, [robot.model.getFrameId("left_ankle_roll_link")])[:, 0]
    q[:, [0, 2]] = -ankle[:, [0, 2]]  # the feet do not move
    for frames, name, change in ROBOT_MISTAKES:
        count = frames.stop - frames.start
        q[frames, column[name]] += change * np.sin(np.pi * np.arange(count) / count) ** 2
    arrays = {
        "root_pos": q[:, :3],
        "root_quat_xyzw": q[:, 3:7],
        "dof_pos": q[:, 7:],
        "dof_names": np.array(joints),
        "fps": np.array(RATE),
    }
    write_bytes(folder / "robot.npz", packed(arrays))
