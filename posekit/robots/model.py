"""Pinocchio's model of a URDF that was checked, and the names of what is in it."""

from __future__ import annotations

from typing import Final
from xml.etree import ElementTree

import numpy as np
import pinocchio as pin

from posekit.robots.urdf_numbers import numbers
from posekit.safe_io import cut, one_line, refusal

_FREE: Final = ("x", "y", "z", "qx", "qy", "qz", "qw")
_SUFFIXES: Final = {
    "JointModelFreeFlyer": _FREE,
    "JointModelSpherical": _FREE[3:],
    "JointModelPlanar": ("x", "y", "cos", "sin"),
    "JointModelRUBX": ("cos", "sin"),
    "JointModelRUBY": ("cos", "sin"),
    "JointModelRUBZ": ("cos", "sin"),
    "JointModelRevoluteUnboundedUnaligned": ("cos", "sin"),
}
ROOT_JOINT_NAMES: Final = ("root_joint", "free_flyer", "posekit_root_joint")


def build_model(robot: ElementTree.Element, source: str, *, free_flyer: bool) -> pin.Model:
    """Build Pinocchio's model of a checked URDF.

    The text that Pinocchio reads is written from the elements that were checked, so that no other reading of
    the file's own text comes in between.

    Raises
    ------
    InputError
        Where Pinocchio cannot read it, or reads other joints or limits than the text has.
    """
    text = ElementTree.tostring(robot, encoding="unicode")
    moving = {
        joint.get("name", ""): joint for joint in robot.findall("joint") if joint.get("type") != "fixed"
    }
    root = next((name for name in ROOT_JOINT_NAMES if name not in moving), "")
    try:
        if free_flyer:
            model = pin.buildModelFromXML(text, pin.JointModelFreeFlyer(), root)
        else:
            model = pin.buildModelFromXML(text)
    except (ValueError, RuntimeError) as error:
        reason = cut(one_line(str(error).splitlines()[0]))
        raise refusal(source, "", f"Pinocchio cannot read it: {reason}", "a URDF", "correct it") from error
    expected = sorted([root, *moving] if free_flyer else moving)
    if sorted(list(model.names)[1:]) != expected:
        got = f"{model.njoints - 1} joints read by Pinocchio"
        raise refusal(source, "", got, f"the {len(expected)} of the text", "give joints other names")
    _check_limits(model, moving, source)
    _check_placements(model, source)
    return model


def configuration_names(model: pin.Model) -> tuple[str, ...]:
    """Name each entry of q: the joint's name, with what it is where the joint has several.

    The free-flying root's seven have no prefix, as the stick figure's: x, y, z, qx, qy, qz, qw.
    """
    names = [""] * model.nq
    for joint in range(1, model.njoints):
        kind, name = model.joints[joint].shortname(), model.names[joint]
        suffixes = _SUFFIXES.get(
            kind, ("",) if model.nqs[joint] == 1 else tuple(map(str, range(model.nqs[joint])))
        )
        is_root = joint == 1 and kind == "JointModelFreeFlyer" and name in ROOT_JOINT_NAMES
        for k, suffix in enumerate(suffixes):
            names[model.idx_qs[joint] + k] = suffix if is_root else f"{name}.{suffix}" if suffix else name
    return tuple(names)


def _check_limits(model: pin.Model, moving: dict[str, ElementTree.Element], source: str) -> None:
    for name, joint in moving.items():
        limit = joint.find("limit")
        if limit is None or joint.get("type") not in ("revolute", "prismatic"):
            continue
        index = model.idx_qs[model.getJointId(name)]
        read = float(model.lowerPositionLimit[index]), float(model.upperPositionLimit[index])
        written = numbers(limit, "lower", "0")[0], numbers(limit, "upper", "0")[0]
        if not np.allclose(read, written, rtol=1e-12, atol=1e-300):
            place = f"joint {name!r}"
            raise refusal(
                source, place, f"limits read as {read}", f"the text's {written}", "correct its numbers"
            )


def _check_placements(model: pin.Model, source: str) -> None:
    data = model.createData()
    pin.framesForwardKinematics(model, data, pin.neutral(model))
    for frame, placement in zip(model.frames, data.oMf, strict=True):
        if not np.isfinite(placement.homogeneous).all():
            got = f"{frame.name!r} is placed at a number that is not finite"
            raise refusal(source, "", got, "finite placements", "correct the numbers of its joints")
