"""The names and the topology of the stick figure: joints, segments, rigid parts, degrees of freedom.

Lengths are not here: `urdf/stick_figure.urdf` is their one source. Everything is an index into
`JOINTS`, the tree's order, or into `POINTS`: the joints followed by the head's five points, which are
known before the tree is grown.
"""

from __future__ import annotations

from typing import Final

JOINTS: Final = (
    "neck",
    "right_shoulder",
    "left_shoulder",
    "pelvis",
    "right_hip",
    "left_hip",
    "right_elbow",
    "left_elbow",
    "right_wrist",
    "left_wrist",
    "right_knee",
    "left_knee",
    "right_ankle",
    "left_ankle",
)
HEAD_POINTS: Final = ("nose", "right_eye", "left_eye", "right_ear", "left_ear")
POINTS: Final = JOINTS + HEAD_POINTS
FEET_POINTS: Final = ("right_toe", "left_toe", "right_heel", "left_heel")
"""No joints of the figure: what a file may have besides, and a foot stands on."""
SIDES: Final = ("right", "left")

JOINT: Final = {name: index for index, name in enumerate(JOINTS)}
POINT: Final = {name: index for index, name in enumerate(POINTS)}
HEAD: Final = tuple(POINT[name] for name in HEAD_POINTS)

PARENTS: Final = tuple(
    -1 if parent is None else JOINT[parent]
    for parent in (
        None,
        "neck",
        "neck",
        "neck",
        "pelvis",
        "pelvis",
        "right_shoulder",
        "left_shoulder",
        "right_elbow",
        "left_elbow",
        "right_hip",
        "left_hip",
        "right_knee",
        "left_knee",
    )
)
"""The joint from which each joint is lifted (Lee & Chen 1985, §2.2); -1 for the root."""

TREE_SEGMENTS: Final = tuple((PARENTS[child], child) for child in range(1, len(JOINTS)))
"""The 13 segments that lift a joint, in tree order."""

TORSO: Final = ("neck", "right_shoulder", "left_shoulder", "pelvis")
HIPS: Final = ("pelvis", "right_hip", "left_hip")

RIGID_SEGMENTS: Final = (
    (JOINT["right_shoulder"], JOINT["left_shoulder"]),
    (JOINT["right_shoulder"], JOINT["pelvis"]),
    (JOINT["left_shoulder"], JOINT["pelvis"]),
    (JOINT["right_hip"], JOINT["left_hip"]),
)
"""The four segments that lift nothing: distances inside the rigid torso and hips (§3.2.B)."""

SEGMENTS: Final = TREE_SEGMENTS + RIGID_SEGMENTS

LIMB_JOINTS: Final = tuple(
    (JOINT[f"{side}_{start}"], JOINT[f"{side}_{middle}"], JOINT[f"{side}_{end}"])
    for start, middle, end in (("shoulder", "elbow", "wrist"), ("hip", "knee", "ankle"))
    for side in SIDES
)
"""Right arm, left arm, right leg, left leg: start, middle and end joint of each."""

LIMB_SEGMENTS: Final = tuple(pair for limb in LIMB_JOINTS for pair in (limb[:2], limb[1:]))
"""Upper arms, forearms, thighs and shanks, limb by limb, by their two joints."""

N_TRUNK_JOINTS: Final = len(JOINTS) - 2 * len(LIMB_JOINTS)
"""Joints of torso and hips: the first of the tree, on which limbs hang."""


def segment_name(segment: tuple[int, int]) -> str:
    """Name a segment as files do: `a-b`, with a before b in tree order."""
    start, end = sorted(segment)
    return f"{JOINTS[start]}-{JOINTS[end]}"


SEGMENT_NAMES: Final = tuple(segment_name(segment) for segment in SEGMENTS)

DOFS: Final = tuple(
    f"{joint}.{angle}"
    for joint, angles in (
        ("neck", ("flexion", "bending", "rotation")),
        ("pelvis", ("flexion", "bending", "rotation")),
        ("right_shoulder", ("flexion", "abduction", "rotation")),
        ("right_elbow", ("flexion",)),
        ("left_shoulder", ("flexion", "abduction", "rotation")),
        ("left_elbow", ("flexion",)),
        ("right_hip", ("flexion", "abduction", "rotation")),
        ("right_knee", ("flexion",)),
        ("left_hip", ("flexion", "abduction", "rotation")),
        ("left_knee", ("flexion",)),
    )
    for angle in angles
)
"""The 22 angles of the figure, as findings name them; their URDF joints are `urdf_joint_name(dof)`."""


def urdf_joint_name(dof: str) -> str:
    """Name the URDF joint of a degree of freedom: ``right_elbow.flexion`` is ``right_elbow_flexion``."""
    return dof.replace(".", "_")


def other_side(name: str) -> str:
    """Name the landmark of the other side; the middle ones are their own."""
    side, _, part = name.partition("_")
    return {"right": f"left_{part}", "left": f"right_{part}"}.get(side, name)
