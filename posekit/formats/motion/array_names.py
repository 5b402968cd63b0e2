"""The names of arrays by which an NPZ is told to hold a robot's motion, or a body model's."""

from __future__ import annotations

from typing import Final

from posekit.formats.motion.root_turn import QUATERNION_ORDERS

ROOT_PLACES: Final = (
    "root_pos",
    "root_trans",
    "root_position",
    "root_translation",
    "root_trans_offset",
    "base_pos",
)
ROOT_TURNS: Final = ("root_rot", "root_ori", "root_quat", "root_quaternion", "root_orientation", "base_quat")
JOINT_ANGLES: Final = (
    "dof_pos",
    "dof_positions",
    "dof",
    "dofs",
    "joint_pos",
    "joint_positions",
    "joint_angles",
)
JOINT_NAMES: Final = ("dof_names", "joint_names", "joints_list")
RATE_NAMES: Final = ("fps", "rate", "frame_rate", "framerate")
BODY_ARRAYS: Final = (("body_positions", "body_rotations"), ("body_pos_w", "body_quat_w"))
"""All bodies' places and turns, as simulators record them: quaternions are w, x, y, z (Isaac Lab, *Motion files*)."""
ROOT_TURNS_IN_ORDER: Final = (
    *ROOT_TURNS,
    *(f"{name}_{order}" for name in ROOT_TURNS for order in QUATERNION_ORDERS),
)
"""The same, and with the order of the quaternion behind."""


def holds_robot(names: frozenset[str]) -> bool:
    """Tell whether arrays are of a robot's configurations: joints, and a root's turn."""
    turned = names & {*ROOT_TURNS_IN_ORDER, *(turns for _, turns in BODY_ARRAYS)}
    return "qpos" in names or bool(turned and names & set(JOINT_ANGLES))


def holds_body_angles(names: frozenset[str]) -> bool:
    """Tell whether arrays are the angles of a body model."""
    return "trans" in names and ("poses" in names or {"root_orient", "pose_body"} <= names)
