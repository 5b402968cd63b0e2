"""The names that the figure's joints have in BVH files of posekit, by which these are known again."""

from __future__ import annotations

from typing import Final

ANIMATION_NAMES: Final = {
    "pelvis": "Hips",
    "torso": "Spine",
    "neck": "NeckBase",
    "head": "Head",
    "nose": "Nose",
    **{
        f"{side}_{part}": f"{side.capitalize()}{name}"
        for side in ("right", "left")
        for part, name in (
            ("shoulder", "Arm"),
            ("elbow", "ForeArm"),
            ("wrist", "Hand"),
            ("hip", "UpLeg"),
            ("knee", "Leg"),
            ("ankle", "Foot"),
            ("eye", "Eye"),
            ("ear", "Ear"),
        )
    },
}
"""What animation programs call the figure's joints: by those names they find their own characters' joints.

A file's Neck may lie anywhere between the shoulders and the head; NeckBase is the figure's, and is in no other file.
"""
