"""Batched forward kinematics of a Pinocchio model: positions and Jacobians of points that are fixed to its joints."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from posekit.geometry import Array, cross, rotation_from_quaternion

#: Number of configurations processed in one block, so that their rotations stay in the processor's cache.
BLOCK: Final = 256

#: Suffixes of a joint's entries of q, by the number of entries: a floating, a planar and a continuous joint.
SUFFIXES: Final = {
    7: ("x", "y", "z", "qx", "qy", "qz", "qw"),
    4: ("x", "y", "cos", "sin"),
    2: ("cos", "sin"),
}


class Site(NamedTuple):
    """A point fixed to a joint: the joint's index, and the point's offset (3,) in the joint's frame, metres."""

    joint: int
    offset: ArrayLike


class Kinematics:
    """Batched positions and Jacobians of points that are fixed to the joints of a model.

    The results equal Pinocchio's `forwardKinematics` and joint Jacobians up to rounding, at about 30 times the speed of
    a loop over configurations. Internal arrays have the batch as their last dimension, and the rows of a rotation are
    the frame's axes x, y, z. Internally, the frame of each joint is chosen so that the joint rotates about z or slides
    along z. A hinge then changes only the axes x and y.

    Parameters
    ----------
    model : pinocchio.Model
        Joints may be revolute, continuous, prismatic, planar and floating.
    points : sequence of Site
        The points. Joints that no point depends on are not computed.
    """

    def __init__(self, model: pin.Model, points: Sequence[Site]) -> None:
        self._joint = np.array([site.joint for site in points], dtype=np.intp)
        above = [list(joints) for joints in model.supports]  # from the universe to the joint
        needed = {joint for site in points for joint in above[site.joint]}
        levels = [[j for j in needed if len(above[j]) == depth] for depth in range(2, model.njoints + 1)]
        self._levels = [(np.array(js), [model.parents[j] for j in js]) for js in levels if js]
        self._of_v = np.repeat(np.arange(model.njoints), list(model.nvs))
        self._moves = np.array([np.isin(self._of_v, above[joint]) for joint in self._joint])
        self._subspace = np.zeros((2, 3, model.nv))  # linear and angular
        self._at, self._special = np.zeros((2, model.njoints), dtype=np.intp), set[int]()
        slides, turns = np.zeros((2, model.njoints), dtype=np.bool_)
        frames, self._mix = np.tile(np.eye(3), (model.njoints, 1, 1)), np.zeros((model.njoints, 4, 3))
        for joint in sorted(needed)[1:]:
            data, first, count = model.joints[joint].createData(), model.idx_vs[joint], model.nvs[joint]
            model.joints[joint].calc(data, pin.neutral(model))
            moved = np.asarray(data.S).reshape(2, 3, -1)
            self._at[:, joint] = model.idx_qs[joint], model.idx_qs[joint] + model.nqs[joint] - 1
            if count > 1:
                self._special.add(joint)
            else:
                slides[joint], turns[joint] = (bool(part.any()) for part in moved)
                axis = moved.sum(axis=(0, 2))
                frames[joint] = pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), axis).matrix()
            self._subspace[:, :, first : first + count] = frames[joint].T @ moved
            M = model.jointPlacements[joint]
            self._mix[joint] = _mix(frames[model.parents[joint]], M.translation, M.rotation @ frames[joint])
        self._angle, self._slides = turns & (self._at[0] == self._at[1]), slides
        self._sites = np.array(
            [_mix(frames[joint], np.array(offset), np.eye(3)) for joint, offset in points]
        ).reshape(-1, 4, 3)

    def place(self, q: Array) -> tuple[Array, Array]:
        """Return the positions of the points, and the axes of their joints.

        Parameters
        ----------
        q : array (N, nq)
            Configurations, checked.

        Returns
        -------
        axes : array (3, P, 3, N)
            The axes x, y, z of the joint of each point.
        points : array (P, 3, N)
            Metres, world.
        """
        axes, origin = self._frames(q)
        *turned, offset = _mixed(self._sites, axes[self._joint])
        return np.asarray(turned), origin[self._joint] + offset

    def positions(self, q: Array) -> Array:
        """Return the points (N, P, 3) of configurations (N, nq), metres, world."""
        out = np.empty((len(q), len(self._joint), 3))
        for start in range(0, len(q), BLOCK):
            rows = slice(start, start + BLOCK)
            out[rows] = self.place(q[rows])[1].transpose(2, 0, 1)
        return out

    def jacobians(self, q: Array) -> tuple[Array, Array]:
        r"""Return the points (N, P, 3) and their derivatives (N, P, 3, nv) with respect to v in `pinocchio.integrate`.

        A joint at origin o with rotation R moves a point p by :math:`R s_v + (R s_\omega) \times (p - o)` for each
        column s of its motion subspace (Featherstone 2008, §3.5).
        """
        axes, origin = self._frames(q)
        points = (origin[self._joint] + _mixed(self._sites, axes[self._joint])[3]).transpose(2, 0, 1)
        linear, angular = np.einsum("vcin,kcv->knvi", axes[self._of_v], self._subspace)
        arms = points[:, :, None] - origin[self._of_v].transpose(2, 0, 1)[:, None]
        moved = linear[:, None] + cross(angular[:, None], arms)
        return points, np.swapaxes(moved * self._moves[..., None], 2, 3)

    def _frames(self, q: Array) -> tuple[Array, Array]:
        """Return the axes (njoints, 3, 3, N) and origins (njoints, 3, N) of the joints that points depend on."""
        columns = np.concatenate([q.T, np.zeros((1, len(q)))])  # the last row serves the universe if nq is 0
        first, second = columns[self._at]
        cos, sin = first.copy(), second.copy()  # entries of a continuous joint
        cos[self._angle], sin[self._angle] = np.cos(first[self._angle]), np.sin(first[self._angle])
        cos[self._slides], sin[self._slides] = 1.0, 0.0
        axes, origin = np.zeros((len(first), 3, 3, len(q))), np.zeros((len(first), 3, len(q)))
        axes[0] = np.eye(3)[..., None]
        for joints, above in self._levels:
            x, y, z, shift = _mixed(self._mix[joints], axes[above])
            c, s = cos[joints, None], sin[joints, None]
            axes[joints, 0] = c * x + s * y
            axes[joints, 1] = c * y - s * x
            axes[joints, 2] = z
            origin[joints] = origin[above] + shift
            for k, joint in enumerate(joints.tolist()):
                if self._slides[joint]:
                    origin[joint] += first[joint] * z[k]
                elif joint in self._special:
                    turn, slide = _local(columns[self._at[0, joint] : self._at[1, joint] + 1])
                    frame = np.array([x[k], y[k], z[k]])
                    axes[joint] = np.einsum("kcn,kin->cin", turn, frame)
                    origin[joint] += np.einsum("kn,kin->in", slide, frame)
        return axes, origin


