"""Self-collision: the pairs of bodies that are checked, and queries for batches of configurations."""

from __future__ import annotations

import re
from collections.abc import Collection
from typing import Final, NamedTuple

import coal
import numpy as np
import pinocchio as pin

from posekit.errors import cut
from posekit.geometry import Array, Flags, Ints, segment_distance
from posekit.robots.kinematics import Kinematics, Site
from posekit.robots.urdf import need, parse_xml
from posekit.skeleton import PARTS

#: Number of body pairs processed in one block, whose data stay in the processor's cache; minimum number of
#: configurations in one block, so that NumPy's overhead is shared.
PAIRS_AT_ONCE, LEAST_AT_ONCE = 20_000, 128
#: Margin added to bodies in tests that exclude contact, metres. It exceeds the tolerance of coal's GJK.
ROOM: Final = 1e-6
#: Tolerance of penetration depths, metres.
DEPTH: Final = 1e-5
#: Shapes whose distances have a closed form.
ROUND: Final = coal.Sphere | coal.Capsule
#: Ratio of a mesh's smallest extent to its size below which the mesh is flat (dimensionless).
FLAT: Final = 1e-6


def set_pairs(
    model: pin.Model, geometry: pin.GeometryModel, neutral: Array, parts: Collection[tuple[str, str]]
) -> None:
    """Choose the pairs of bodies to check for a robot whose SRDF disables no pair.

    Pairs of neighbouring bodies, and pairs that touch in the neutral configuration, are not checked. A pair of capsules
    on body parts is checked only if the stick figure checks the same pair: `parts` has the stick figure's pairs.
    """
    checked_parts = {frozenset(map(_part, pair)) for pair in parts}
    pairs, bodies = [(pair.first, pair.second) for pair in geometry.collisionPairs], geometry.geometryObjects
    joints, names = [body.parentJoint for body in bodies], [_part(body.name) for body in bodies]
    # A body's neighbour is the nearest body toward the root: for a thigh the pelvis, even if the hip has three hinges.
    above = {joint: set(list(model.supports[joint])[:-1]).intersection(joints) for joint in joints}
    near = [{joint, max(carriers, default=0)} for joint, carriers in above.items()]
    data, geometry_data = model.createData(), geometry.createData()
    pin.computeCollisions(model, data, geometry, geometry_data, neutral, False)
    geometry.removeAllCollisionPairs()
    for (a, b), result in zip(pairs, geometry_data.collisionResults, strict=True):
        ends, joined = frozenset((names[a], names[b])), {joints[a], joints[b]}
        wanted = ends in checked_parts if parts and ends <= PARTS.keys() else joined not in near
        if wanted and not result.isCollision():
            geometry.addCollisionPair(pin.CollisionPair(a, b))


def _part(body: str) -> str:
    """Return the part of the figure that a body represents: the body's name without the number at its end."""
    return re.sub(r"_\d+$", "", body)


def disable_pairs(model: pin.Model, geometry: pin.GeometryModel, srdf: str, source: str) -> bool:
    """Remove the pairs of links that an SRDF disables. Return whether the SRDF disables any pair.

    Links that the robot lacks are ignored, because variants of a published robot share an SRDF.

    Raises
    ------
    InputError
        If the text is no SRDF, or the robot has no link that the SRDF names.
    """
    root = parse_xml(srdf, source)
    need(source, root.tag == "robot", "", f"the root element <{cut(root.tag)}>", "<robot>", "name an SRDF")
    links = [one.get(end, "") for one in root.findall("disable_collisions") for end in ("link1", "link2")]
    known = not links or any(map(model.existBodyName, links))
    got, expected = f"only unknown links ({cut(', '.join(links))})", "links of the robot"
    need(source, known, "<disable_collisions>", got, expected, "name this robot's SRDF")
    pin.removeCollisionPairsFromXML(model, geometry, srdf)
    return bool(links)


