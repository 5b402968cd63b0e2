"""Which pairs of bodies can touch: by the balls around them, many configurations at once."""

from __future__ import annotations

from typing import Final

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from posekit.errors import InputError
from posekit.geometry import Array
from posekit.robots.configuration_space import ConfigurationSpace
from posekit.robots.joint_chain import JointChain

ROOM_METRES: Final = 1e-6
"""Metres that balls are taken larger, for rounding."""

ROOM_A_METRE: Final = 1e-12
"""As much more for each metre that the base, or a joint that slides, is away from the origin."""

ROWS_AT_ONCE: Final = 256
"""Configurations that are looked at at once: some hundred pairs of them stay in the processor's cache."""


class NearPairs:
    """The balls around some bodies, and the pairs that are asked about.

    Each body is inside the ball that coal puts around it (the centre and the radius of its local box), so bodies whose
    balls keep their margin do, too, and need not be asked. Of meshes that spares most of the work.

    Parameters
    ----------
    model : pinocchio.Model
        The kinematic model of Pinocchio.
    geometry : pinocchio.GeometryModel
        With P pairs.
    margins : array (P,)
        Metres that the bodies of each pair must keep from each other.
    """

    def __init__(self, model: pin.Model, geometry: pin.GeometryModel, margins: Array) -> None:
        bodies = list(geometry.geometryObjects)
        for body in bodies:
            body.geometry.computeLocalAABB()
        radius = np.array([body.geometry.aabb_radius for body in bodies])
        self._centre = np.array([body.placement.act(body.geometry.aabb_center) for body in bodies])
        self._joint = np.array([body.parentJoint for body in bodies], dtype=np.intp)
        pairs = np.array([(pair.first, pair.second) for pair in geometry.collisionPairs], dtype=np.intp)
        self._first, self._second = pairs.reshape(-1, 2).T
        self._reach = radius[self._first] + radius[self._second] + margins + ROOM_METRES
        self._chain: JointChain | None = None
        try:
            ConfigurationSpace(model)
        except InputError:  # joints whose kinematics are Pinocchio's alone: every pair is asked
            return
        self._chain = JointChain(model, set(self._joint.tolist()), 0)

    def of(self, q: Array) -> NDArray[np.bool_]:
        """Tell which pairs can be nearer than their margin in some configurations (N, nq): (N, P)."""
        if self._chain is None:
            return np.ones((len(q), len(self._reach)), dtype=np.bool_)
        near = np.empty((len(q), len(self._reach)), dtype=np.bool_)
        for start in range(0, len(q), ROWS_AT_ONCE):
            near[start : start + ROWS_AT_ONCE] = self._of(self._chain, q[start : start + ROWS_AT_ONCE])
        return near

    def _of(self, chain: JointChain, q: Array) -> NDArray[np.bool_]:
        rotation, origin = chain.place(q)
        room = ROOM_A_METRE * np.abs(q).max(axis=1, initial=0.0)
        with np.errstate(over="ignore", invalid="ignore"):  # bodies without end; what is no number is asked
            centre = origin[self._joint] + np.einsum("bijn,bj->bin", rotation[self._joint], self._centre)
            squared = ((centre[self._first] - centre[self._second]) ** 2).sum(axis=1)
            return np.asarray(~(squared > (self._reach[:, None] + room) ** 2)).T
