"""A second reader for URDF files from outside: two parsers must agree on where the links are."""

from __future__ import annotations

import io
import math

import numpy as np
import pinocchio as pin

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
        other = yourdfpy.URDF.load(io.BytesIO(urdf.encode()), load_meshes=False, build_scene_graph=True)
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
    for joint in other.robot.joints:
        if joint.mimic is not None and joint.name in kinds and joint.mimic.joint in angles:
            followed = joint.mimic.multiplier * angles[joint.mimic.joint] + joint.mimic.offset
            _set(model, q, joint.name, followed, kinds[joint.name])
    other.update_cfg(angles)
    data = model.createData()
    pin.framesForwardKinematics(model, data, q)
    root = model.getFrameId(other.base_link, pin.FrameType.BODY)
    for link in other.link_map:
        T = other.get_transform(link)
        placement = data.oMf[root].actInv(data.oMf[model.getFrameId(link, pin.FrameType.BODY)])
        apart = np.abs(T - placement.homogeneous).max()
        if not apart <= AGREEMENT_METRES * max(1.0, float(np.abs(T[:3, 3]).max())):
            got = f"two readers place link {link!r} {apart:.3g} m apart"
            raise refusal(source, "", got, "one place", "check the numbers of its joint")
    return True


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
