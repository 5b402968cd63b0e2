"""Whether a URDF is laid out as the closed form of the inverse kinematics takes it to be."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pinocchio as pin

from posekit.cameras import Array
from posekit.errors import FigureError
from posekit.skeleton import DOFS, POINTS, urdf_joint_name

if TYPE_CHECKING:
    from posekit.figure.figure import Figure

AXIS_OF_ANGLE = {"flexion": 1, "bending": 0, "abduction": 0, "rotation": 2}
"""Flexion turns about y, bending and abduction about x, rotation about z, in this order."""


def axis_signs(model: pin.Model, source: str) -> Array:
    """Return for each of `posekit.skeleton.DOFS` whether its joint turns about plus or minus the axis (22,).

    Raises
    ------
    FigureError
        Where a joint turns about another axis.
    """
    signs = np.empty(len(DOFS))
    for k, dof in enumerate(DOFS):
        joint = model.joints[model.getJointId(urdf_joint_name(dof))]
        data = joint.createData()
        joint.calc(data, np.zeros(joint.nq))
        axis = np.asarray(data.S).reshape(6)[3:]
        expected = AXIS_OF_ANGLE[dof.split(".")[1]]
        signs[k] = axis[expected]
        if abs(signs[k]) != 1:
            raise FigureError(
                f"{source}: joint {urdf_joint_name(dof)!r} turns about {axis.tolist()}; expected plus or minus the "
                f"{'xyz'[expected]} axis"
            )
    return signs


def check_layout(figure: Figure) -> None:
    """Refuse joints that lie otherwise than the closed form takes them to: place a posture and take it back."""
    q = pin.neutral(figure.model)[None]
    lower, upper = figure.limits.lower, figure.limits.upper
    q[:, figure.angle_index] = lower + 0.4 * (upper - lower)
    points = figure.forward_kinematics(q)
    back = figure.forward_kinematics(figure.inverse_kinematics(points))
    apart = np.linalg.norm(back - points, axis=-1)[0]
    if not (apart < 1e-6).all():
        raise FigureError(
            f"{figure.source}: the joint before {POINTS[int(np.argmin(apart < 1e-6))]!r} does not lie as the stick "
            "figure's; expected limbs along -z, joint origins without rpy, and the stick figure's order of joints"
        )
