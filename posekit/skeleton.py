"""Names and topology of posekit's human figure: joints, segments, rigid parts, degrees of freedom.

Segment lengths are in `urdf/stick_figure.urdf`. Indices of joints refer to `JOINTS`, in which each parent precedes its
children. Indices of points refer to `POINTS`: the 14 joints, then the five points of `HEAD_POINTS`.
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
#: Points of the feet that files may have; the figure has no such joints.
FEET_POINTS: Final = ("right_toe", "left_toe", "right_heel", "left_heel")

#: Names that a point of a motion can have: joints, head points, toes and heels.
NAMES: Final = (*POINTS, *FEET_POINTS)
SIDES: Final = ("right", "left")

JOINT: Final = {name: index for index, name in enumerate(JOINTS)}
POINT: Final = {name: index for index, name in enumerate(POINTS)}
HEAD: Final = tuple(POINT[name] for name in HEAD_POINTS)

#: Parent of each joint: the start of the segment that locates the joint (Lee & Chen 1985, §2.2); -1 for the root.
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

#: The 13 segments from a parent to its joint, in tree order.
TREE_SEGMENTS: Final = tuple((PARENTS[child], child) for child in range(1, len(JOINTS)))

TORSO: Final = ("neck", "right_shoulder", "left_shoulder", "pelvis")
HIPS: Final = ("pelvis", "right_hip", "left_hip")

#: The four other segments: distances inside the rigid torso and hips (Lee & Chen 1985, §3.2.B).
RIGID_SEGMENTS: Final = (
    (JOINT["right_shoulder"], JOINT["left_shoulder"]),
    (JOINT["right_shoulder"], JOINT["pelvis"]),
    (JOINT["left_shoulder"], JOINT["pelvis"]),
    (JOINT["right_hip"], JOINT["left_hip"]),
)

SEGMENTS: Final = TREE_SEGMENTS + RIGID_SEGMENTS

#: Right arm, left arm, right leg, left leg: start, middle and end joint of each.
LIMB_JOINTS: Final = tuple(
    (JOINT[f"{side}_{start}"], JOINT[f"{side}_{middle}"], JOINT[f"{side}_{end}"])
    for start, middle, end in (("shoulder", "elbow", "wrist"), ("hip", "knee", "ankle"))
    for side in SIDES
)

#: Length of each limb segment as a fraction of stature: Drillis & Contini 1966, "Body segment parameters", Technical
#: Report 1166.03, New York University, as reprinted in Winter, "Biomechanics and Motor Control of Human Movement"
#: (figure 4.1).
LIMB_SHARES: Final = {
    **{("shoulder", "elbow"): 0.186, ("elbow", "wrist"): 0.146},
    **{("hip", "knee"): 0.245, ("knee", "ankle"): 0.246},
}

#: Start and end joints of upper arms, forearms, thighs and shanks, limb by limb.
LIMB_SEGMENTS: Final = tuple(pair for limb in LIMB_JOINTS for pair in (limb[:2], limb[1:]))

#: Body parts along a segment of limbs or trunk, by name of the figure's link, and the joints at both ends of each.
PARTS: Final = {
    "torso": ("neck", "pelvis"),
    "hips": ("right_hip", "left_hip"),
    **{
        f"{side}_{part}": (f"{side}_{start}", f"{side}_{end}")
        for side in SIDES
        for part, start, end in (
            ("upper_arm", "shoulder", "elbow"),
            ("forearm", "elbow", "wrist"),
            ("thigh", "hip", "knee"),
            ("shank", "knee", "ankle"),
        )
    },
}

#: Number of joints of torso and hips, which come first in the tree.
N_TRUNK_JOINTS: Final = len(JOINTS) - 2 * len(LIMB_JOINTS)


def both(name: str) -> list[int]:
    """Return the indices of the right and the left joint for a name without a side, such as "hip"."""
    return [JOINT[f"{side}_{name}"] for side in SIDES]


def segment_name(segment: tuple[int, int]) -> str:
    """Return the name of a segment in files: `a-b`, where joint a precedes joint b in `JOINTS`."""
    start, end = sorted(segment)
    return f"{JOINTS[start]}-{JOINTS[end]}"


SEGMENT_NAMES: Final = tuple(segment_name(segment) for segment in SEGMENTS)

#: Names of the figure's 22 angles, as used in findings; `urdf_joint_name` returns the URDF joint of each.
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


def urdf_joint_name(dof: str) -> str:
    """Return the URDF joint of a degree of freedom: ``right_elbow_flexion`` for ``right_elbow.flexion``."""
    return dof.replace(".", "_")


def other_side(name: str) -> str:
    """Swap right and left in the name of a body point; a name without a side is unchanged."""
    side, _, part = name.partition("_")
    return {"right": f"left_{part}", "left": f"right_{part}"}.get(side, name)