def frame_places(model: pin.Model, q: Array, frames: Sequence[int]) -> Array:
    """Return the origins (N, K, 3) of K frames of a model at configurations (N, nq), metres, world."""
    placed = [model.frames[k] for k in frames]
    sites = [Site(one.parentJoint, one.placement.translation) for one in placed]
    return Kinematics(model, sites).positions(q)


def _mix(parent: Array, translation: Array, rotation: Array) -> Array:
    """Return the axes x, y, z and the origin of a frame (4, 3) in the chosen axes of its parent.

    `rotation` (3, 3) and `translation` (3,), metres, are the frame's pose in its parent. The rotation `parent` (3, 3)
    maps the chosen axes of the parent to the parent's frame.
    """
    return np.vstack([rotation.T, translation]) @ parent


def _mixed(mix: Array, axes: Array) -> Array:
    """Rotate axes and offsets (K, 4, 3) of K frames from their parents' axes (3, K, 3, N) to the world."""
    flat = mix @ axes.reshape(len(mix), 3, axes.shape[2] * axes.shape[3])
    return np.asarray(flat.reshape(len(mix), 4, *axes.shape[2:]).transpose(1, 0, 2, 3))


def _local(entries: Array) -> tuple[Array, Array]:
    """Return the rotation (3, 3, N) and translation (3, N) of a floating or a planar joint."""
    if len(entries) == 7:
        return rotation_from_quaternion(entries[3:].T).transpose(1, 2, 0), entries[:3]
    x, y, cos, sin = entries
    none = np.zeros_like(x)
    return np.array([[cos, -sin, none], [sin, cos, none], [none, none, none + 1]]), np.array([x, y, none])


class Entry(NamedTuple):
    """An entry of q: its name, the joint's index, its suffix (x, qx, cos, …) if the joint has several, and its unit."""

    name: str
    joint: int
    suffix: str
    unit: str


def entries_of(model: pin.Model) -> list[Entry]:
    """List the entries of q. The entries of a floating root have no prefix: x, y, z, qx, qy, qz, qw."""
    entries = []
    for joint in range(1, model.njoints):
        kind, name = model.joints[joint].shortname(), str(model.names[joint])
        suffixes = SUFFIXES.get(model.nqs[joint], ("",))
        prefix = "" if joint == 1 and len(suffixes) == 7 else name
        units = {"": "m" if kind.startswith("JointModelP") else "rad", **dict.fromkeys("xyz", "m")}
        for end in suffixes:
            entries.append(Entry(".".join(filter(None, (prefix, end))), joint, end, units.get(end, "")))
    return entries
