"""Self-collision for batches of configurations: bounding capsules, then convex hulls, then the bodies themselves."""

from __future__ import annotations

from typing import Final, NamedTuple

import coal
import numpy as np
import pinocchio as pin

from posekit.geometry import Array, Flags, Ints, segment_distance
from posekit.robots.kinematics import Kinematics, Site

#: Number of pairs of bodies that are measured at once and stay in the processor's cache, and least number of
#: configurations, which spreads NumPy's overhead.
PAIRS_AT_ONCE, LEAST_AT_ONCE = 20_000, 128
#: Metres that hulls and capsules are taken larger, above the tolerance of coal's GJK.
ROOM: Final = 1e-6
#: Metres within which the depth of a penetration is computed.
DEPTH: Final = 1e-5
#: Least extent of a mesh over its size below which it is flat.
FLAT: Final = 1e-6


class Contacts(NamedTuple):
    """Collisions of N configurations.

    Attributes
    ----------
    hit : bool array (N,)
        Whether any pair touches, as `pinocchio.computeCollisions` has it.
    frame, pair : int arrays (K,)
        Row of the configuration and index of the pair, for each pair nearer than the margin; sorted.
    distance : array (K,)
        Signed distance in metres, negative for penetration. Two meshes have the distance or the depth of their
        convex hulls: they are at least so far apart, and at most so deep in each other. If the hulls overlap and
        the meshes do not touch, it is the distance of the meshes.
    """

    hit: Flags
    frame: Ints
    pair: Ints
    distance: Array


