"""Forward kinematics of a Pinocchio model for a batch of configurations, and the points of a joint map."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np
import pinocchio as pin

from posekit.geometry import Array, cross, rotation_from_quaternion

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
    """A place on a body: a joint's index, metres in the joint's frame, and the share in its point."""

    joint: int
    offset: tuple[float, float, float]
    share: float


class Kinematics:
    """Places joints and points for a batch of configurations.

    Equal to Pinocchio's `forwardKinematics` and joint Jacobians up to rounding, about 20 times faster per
    configuration than a loop over them. Arrays inside have the batch as their last axis.

    Parameters
    ----------
    model : pinocchio.Model
        Joints may be revolute, continuous, prismatic, planar and floating.
    points : sequence of sequences of Site
        The places of each point; a point is the weighted mean of its places.
    """

    def __init__(self, model: pin.Model, points: Sequence[Sequence[Site]] = ()) -> None:
        self.model = model
        self.parents = [int(parent) for parent in model.parents]
        sites = [site for point in points for site in point]
        self._site_joint = np.array([site.joint for site in sites], dtype=np.intp)
        self._site_offset = np.array([site.offset for site in sites]).reshape(-1, 3)
        self._shares = np.zeros((len(points), len(sites)))
        of_site = [index for index, point in enumerate(points) for _ in point]
        self._shares[of_site, np.arange(len(sites))] = [site.share for site in sites]
        self._subspace = np.zeros((6, model.nv))
        self._dof_joint = np.zeros(model.nv, dtype=np.intp)
        moved = np.zeros((model.njoints, model.nv), dtype=np.bool_)
        for joint in range(1, model.njoints):
            own = slice(model.idx_vs[joint], model.idx_vs[joint] + model.nvs[joint])
            data = model.joints[joint].createData()
            model.joints[joint].calc(data, pin.neutral(model))
            self._subspace[:, own] = np.asarray(data.S).reshape(6, -1)
            self._dof_joint[own] = joint
            moved[joint] = moved[self.parents[joint]]
            moved[joint, own] = True
        self._moves = moved[self._site_joint]
        needed = set(range(1, model.njoints)) if not sites else set[int]()
        for joint in self._site_joint:
            above = int(joint)
            while above and above not in needed:
                needed.add(above)
                above = self.parents[above]
        self._prepare(needed)

    def _prepare(self, needed: set[int]) -> None:
        """Write each hinge as R = A + sin S + cos C after its placement, and group the needed joints by depth."""
        model = self.model
        placements = list(model.jointPlacements)
        self._fixed = np.array([M.rotation for M in placements])
        self._shift = np.array([M.translation for M in placements])[..., None]
        self._constant, self._cosine = self._fixed.copy(), np.zeros((model.njoints, 3, 3))
        self._sine, self._slide = np.zeros((model.njoints, 3, 3)), np.zeros((model.njoints, 3))
        self._at = np.zeros((2, model.njoints), dtype=np.intp)
        self._angle = np.zeros(model.njoints, dtype=np.bool_)
        self._special: list[int] = []
        depth = [0] * model.njoints
        for joint in range(1, model.njoints):
            depth[joint] = depth[self.parents[joint]] + 1
            self._at[:, joint] = model.idx_qs[joint], model.idx_qs[joint] + model.nqs[joint] - 1
            axis = self._subspace[:, model.idx_vs[joint]]
            if model.nvs[joint] > 1:
                self._special.append(joint)
            elif axis[3:].any():
                outer = np.outer(axis[3:], axis[3:])
                self._constant[joint] = self._fixed[joint] @ outer
                self._cosine[joint] = self._fixed[joint] @ (np.eye(3) - outer)
                self._sine[joint] = self._fixed[joint] @ cross(np.eye(3), axis[3:])
                self._angle[joint] = model.nqs[joint] == 1
            else:
                self._slide[joint] = self._fixed[joint] @ axis[:3]
        self._levels = [
            np.array([joint for joint in sorted(needed) if depth[joint] == level], dtype=np.intp)
            for level in range(1, max(depth) + 1)
        ]

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
            entries = columns[self._at[0, joint] : self._at[1, joint] + 1]
            turn, slide = _local(entries)
            local[joint] = np.tensordot(self._fixed[joint], turn, 1)
            shift[joint] += self._fixed[joint] @ slide
        rotation, origin = np.zeros((*local.shape[:3], len(q))), np.zeros((len(local), 3, len(q)))
        rotation[0] = np.eye(3)[..., None]
        for joints in self._levels:
            above = [self.parents[joint] for joint in joints]
            R, own, step = rotation[above], local[joints], shift[joints]
            product = R[:, :, 0, None] * own[:, None, 0]
            product += R[:, :, 1, None] * own[:, None, 1]
            product += R[:, :, 2, None] * own[:, None, 2]
            rotation[joints] = product
            origin[joints] = origin[above] + (R * step[:, None]).sum(axis=2)
        return rotation, origin

    def positions(self, q: Array) -> Array:
        """Return the points (N, P, 3) of configurations (N, nq), metres, world."""
        out = np.empty((len(q), len(self._shares), 3))
        for start in range(0, len(q), BLOCK):
            rows = slice(start, start + BLOCK)
            sites = self._sites(*self.place(q[rows]))
            out[rows] = np.tensordot(self._shares, sites, 1).transpose(2, 0, 1)
        return out

    def jacobians(self, q: Array) -> tuple[Array, Array]:
        r"""Return the points (N, P, 3) and their derivatives (N, P, 3, nv) along `pinocchio.integrate`.

        A joint at origin o with rotation R moves a point p by :math:`R s_v + (R s_\omega) \times (p - o)` for each
        column s of its motion subspace (Featherstone 2008, §3.5).
        """
        rotation, origin = self.place(q)
        sites = self._sites(rotation, origin).transpose(2, 0, 1)
        R, o = rotation[self._dof_joint].transpose(3, 0, 1, 2), origin[self._dof_joint].transpose(2, 0, 1)
        linear = np.einsum("nvij,jv->nvi", R, self._subspace[:3])
        angular = np.einsum("nvij,jv->nvi", R, self._subspace[3:])
        arms = sites[:, :, None] - o[:, None]
        moved = linear[:, None] + cross(np.broadcast_to(angular[:, None], arms.shape), arms)
        moved *= self._moves[..., None]
        return (
            np.einsum("ps,nsi->npi", self._shares, sites),
            np.asarray(np.einsum("ps,nsvi->npiv", self._shares, moved, optimize=True)),
        )

    def _sites(self, rotation: Array, origin: Array) -> Array:
        joints = self._site_joint
        return np.asarray(origin[joints] + np.einsum("sijn,sj->sin", rotation[joints], self._site_offset))


def _local(entries: Array) -> tuple[Array, Array]:
    """Return the rotation (3, 3, N) and translation (3, N) of a floating or a planar joint."""
    if len(entries) == 7:
        return _matrix(entries[3:]), entries[:3]
    x, y, cos, sin = entries
    none = np.zeros_like(x)
    return np.array([[cos, -sin, none], [sin, cos, none], [none, none, none + 1]]), np.array([x, y, none])


def configuration_names(model: pin.Model) -> tuple[str, ...]:
    """Name each entry of q: the joint's name, with a suffix such as ``.cos`` for joints of several entries.

    The seven entries of a floating root have no prefix: x, y, z, qx, qy, qz, qw.
    """
    names: list[str] = []
    for joint in range(1, model.njoints):
        suffixes = SUFFIXES.get(model.joints[joint].shortname(), ("",))
        root = joint == 1 and len(suffixes) == 7
        name = model.names[joint]
        names += [end if root else f"{name}.{end}" if end else name for end in suffixes]
    return tuple(names)


def rotation_entries(model: pin.Model) -> list[tuple[int, int, str]]:
    """List the entries of q that are a unit quaternion, or a cosine and a sine: first, last + 1, joint's name."""
    found = []
    for joint in range(1, model.njoints):
        suffixes = SUFFIXES.get(model.joints[joint].shortname(), ())
        turning = [k for k, end in enumerate(suffixes) if end not in ("x", "y", "z")]
        if turning:
            at = int(model.idx_qs[joint])
            found.append((at + turning[0], at + turning[-1] + 1, str(model.names[joint])))
    return found


def _matrix(quaternion: Array) -> Array:
    return np.ascontiguousarray(rotation_from_quaternion(quaternion.T).transpose(1, 2, 0))
