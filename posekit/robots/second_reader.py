"""A second reader for URDF files from outside: two parsers must agree on where the links are."""

from __future__ import annotations

import io
import math
from collections.abc import Mapping
from typing import Any

import numpy as np
import pinocchio as pin

from posekit.geometry import Array, rotation_about
from posekit.safe_io import cut, one_line, refusal

AGREEMENT_METRES = 1e-9
"""Metres by which the two readers' frames may differ, at 1 m from the root; relative beyond."""
_TURNS = ("JointModelRUBX", "JointModelRUBY", "JointModelRUBZ", "JointModelRevoluteUnboundedUnaligned")


def compare_readers(urdf: str, model: pin.Model, source: str, *, must_read: bool = True) -> bool:
    """Place every link by Pinocchio and by yourdfpy, off neutral, and refuse the file where they differ.

    Pinocchio drops or accepts some malformed parts of a URDF without a word; what another parser reads
    differently is malformed.

    Parameters
    ----------
    urdf : str
        The text that both have read.
    model : pinocchio.Model
        What Pinocchio made of it.
    source : str
        What to call it in errors.
    must_read : bool
        Whether a file that the second reader cannot read is refused. It knows no capsules, and no floating or
        planar joints.

    Returns
    -------
    bool
        Whether the two were compared.

    Raises
    ------
    InputError
        Naming the first link on which they differ.
    """
    import yourdfpy

    try:
        other = yourdfpy.URDF.load(io.BytesIO(urdf.encode()), load_meshes=False, build_scene_graph=False)
    except Exception as error:  # yourdfpy lets through whatever its parsers raise
        if not must_read:
            return False
        reason = cut(one_line(str(error)))
        raise refusal(
            source, "", f"a second reader cannot read it: {reason}", "a URDF", "correct it"
        ) from error
    kinds = {model.names[k]: model.joints[k].shortname() for k in range(1, model.njoints)}
    if any(joint.type in ("floating", "planar") for joint in other.robot.joints):
        return False
    q = pin.neutral(model)
    angles: dict[str, float] = {}
    for name in other.actuated_joint_names:
        if name not in kinds:
            got = f"joint {name!r} is read by one reader and not by another"
            raise refusal(source, "", got, "the same joints", "check its XML")
        angles[name] = _set(model, q, name, None, kinds[name])
    mimics: dict[str, float] = {}
    for joint in other.robot.joints:
        if joint.mimic is not None and joint.name in kinds and joint.mimic.joint in angles:
            followed = joint.mimic.multiplier * angles[joint.mimic.joint] + joint.mimic.offset
            mimics[joint.name] = _set(model, q, joint.name, followed, kinds[joint.name])
    data = model.createData()
    pin.framesForwardKinematics(model, data, q)
    children = {joint.child for joint in other.robot.joints}
    root = next((link for link in other.link_map if link not in children), "")
    places = _places(root, other.robot.joints, angles | mimics)
    base = data.oMf[model.getFrameId(root, pin.FrameType.BODY)]
    for link in other.link_map:
        T = places.get(link, np.eye(4))
        placement = base.actInv(data.oMf[model.getFrameId(link, pin.FrameType.BODY)])
        apart = np.abs(T - placement.homogeneous).max()
        if not apart <= AGREEMENT_METRES * max(1.0, float(np.abs(T[:3, 3]).max())):
            got = f"two readers place link {link!r} {apart:.3g} m apart"
            raise refusal(source, "", got, "one place", "check the numbers of its joint")
    return True


def _places(root: str, joints: list[Any], angles: Mapping[str, float]) -> dict[str, Array]:
    """Place the links in the root's frame (4, 4), from joint to joint: yourdfpy's graph takes n^4 for a chain of n."""
    below: dict[str, list[Any]] = {}
    for joint in joints:
        below.setdefault(joint.parent, []).append(joint)
    places = {root: np.eye(4)}
    waiting = [root]
    while waiting:
        link = waiting.pop()
        for joint in below.pop(link, ()):
            motion = np.eye(4)
            angle = angles.get(joint.name, 0.0)
            if joint.type == "prismatic":
                motion[:3, 3] = angle * joint.axis
            elif joint.type in ("revolute", "continuous"):
                axis = joint.axis / np.linalg.norm(joint.axis)
                motion[:3, :3] = rotation_about(axis, np.asarray(angle))
            origin = np.eye(4) if joint.origin is None else joint.origin
            places[joint.child] = places[link] @ origin @ motion
            waiting.append(joint.child)
    return places


def _set(model: pin.Model, q: np.ndarray, name: str, angle: float | None, kind: str) -> float:
    """Put a joint at an angle, by default at 60 % of its range, and return the angle."""
    index = model.idx_qs[model.getJointId(name)]
    if kind in _TURNS:
        angle = 0.3 if angle is None else angle
        q[index : index + 2] = math.cos(angle), math.sin(angle)
        return angle
    lower, upper = model.lowerPositionLimit[index], model.upperPositionLimit[index]
    if angle is None:
        angle = float(lower + 0.6 * (upper - lower)) if 0 < upper - lower < 1e3 else 0.3
    q[index] = angle
    return angle