class SelfCollision:
    """Collision queries of one model.

    Pairs that keep apart are recognised in NumPy by the balls and the boxes around the bodies (Gottschalk, Lin and
    Manocha 1996, §5); two capsules or spheres are measured there exactly. The other pairs are tested by their convex
    hulls, and by their meshes only if these touch.

    Parameters
    ----------
    model : pinocchio.Model
    geometry : pinocchio.GeometryModel
        Bodies and the pairs to check.
    """

    def __init__(self, model: pin.Model, geometry: pin.GeometryModel) -> None:
        self.model, self._meshes, self._hulls = model, geometry, geometry.copy()
        bodies = list(self._hulls.geometryObjects)
        hulls: dict[int, coal.CollisionGeometry] = {}
        for body in bodies:
            if isinstance(body.geometry, coal.BVHModelBase):
                key = body.geometry.id()
                hulls[key] = hulls[key] if key in hulls else _hull(body.geometry)
                body.geometry = hulls[key]
        shapes, places = [body.geometry for body in bodies], [body.placement for body in bodies]
        rounded = np.array([isinstance(one, coal.Sphere | coal.Capsule) for one in shapes], dtype=np.bool_)
        self._half = rounded * np.array([getattr(one, "halfLength", 0.0) for one in shapes])
        boxes = [_box(one) for one in shapes]
        self._axes = np.array([M.rotation for M in places]).reshape(-1, 3, 3)
        centres = [M.act(centre) for M, (centre, _, _) in zip(places, boxes, strict=True)]
        sites = [Site(body.parentJoint, at) for body, at in zip(bodies, centres, strict=True)]
        self._kinematics = Kinematics(model, sites)
        self._size = np.array([half for _, half, _ in boxes]).reshape(-1, 3)
        radius = np.array([ball for _, _, ball in boxes])
        pairs = np.array([(pair.first, pair.second) for pair in geometry.collisionPairs], dtype=np.intp)
        self._first, self._second = pairs.reshape(-1, 2).T
        self._reach = radius[self._first] + radius[self._second]
        self._exact = rounded[self._first] & rounded[self._second]
        self._data, self._mesh_data = model.createData(), geometry.createData()
        self._hull_data = self._hulls.createData()
        for request in self._hull_data.collisionRequests:
            request.security_margin = ROOM
            request.enable_contact = True  # computes the depth
            request.epa_tolerance = DEPTH

    def contacts(self, q: Array, margin: float = 0.0) -> Contacts:
        """Return the pairs nearer than a margin.

        Parameters
        ----------
        q : array (N, nq)
            Configurations, checked.
        margin : float
            Metres, at least 0; only touching pairs by default.
        """
        rows, pairs, distances = [np.zeros(0, np.intp)], [np.zeros(0, np.intp)], [np.zeros(0)]
        step = max(PAIRS_AT_ONCE // max(len(self._reach), 1), LEAST_AT_ONCE)
        for start in range(0, len(q), step):
            row, pair, distance = self._near(q[start : start + step], margin)
            self._measure(q[start : start + step], row, pair, distance, margin)
            kept = distance <= margin
            rows.append(row[kept] + start)
            pairs.append(pair[kept])
            distances.append(distance[kept])
        frame, found = np.concatenate(rows), np.concatenate(distances)
        hit = np.zeros(len(q), dtype=np.bool_)
        hit[frame[found <= 0]] = True
        return Contacts(hit, frame, np.concatenate(pairs), found)

    def _near(self, q: Array, margin: float) -> tuple[Ints, Ints, Array]:
        """Return the pairs that can be nearer than the margin: rows, pairs, and distances of capsules, else NaN."""
        frames, centre = self._kinematics.place(q)
        axes = np.einsum("jbin,bjk->ikbn", frames, self._axes).reshape(3, 3, -1)
        places, count = centre.transpose(1, 0, 2), len(q)
        gap = places[:, self._second] - places[:, self._first]
        reach = (self._reach + margin + ROOM) ** 2
        row, pair = np.nonzero((np.einsum("ipn,ipn->pn", gap, gap) <= reach[:, None]).T)
        gap = gap.reshape(3, -1).take(pair * count + row, axis=1)
        a, b, exact = self._first[pair], self._second[pair], self._exact[pair]
        near, distance = np.ones(len(row), dtype=np.bool_), np.full(len(row), np.nan)
        i, j, n = a[exact], b[exact], row[exact]
        half_a, half_b = (self._half[k] * axes[:, 2].take(k * count + n, axis=1) for k in (i, j))
        between = segment_distance(gap[:, exact].T, half_a.T, half_b.T)
        distance[exact] = between - self._size[i, 0] - self._size[j, 0]
        near[exact] = distance[exact] <= margin
        i, j, n = a[~exact], b[~exact], row[~exact]
        (A, B), t = (axes.take(k * count + n, axis=2) for k in (i, j)), gap[:, ~exact]
        A_B = np.abs(A[0][:, None] * B[0] + A[1][:, None] * B[1] + A[2][:, None] * B[2])
        size_A, size_B = self._size.T[:, i], self._size.T[:, j]
        gap_A = np.abs(np.einsum("kin,kn->in", A, t)) - np.einsum("ijn,jn->in", A_B, size_B) - size_A
        gap_B = np.abs(np.einsum("kjn,kn->jn", B, t)) - np.einsum("ijn,in->jn", A_B, size_A) - size_B
        near[~exact] = np.maximum(gap_A, gap_B).max(axis=0) <= margin + ROOM
        return row[near], pair[near], distance[near]

    def _measure(self, q: Array, row: Ints, pair: Ints, distance: Array, margin: float) -> None:
        """Fill in the distances that are NaN and within the margin, with coal."""
        model, data, meshes, mesh_data = self.model, self._data, self._meshes, self._mesh_data
        hulls, hull_data = self._hulls, self._hull_data
        rows, pairs, placed, placed_meshes = row.tolist(), pair.tolist(), -1, -1
        for k in np.flatnonzero(np.isnan(distance)).tolist():
            n, p = rows[k], pairs[k]
            if n != placed:
                pin.forwardKinematics(model, data, q[n])
                pin.updateGeometryPlacements(model, data, hulls, hull_data)
                placed = n
            if not pin.computeCollision(hulls, hull_data, p):
                if margin > 0:
                    distance[k] = max(pin.computeDistance(hulls, hull_data, p).min_distance, ROOM)
                continue
            if n != placed_meshes:
                pin.updateGeometryPlacements(model, data, meshes, mesh_data)
                placed_meshes = n
            if pin.computeCollision(meshes, mesh_data, p):
                distance[k] = min(hull_data.collisionResults[p].distance_lower_bound + ROOM, -ROOM)
            elif margin > 0:
                distance[k] = max(pin.computeDistance(meshes, mesh_data, p).min_distance, ROOM)


def _hull(mesh: coal.BVHModelBase) -> coal.CollisionGeometry:
    """Return the convex hull of a mesh; the mesh itself if it is flat, for which coal has none."""
    vertices = np.array(mesh.vertices())
    if np.linalg.matrix_rank(vertices - vertices.mean(axis=0), tol=FLAT * np.abs(vertices).max()) < 3:
        return mesh
    try:
        mesh.buildConvexHull(True, "Qt")
    except RuntimeError:  # of qhull
        return mesh
    return mesh.convex


def _box(shape: coal.CollisionGeometry) -> tuple[Array, Array, float]:
    """Return a box along a shape's axes: centre, half sides; and the radius of a ball about its centre."""
    shape.computeLocalAABB()
    low, high = np.ravel(shape.aabb_local.min_), np.ravel(shape.aabb_local.max_)
    centre, half = (low + high) / 2, (high - low) / 2
    if isinstance(shape, coal.Sphere | coal.Capsule):
        return centre, half, float(half.max())
    if isinstance(shape, coal.ConvexBase):
        points = np.array([shape.point(k) for k in range(shape.num_points)])
        return centre, half, float(np.linalg.norm(points - centre, axis=1).max())
    return centre, half, float(np.linalg.norm(half))
