"""Forward kinematics of a Pinocchio model for a batch of configurations, and points on its joints."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np
import pinocchio as pin

from posekit.geometry import Array, cross, cross_matrix, rotation_from_quaternion

#: Configurations worked on at once, so that their rotations stay in the processor's cache.
BLOCK: Final = 256

#: Entries of q of each type of joint that has more than one.
SUFFIXES: Final = {
    "JointModelFreeFlyer": ("x", "y", "z", "qx", "qy", "qz", "qw"),
    "JointModelPlanar": ("x", "y", "cos", "sin"),
    **dict.fromkeys((f"JointModelRUB{axis}" for axis in "XYZ"), ("cos", "sin")),
    "JointModelRevoluteUnboundedUnaligned": ("cos", "sin"),
}


class Site(NamedTuple):
    """A place on a body: a joint's index, and metres in the joint's frame."""

    joint: int
    offset: tuple[float, float, float]


class Kinematics:
    """Places joints and points for a batch of configurations.

    Equal to Pinocchio's `forwardKinematics` and joint Jacobians up to rounding, about 20 times faster per
    configuration than a loop over them. Arrays inside have the batch as their last axis.

    Parameters
    ----------
    model : pinocchio.Model
        Joints may be revolute, continuous, prismatic, planar and floating.
    points : sequence of Site
        The points to place; only joints that lead to one are placed. All joints are if there are none.
    """

    def __init__(self, model: pin.Model, points: Sequence[Site] = ()) -> None:
        self._joint = np.array([site.joint for site in points], dtype=np.intp)
        self._offset = np.array([site.offset for site in points]).reshape(-1, 3)
        above = [
            list(joints) for joints in model.supports
        ]  # each begins with the universe and ends with the joint
        needed = {joint for site in points for joint in above[site.joint]} if points else range(model.njoints)
        depths = [len(joints) for joints in above]
        levels = [[j for j in needed if depths[j] == depth] for depth in range(2, max(depths) + 1)]
        self._levels = [(np.array(js, dtype=np.intp), [model.parents[j] for j in js]) for js in levels if js]
        self._of_v = np.repeat(np.arange(model.njoints), list(model.nvs))
        self._moves = np.array([np.isin(self._of_v, above[joint]) for joint in self._joint])
        self._subspace, axes = np.zeros((6, model.nv)), np.zeros((model.njoints, 6))
        self._special: list[int] = []
        self._at = np.zeros((2, model.njoints), dtype=np.intp)
        for joint in range(1, model.njoints):
            data, first = model.joints[joint].createData(), int(model.idx_vs[joint])
            model.joints[joint].calc(data, pin.neutral(model))
            columns = np.asarray(data.S).reshape(6, -1)
            self._subspace[:, first : first + model.nvs[joint]] = columns
            self._at[:, joint] = model.idx_qs[joint], model.idx_qs[joint] + model.nqs[joint] - 1
            if model.nvs[joint] > 1:
                self._special.append(joint)
            else:
                axes[joint] = columns[:, 0]
        # The rotation of a hinge after its placement is A + sin S + cos C.
        self._fixed = np.array([M.rotation for M in model.jointPlacements])
        self._shift = np.array([M.translation for M in model.jointPlacements])[..., None]
        turning, outer = np.asarray(axes[:, 3:].any(axis=1)), axes[:, 3:, None] * axes[:, None, 3:]
        hinge = turning[:, None, None]
        self._constant = self._fixed @ np.where(hinge, outer, np.eye(3))
        self._cosine = self._fixed @ np.where(hinge, np.eye(3) - outer, 0.0)
        self._sine = self._fixed @ cross_matrix(axes[:, 3:])
        self._slide = (self._fixed @ axes[:, :3, None])[..., 0]
        self._angle = turning & (self._at[0] == self._at[1])

    def place(self, q: Array) -> tuple[Array, Array]:
        """Place the joints that lead to a point; all joints if there are no points.

        Parameters
        ----------
        q : array (N, nq)
            Configurations, checked.

        Returns
        -------
        rotation : array (njoints, 3, 3, N)
        origin : array (njoints, 3, N)
            Metres, world.
        """
        columns = np.concatenate([q.T, np.zeros((1, len(q)))])  # a row for the universe if q is empty
        first, second = columns[self._at[0]], columns[self._at[1]]
        cos, sin = first.copy(), second.copy()  # of a continuous joint
        np.cos(first, out=cos, where=self._angle[:, None])
        np.sin(first, out=sin, where=self._angle[:, None])
        local = self._constant[..., None] + self._cosine[..., None] * cos[:, None, None]
        local += self._sine[..., None] * sin[:, None, None]
        shift = self._shift + self._slide[..., None] * first[:, None]
        for joint in self._special:
            turn, slide = _local(columns[self._at[0, joint] : self._at[1, joint] + 1])
            local[joint] = np.tensordot(self._fixed[joint], turn, 1)
            shift[joint] += self._fixed[joint] @ slide
        rotation, origin = np.zeros((*local.shape[:3], len(q))), np.zeros((len(local), 3, len(q)))
        rotation[0] = np.eye(3)[..., None]
        for joints, above in self._levels:
            R, own, step = rotation[above], local[joints], shift[joints]
            product = R[:, :, 0, None] * own[:, None, 0]
            product += R[:, :, 1, None] * own[:, None, 1]
            product += R[:, :, 2, None] * own[:, None, 2]
            rotation[joints] = product
            origin[joints] = origin[above] + (R * step[:, None]).sum(axis=2)
        return rotation, origin

    def positions(self, q: Array) -> Array:
        """Return the points (N, P, 3) of configurations (N, nq), metres, world."""
        out = np.empty((len(q), len(self._joint), 3))
        for start in range(0, len(q), BLOCK):
            rows = slice(start, start + BLOCK)
            out[rows] = self._points(*self.place(q[rows]))
        return out

    def jacobians(self, q: Array) -> tuple[Array, Array]:
        r"""Return the points (N, P, 3) and their derivatives (N, P, 3, nv) along `pinocchio.integrate`.

        A joint at origin o with rotation R moves a point p by :math:`R s_v + (R s_\omega) \times (p - o)` for each
        column s of its motion subspace (Featherstone 2008, §3.5).
        """
        rotation, origin = self.place(q)
        points = self._points(rotation, origin)
        R, o = rotation[self._of_v].transpose(3, 0, 1, 2), origin[self._of_v].transpose(2, 0, 1)
        linear = np.einsum("nvij,jv->nvi", R, self._subspace[:3])
        angular = np.einsum("nvij,jv->nvi", R, self._subspace[3:])
        arms = points[:, :, None] - o[:, None]
        moved = linear[:, None] + cross(np.broadcast_to(angular[:, None], arms.shape), arms)
        return points, np.swapaxes(moved * self._moves[..., None], 2, 3)

    def _points(self, rotation: Array, origin: Array) -> Array:
        turned = np.einsum("sijn,sj->nsi", rotation[self._joint], self._offset)
        return np.asarray(origin[self._joint].transpose(2, 0, 1) + turned)


def _local(entries: Array) -> tuple[Array, Array]:
    """Return the rotation (3, 3, N) and translation (3, N) of a floating or a planar joint."""
    if len(entries) == 7:
        return rotation_from_quaternion(entries[3:].T).transpose(1, 2, 0), entries[:3]
    x, y, cos, sin = entries
    none = np.zeros_like(x)
    return np.array([[cos, -sin, none], [sin, cos, none], [none, none, none + 1]]), np.array([x, y, none])


class Entry(NamedTuple):
    """An entry of q: its name, the joint's index, and its suffix (x, qx, cos, …) if the joint has several."""

    name: str
    joint: int
    suffix: str


def entries_of(model: pin.Model) -> list[Entry]:
    """List the entries of q. The seven of a floating root have no prefix: x, y, z, qx, qy, qz, qw."""
    entries = []
    for joint in range(1, model.njoints):
        suffixes, name = SUFFIXES.get(model.joints[joint].shortname(), ("",)), str(model.names[joint])
        root = joint == 1 and len(suffixes) == 7
        entries += [Entry(end if root else f"{name}.{end}" if end else name, joint, end) for end in suffixes]
    return entries
