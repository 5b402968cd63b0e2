"""What the positions of each unknown joint are: a matter of the pattern alone."""

from __future__ import annotations

from posekit.hidden.completion import Kind
from posekit.hidden.plan import HIP_JOINTS, TORSO_JOINTS, Plan, State


def kinds(plan: Plan, *, spins: bool = False) -> dict[int, Kind]:
    """Name the kind of each unknown joint's set; `spins` where a measured torso turns about its shoulders' line.

    A position that is one of finitely many does not widen what hangs on it: an elbow on either of two shoulders
    is in a part of a sphere.
    """
    found: dict[int, Kind] = {}
    known = [joint for joint in TORSO_JOINTS[1:] if plan.states[joint] == State.EXACT]
    few = 1 if spins else len(known)
    torso = {0: Kind.SPHERE_REGION, 1: Kind.CIRCLE}.get(few, Kind.POINT)
    found |= {joint: torso for joint in TORSO_JOINTS if plan.states[joint] == State.HIDDEN}
    pelvis, *hips = HIP_JOINTS
    hidden = [joint for joint in hips if plan.states[joint] == State.HIDDEN]
    loose = _loose(found.get(pelvis, Kind.EXACT))
    for joint in hips:
        if plan.states[joint] == State.SEEN:
            found[joint] = Kind.DEPTH_INTERVAL
        elif plan.states[joint] == State.HIDDEN:
            free = Kind.CIRCLE if len(hidden) == 1 else Kind.SPHERE_REGION
            found[joint] = Kind.REGION if loose else free
    for limb in plan.limbs:
        base = found.get(limb.base, Kind.EXACT)
        loose = _loose(base) or (base == Kind.DEPTH_INTERVAL and _loose(found.get(pelvis, Kind.EXACT)))
        for joint in plan.free(limb):
            hidden_kind = Kind.REGION if loose else Kind.SPHERE_REGION
            found[joint] = hidden_kind if plan.states[joint] == State.HIDDEN else Kind.DEPTH_INTERVAL
            loose = loose or plan.states[joint] == State.HIDDEN
    return found


def _loose(kind: Kind) -> bool:
    """Whether the positions are a continuum."""
    return kind in (Kind.CIRCLE, Kind.SPHERE_REGION, Kind.REGION)
