"""The figure for other engines: the same joints, capsules and pairs, written from Pinocchio's model.

Nothing is read from the figure's URDF again, so that no other reading of it comes between: bodies are Pinocchio's
joints, capsules its collision bodies (radius, length between the middles of the ends, placement in the joint's frame).
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
import pinocchio as pin

JOINT_AXES = {"JointModelRX": "1 0 0", "JointModelRY": "0 1 0", "JointModelRZ": "0 0 1"}


def mjcf(model: pin.Model, geometry: pin.GeometryModel) -> str:
    """Write MuJoCo's XML: hinges with Pinocchio's names, only the given pairs, nothing that moves by itself."""
    children = _children(model)

    def body(joint: int, indent: str) -> list[str]:
        place = model.jointPlacements[joint]
        moves = (
            "<freejoint/>"
            if joint == 1
            else f'<joint name="{model.names[joint]}" type="hinge" axis="{_axis(model, joint)}"/>'
        )
        lines = [
            f'{indent}<body name="{model.names[joint]}" pos="{_numbers(place.translation)}" '
            f'quat="{_quaternion(place)}">',
            f"{indent}  {moves}",
            f'{indent}  <inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>',
        ]
        lines += [
            f'{indent}  <geom name="{one.name}" type="capsule" contype="0" conaffinity="0" '
            f'size="{one.geometry.radius!r} {one.geometry.halfLength!r}" pos="{_numbers(one.placement.translation)}" '
            f'quat="{_quaternion(one.placement)}"/>'
            for one in geometry.geometryObjects
            if one.parentJoint == joint
        ]
        for child in children[joint]:
            lines += body(child, indent + "  ")
        return [*lines, f"{indent}</body>"]

    names = [one.name for one in geometry.geometryObjects]
    pairs = [
        f'    <pair geom1="{names[pair.first]}" geom2="{names[pair.second]}" margin="0"/>'
        for pair in geometry.collisionPairs
    ]
    return "\n".join(
        [
            '<mujoco><option gravity="0 0 0"/><size memory="8M"/><compiler angle="radian"/>',
            "  <worldbody>",
            *body(1, "    "),
            "  </worldbody>",
            "  <contact>",
            *pairs,
            "  </contact>",
            "</mujoco>",
        ]
    )


def urdf(model: pin.Model, geometry: pin.GeometryModel) -> str:
    """Write a URDF with one link for each joint, named as the joint, and capsules as Bullet reads them."""
    lines = ['<robot name="figure">']
    for joint in range(1, model.njoints):
        lines += [
            f'<link name="{model.names[joint]}">',
            '<inertial><mass value="1"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial>',
        ]
        lines += [
            f"<collision>{_origin(one.placement)}<geometry>"
            f'<capsule radius="{one.geometry.radius!r}" length="{2 * one.geometry.halfLength!r}"/>'
            "</geometry></collision>"
            for one in geometry.geometryObjects
            if one.parentJoint == joint
        ]
        lines.append("</link>")
    for joint in range(2, model.njoints):
        parent = model.names[model.parents[joint]]
        lines.append(
            f'<joint name="{model.names[joint]}" type="continuous"><parent link="{parent}"/>'
            f'<child link="{model.names[joint]}"/>{_origin(model.jointPlacements[joint])}'
            f'<axis xyz="{_axis(model, joint)}"/></joint>'
        )
    return "\n".join([*lines, "</robot>"])


def _children(model: pin.Model) -> dict[int, list[int]]:
    children: dict[int, list[int]] = {joint: [] for joint in range(model.njoints)}
    for joint in range(1, model.njoints):
        children[model.parents[joint]].append(joint)
    return children


def _axis(model: pin.Model, joint: int) -> str:
    kind = model.joints[joint].shortname()
    if kind in JOINT_AXES:
        return JOINT_AXES[kind]
    # Beside the axes: what a small turn about it is.
    data = model.joints[joint].createData()
    model.joints[joint].calc(data, np.zeros(model.nq), np.zeros(model.nv))
    return _numbers(np.asarray(data.S)[3:6].ravel())


def _numbers(values: Iterable[float]) -> str:
    return " ".join(repr(float(value)) for value in values)


def _quaternion(place: pin.SE3) -> str:
    x, y, z, w = pin.Quaternion(place.rotation).coeffs()
    return _numbers((w, x, y, z))


def _origin(place: pin.SE3) -> str:
    return (
        f'<origin xyz="{_numbers(place.translation)}" rpy="{_numbers(pin.rpy.matrixToRpy(place.rotation))}"/>'
    )
