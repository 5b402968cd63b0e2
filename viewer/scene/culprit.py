"""Which parts of the body a finding is about: what is pointed at where a rejected branch is drawn."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from posekit.body.capsules import CAPSULE_AXES
from posekit.skeleton import HIPS, JOINT, TORSO

RIGID_JOINTS = {"torso": TORSO, "hips": HIPS}
LIMB_ENDS: Mapping[str, tuple[str, ...]] = {
    "arm": ("shoulder", "elbow", "wrist"),
    "leg": ("hip", "knee", "ankle"),
    **dict.fromkeys(("foot", "toe", "heel"), ("ankle",)),
}
KNEE_JOINTS = ("right_knee", "left_knee")


@dataclass(frozen=True, kw_only=True)
class Culprit:
    """Links (capsules) and joints to point at."""

    links: tuple[str, ...] = ()
    joints: tuple[str, ...] = ()


def culprit(reason: str) -> Culprit:
    """Read what a finding's text is about.

    Parameters
    ----------
    reason : str
        ``check/where`` as a result's ``rejected`` and ``pruned`` name it: a joint's angle, a pair of bodies
        that touch, a pair of joints at a wrong distance, a rule of walking, a joint that no ray reaches.

    Examples
    --------
    >>> culprit("joint_range/right_elbow.flexion").joints
    ('right_elbow',)
    >>> culprit("collision/right_forearm-torso").links
    ('right_forearm', 'torso')
    """
    _, _, where = reason.rpartition("/")
    if where in RIGID_JOINTS:
        return Culprit(joints=RIGID_JOINTS[where])
    words = where.split(".")
    if words[-1] in ("knees", "standing_leg"):
        return Culprit(joints=KNEE_JOINTS)
    parts = [part for word in words for part in word.split("-")]
    links = tuple(part for part in parts if part in CAPSULE_AXES)
    joints = [name for part in parts if part not in CAPSULE_AXES for name in _joints(part)]
    return Culprit(links=links, joints=tuple(dict.fromkeys(joints)))


def _joints(part: str) -> list[str]:
    """Return the joint of that name; of a limb or a side (walking's rules) all its joints."""
    if part in JOINT:
        return [part]
    side, _, limb = part.rpartition("_")
    names = LIMB_ENDS.get(limb.removesuffix("s"), ())
    if part in ("right", "left"):  # rule 2: arm and leg of that side
        side, names = part, ("elbow", "knee")
    sides = [side] if side else ["right", "left"]
    return [f"{each}_{name}" for each in sides for name in names if f"{each}_{name}" in JOINT]
