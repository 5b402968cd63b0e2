"""The joints of a model, level by level from the root: their placements for a batch of configurations."""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from posekit.geometry import Array, cross, rotation_from_quaternion
from posekit.geometry.batch_last import matrix_product, matrix_vector


class ChainLevel(NamedTuple):
    """Joints of one depth; `turning`, `sliding` and `flying` are places among them."""

    joints: NDArray[np.intp]
    turning: NDArray[np.intp]
    sliding: NDArray[np.intp]
    flying: NDArray[np.intp]


class JointChain:
    """The joints that lead to some bodies.

    The batch is the last axis of every array inside: each operation runs along it.

    Parameters
    ----------
    model : pinocchio.Model
        Whose joints they are.
    bodies : iterable of int
        The joints whose placements are wanted.
    carrier : int
        The joint in whose body's frame they are wanted; 0 is the world.

    Attributes
    ----------
    beyond : list of int
        The carrier and all joints beyond it, parents first.
    supports : bool array (njoints, nv)
        Which entries of v move which joint's body.
    dof_joint : int array (nv,)
        Which joint each entry of v belongs to.
    dof_axis : array (nv, 3)
        Axis of every entry of v in its joint's frame.
    dof_turns : bool array (nv,)
        Whether it turns about that axis, or slides along it.
    """

    def __init__(self, model: pin.Model, bodies: Iterable[int], carrier: int) -> None:
        count = self.count = int(model.njoints)
        self.carrier = carrier
        self.parents = np.array([model.parents[j] for j in range(count)])
        self.beyond = beyond(model, carrier)
        self.rotation = np.array([model.jointPlacements[j].rotation for j in range(count)])
        self.translation = np.array([model.jointPlacements[j].translation for j in range(count)])
        self.at = np.array([model.idx_qs[j] for j in range(count)])
        self.continuous = np.array([model.nqs[j] == 2 for j in range(count)])
        self.supports = np.zeros((count, model.nv), dtype=np.bool_)
        self.dof_joint = np.zeros(model.nv, dtype=np.intp)
        self.dof_axis = np.zeros((model.nv, 3))
        self.dof_turns = np.zeros(model.nv, dtype=np.bool_)
        self.constant, self.sine, self.cosine = np.zeros((3, count, 3, 3))
        self.slide = np.zeros((count, 3))
        kinds: dict[str, list[int]] = {"turning": [], "sliding": [], "flying": []}
        for joint in self.beyond[1:]:
            first, width = int(model.idx_vs[joint]), int(model.nvs[joint])
            own = slice(first, first + width)
            self.supports[joint] = self.supports[self.parents[joint]]
            self.supports[joint, own] = True
            self.dof_joint[own] = joint
            if width == 6:
                self.dof_axis[own] = np.tile(np.eye(3), (2, 1))
                self.dof_turns[first + 3 : first + 6] = True
                kinds["flying"].append(joint)
                continue
            axis, turns = _axis(model, joint)
            self.dof_axis[first], self.dof_turns[first] = axis, turns
            kinds["turning" if turns else "sliding"].append(joint)
            if turns:
                # Rodrigues: R = aa' + sin [a] + cos (1 - aa'), after the joint's placement.
                outer = np.outer(axis, axis)
                self.constant[joint] = self.rotation[joint] @ outer
                self.sine[joint] = self.rotation[joint] @ cross(np.eye(3), axis)
                self.cosine[joint] = self.rotation[joint] @ (np.eye(3) - outer)
            else:
                self.slide[joint] = self.rotation[joint] @ axis
        self.levels = self._levels(bodies, kinds)

    def place(self, q: Array) -> tuple[Array, Array]:
        """Return the joints' rotations (njoints, 3, 3, N) and origins (njoints, 3, N) for q (N, nq)."""
        n = len(q)
        rotation = np.zeros((self.count, 3, 3, n))
        origin = np.zeros((self.count, 3, n))
        rotation[self.carrier] = np.eye(3)[:, :, None]
        columns = np.ascontiguousarray(q.T)
        for level in self.levels:
            parents = self.parents[level.joints]
            local, shift = self._local(level, columns)
            rotation[level.joints] = matrix_product(rotation[parents], local)
            origin[level.joints] = origin[parents] + matrix_vector(rotation[parents], shift)
        return rotation, origin

    def _local(self, level: ChainLevel, columns: Array) -> tuple[Array, Array]:
        """Return the placements of a level's joints in their parents' bodies."""
        n, joints = columns.shape[1], level.joints
        if len(level.turning) == len(joints):
            local = np.empty((len(joints), 3, 3, n))
        else:
            local = np.tile(self.rotation[joints][..., None], (1, 1, 1, n))
        shift: Array = np.broadcast_to(self.translation[joints][..., None], (len(joints), 3, n))
        if level.turning.size:
            turning = joints[level.turning]
            cos, sin = self._cos_sin(columns, turning)
            local[level.turning] = (
                self.constant[turning][..., None]
                + self.sine[turning][..., None] * sin[:, None, None]
                + self.cosine[turning][..., None] * cos[:, None, None]
            )
        if level.sliding.size or level.flying.size:
            shift = shift.copy()
        if level.sliding.size:
            sliding = joints[level.sliding]
            shift[level.sliding] += self.slide[sliding][..., None] * columns[self.at[sliding]][:, None]
        for place in level.flying:
            joint, at = joints[place], self.at[joints[place]]
            fixed = self.rotation[joint][None, ..., None]
            shift[place] += matrix_vector(fixed, columns[at : at + 3][None])[0]
            turn = rotation_from_quaternion(columns[at + 3 : at + 7], axis=0)
            local[place] = matrix_product(fixed, turn[None])[0]
        return local, shift

    def _cos_sin(self, columns: Array, joints: NDArray[np.intp]) -> tuple[Array, Array]:
        at, continuous = self.at[joints], self.continuous[joints]
        if not continuous.any():
            return np.cos(columns[at]), np.sin(columns[at])
        first, second = columns[at], columns[np.where(continuous, at + 1, at)]
        keep = continuous[:, None]
        return np.where(keep, first, np.cos(first)), np.where(keep, second, np.sin(first))

    def _levels(self, bodies: Iterable[int], kinds: dict[str, list[int]]) -> tuple[ChainLevel, ...]:
        needed = {self.carrier}
        for body in bodies:
            joint = int(body)
            while joint not in needed:
                needed.add(joint)
                joint = int(self.parents[joint])
        depth = {self.carrier: 0}
        for joint in self.beyond[1:]:
            depth[joint] = depth[int(self.parents[joint])] + 1
        levels = []
        for d in range(1, max(depth.values()) + 1):
            joints = np.array([j for j in self.beyond if depth[j] == d and j in needed], dtype=np.intp)
            if joints.size:
                places = [np.flatnonzero(np.isin(joints, kind)) for kind in kinds.values()]
                levels.append(ChainLevel(joints, *places))
        return tuple(levels)


def beyond(model: pin.Model, joint: int) -> list[int]:
    """List a joint and all that it carries, parents first; 0 carries all."""
    found, members = [joint], {joint}
    for other in range(joint + 1, model.njoints):
        if int(model.parents[other]) in members:
            found.append(other)
            members.add(other)
    return found


def _axis(model: pin.Model, joint: int) -> tuple[Array, bool]:
    """Return a joint's axis in its own frame, and whether it turns about it (or slides along it)."""
    data = model.joints[joint].createData()
    q = np.zeros(model.nqs[joint])
    q[0] = float(model.nqs[joint] == 2)
    model.joints[joint].calc(data, q)
    column = np.asarray(data.S).reshape(6)
    turns = bool(np.abs(column[3:]).any())
    return (column[3:] if turns else column[:3]).copy(), turns
