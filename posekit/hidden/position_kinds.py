"""What the positions of each unknown joint are: a matter of the pattern alone."""

from __future__ import annotations

from posekit.hidden.completion import PositionKind
from posekit.hidden.occlusion_pattern import HIP_JOINTS, TORSO_JOINTS, JointState, OcclusionPattern


def position_kinds(pattern: OcclusionPattern, *, measured: bool = False) -> dict[int, PositionKind]:
    """Name the kind of each unknown joint's set; of a `measured` trunk nothing follows from other points of it.

    A position that is one of finitely many does not widen what hangs on it: an elbow on either of two shoulders
    is in a part of a sphere.
    """
    found: dict[int, PositionKind] = {}
    known = [joint for joint in TORSO_JOINTS[1:] if pattern.states[joint] == JointState.EXACT]
    few = 0 if measured else len(known)
    torso = {0: PositionKind.SPHERE_REGION, 1: PositionKind.CIRCLE}.get(few, PositionKind.POINT)
    found |= {joint: torso for joint in TORSO_JOINTS if pattern.states[joint] == JointState.HIDDEN}
    pelvis, *hips = HIP_JOINTS
    hidden = [joint for joint in hips if pattern.states[joint] == JointState.HIDDEN]
    loose = _loose(found.get(pelvis, PositionKind.EXACT))
    for joint in hips:
        if pattern.states[joint] == JointState.SEEN:
            found[joint] = PositionKind.DEPTH_INTERVAL
        elif pattern.states[joint] == JointState.HIDDEN:
            one = len(hidden) == 1 and not measured
            free = PositionKind.CIRCLE if one else PositionKind.SPHERE_REGION
            found[joint] = PositionKind.REGION if loose else free
    for limb in pattern.limbs:
        base = found.get(limb.base, PositionKind.EXACT)
        loose = _loose(base) or (
            base == PositionKind.DEPTH_INTERVAL and _loose(found.get(pelvis, PositionKind.EXACT))
        )
        for joint in pattern.free(limb):
            hidden_kind = PositionKind.REGION if loose else PositionKind.SPHERE_REGION
            found[joint] = (
                hidden_kind if pattern.states[joint] == JointState.HIDDEN else PositionKind.DEPTH_INTERVAL
            )
            loose = loose or pattern.states[joint] == JointState.HIDDEN
    return found


def _loose(kind: PositionKind) -> bool:
    """Whether the positions are a continuum."""
    return kind in (PositionKind.CIRCLE, PositionKind.SPHERE_REGION, PositionKind.REGION)
