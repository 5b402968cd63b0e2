"""A second reader for URDF files from outside: two parsers must agree on where the joints are."""

from __future__ import annotations

import io
import math

import numpy as np
import pinocchio as pin

from posekit.errors import FigureError

AGREEMENT = 1e-9
"""Metres by which the two readers' frames may differ."""


def compare_readers(urdf: str, model: pin.Model, source: str) -> None:
    """Place every link by Pinocchio and by yourdfpy, off neutral, and refuse the file where they differ.

    Pinocchio drops or accepts some malformed parts of a URDF without a word; what another parser reads
    differently is malformed.

    Raises
    ------
    FigureError
        Naming the first link on which they differ.
    """
    import yourdfpy

    try:
        other = yourdfpy.URDF.load(io.BytesIO(urdf.encode()), load_meshes=False, build_scene_graph=True)
    except Exception as error:  # yourdfpy lets through whatever its parsers raise
        raise FigureError(
            f"{source}: a second reader cannot read it: {str(error).splitlines()[0]}"
        ) from error
    q = pin.neutral(model)
    angles = {}
    for name in other.actuated_joint_names:
        if not model.existJointName(name):
            raise FigureError(
                f"{source}: joint {name!r} is read by one reader and not by another; check its XML"
            )
        index = model.idx_qs[model.getJointId(name)]
        lower, upper = model.lowerPositionLimit[index], model.upperPositionLimit[index]
        q[index] = angles[name] = lower + 0.6 * (upper - lower) if math.isfinite(upper - lower) else 0.3
    other.update_cfg(angles)
    data = model.createData()
    pin.framesForwardKinematics(model, data, q)
    for link in other.link_map:
        T = other.get_transform(link)
        placement = data.oMf[model.getFrameId(link)]
        apart = np.abs(T[:3, 3] - placement.translation).max()
        if not apart <= AGREEMENT:
            raise FigureError(
                f"{source}: two readers place link {link!r} {apart:.3g} m apart; check the numbers of its joint"
            )