class Contacts(NamedTuple):
    """Collisions of N configurations.

    Attributes
    ----------
    hit : bool array (N,)
        Whether any pair touches; equal to the result of `pinocchio.computeCollisions`.
    frame, pair : int arrays (K,)
        Index of the configuration and index of the pair, for each pair nearer than the margin; sorted by configuration.
    distance : array (K,)
        Signed distance in metres, negative for penetration. For meshes that touch, it is the penetration depth of their
        convex hulls, an upper bound of the meshes' depth. For meshes that do not touch, it is the distance of their
        convex hulls, a lower bound. If these hulls overlap, it is the distance of the meshes.
    """

    hit: Flags
    frame: Ints
    pair: Ints
    distance: Array


class SelfCollision:
    """Self-collision queries for configurations of one robot model.

    NumPy excludes pairs whose bounding balls or bounding boxes do not overlap (Gottschalk, Lin and Manocha 1996, §5),
    and measures capsules and spheres exactly. The collision library coal tests the convex hulls of the remaining pairs,
    and the meshes of a pair only if its hulls touch.

    Parameters
    ----------
    model : pinocchio.Model
    geometry : pinocchio.GeometryModel
        Bodies and the pairs to check.
    """

    def __init__(self, model: pin.Model, geometry: pin.GeometryModel) -> None:
        self.model, self._meshes, self._hulls = model, geometry, geometry.copy()
        bodies = list(self._hulls.geometryObjects)
        for body in bodies:
            if isinstance(body.geometry, coal.BVHModelBase):
                body.geometry = _hull(body.geometry)
        shapes, places = [body.geometry for body in bodies], [body.placement for body in bodies]
        rounded = np.array([isinstance(one, ROUND) for one in shapes], dtype=np.bool_)
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
        """Return the pairs of bodies that are nearer to each other than a margin.

        Parameters
        ----------
        q : array (N, nq)
            Configurations that `Robot.checked` has accepted.
        margin : float
            Metres, at least 0; only touching pairs by default.
        """
        step = max(PAIRS_AT_ONCE // max(len(self._reach), 1), LEAST_AT_ONCE)
        starts = range(0, max(len(q), 1), step)
        blocks = [self._near(q[start : start + step], margin) for start in starts]
        row, pair, distance = (np.concatenate(parts) for parts in zip(*blocks, strict=True))
        row += np.repeat(starts, [len(rows) for rows, _, _ in blocks])
        self._measure(q, row, pair, distance, margin)
        kept, hit = distance <= margin, np.zeros(len(q), dtype=np.bool_)
        hit[row[distance <= 0]] = True
        return Contacts(hit, row[kept], pair[kept], distance[kept])

    def _near(self, q: Array, margin: float) -> tuple[Ints, Ints, Array]:
        """Return indices of configurations and pairs that may be nearer than the margin, and distances or NaN."""
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
        """Replace NaN in `distance` by distances from coal; without a margin, pairs that do not touch stay NaN."""
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
    """Return the convex hull of a mesh, or the mesh itself if it is flat: coal has no hulls of flat meshes."""
    vertices = np.array(mesh.vertices())
    if np.linalg.matrix_rank(vertices - vertices.mean(axis=0), tol=FLAT * np.abs(vertices).max()) < 3:
        return mesh
    try:
        mesh.buildConvexHull(True, "Qt")
    except RuntimeError:  # of qhull
        return mesh
    return mesh.convex


def _box(shape: coal.CollisionGeometry) -> tuple[Array, Array, float]:
    """Return a shape's bounding box along its axes (centre, half sides) and the radius of a bounding ball, metres."""
    shape.computeLocalAABB()
    low, high = np.ravel(shape.aabb_local.min_), np.ravel(shape.aabb_local.max_)
    centre, half = (low + high) / 2, (high - low) / 2
    if isinstance(shape, ROUND):
        return centre, half, float(half.max())
    if isinstance(shape, coal.ConvexBase):
        points = np.array([shape.point(k) for k in range(shape.num_points)])
        return centre, half, float(np.linalg.norm(points - centre, axis=1).max())
    return centre, half, float(np.linalg.norm(half))
