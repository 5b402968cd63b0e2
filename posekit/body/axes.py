"""Which way the figure's joints turn: the closed form knows the order of the axes and asks for their signs."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from posekit.errors import FigureError
from posekit.geometry import Array
from posekit.skeleton import DOFS, urdf_joint_name

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
