"""A Unitree G1 that squats and waves its arms, as a table of configurations; with mistakes to find."""

from __future__ import annotations

from pathlib import Path
from typing import Final

import numpy as np
import pinocchio as pin

from posekit.geometry import Array
from posekit.robots import Robot, load_robot
from posekit.safe_io import replacing

ROBOT_RATE: Final = 30.0
FRAME_COUNT: Final = 90
SQUAT_DEPTH: Final = 0.6
"""Radians that the hips are bent at the lowest."""
ELBOW_BEYOND: Final = slice(10, 35)
"""Frames in which the left elbow bends, beyond its range."""
ARM_IN_TRUNK: Final = slice(46, 55)
"""Frames in which the left arm goes into the trunk, and out of it."""
FEET_IN_GROUND: Final = slice(65, 85)
"""Frames in which the feet go into the ground, by 6 cm."""


def write_robot_squat(path: Path) -> None:
    """Write root, joints, their names and the rate, as tables of robots have them."""
    robot = load_robot("g1")
    names = [name for name in robot.configuration_names if name.endswith("_joint")]
    q = _squat(robot, names)
    for frames, column, change in (
        (ELBOW_BEYOND, 7 + names.index("left_elbow_joint"), 2.6),
        (ARM_IN_TRUNK, 7 + names.index("left_shoulder_roll_joint"), -0.75),
        (FEET_IN_GROUND, 2, -0.06),
    ):
        count = frames.stop - frames.start
        q[frames, column] += change * np.sin(np.pi * np.arange(count) / count) ** 2
    with replacing(path) as file:
        np.savez(
            file,
            root_pos=q[:, :3],
            root_quat_xyzw=q[:, 3:7],
            dof_pos=q[:, 7:],
            dof_names=np.array(names),
            fps=np.array(ROBOT_RATE),
        )


def _squat(robot: Robot, names: list[str]) -> Array:
    """Return configurations (T, nq): the feet stay where they are, flat."""
    bend = SQUAT_DEPTH * (1 - np.cos(2 * np.pi * np.arange(FRAME_COUNT) / FRAME_COUNT)) / 2
    swing = 0.4 * np.sin(2 * np.pi * np.arange(FRAME_COUNT) / FRAME_COUNT)
    q = np.zeros((FRAME_COUNT, robot.model.nq))
    q[:, 6] = 1.0
    for side, sign in (("left", 1.0), ("right", -1.0)):
        for joint, angle in (
            ("hip_pitch", -bend),
            ("knee", 2 * bend),
            ("ankle_pitch", -bend),
            ("shoulder_pitch", sign * swing),
            ("shoulder_roll", np.full(FRAME_COUNT, sign * 0.3)),
        ):
            q[:, 7 + names.index(f"{side}_{joint}_joint")] = angle
    data = robot.model.createData()
    ankle = robot.frame_id("left_ankle_roll_link")
    for row in q:
        pin.framesForwardKinematics(robot.model, data, row)
        row[0] = -data.oMf[ankle].translation[0]
        row[2] = -data.oMf[ankle].translation[2]
    return q
