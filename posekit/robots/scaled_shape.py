"""Collision and visual shapes under a linear map of the body that carries them."""

from __future__ import annotations

import coal
import numpy as np
import pinocchio as pin

from posekit.errors import InputError
from posekit.geometry import Array


def scale_object(body: pin.GeometryObject, linear: Array) -> None:
    """Move and stretch a geometry object, in place, as a linear map (3, 3) of its body's frame does.

    Meshes and boxes along their axes are mapped exactly; a capsule, cylinder or cone grows along its axis by what
    the map does there, its radius by the mean of the two others; a sphere by the mean of three.

    Raises
    ------
    InputError
        Where the shape is of another kind.
    """
    placement = body.placement
    across = placement.rotation.T @ linear @ placement.rotation
    body.placement = pin.SE3(placement.rotation, linear @ placement.translation)
    body.geometry = _scaled(body.geometry, across, body.name)
    body.meshScale = body.meshScale * np.linalg.norm(across, axis=0)


def _scaled(shape: coal.CollisionGeometry, linear: Array, name: str) -> coal.CollisionGeometry:
    x, y, z = np.linalg.norm(linear, axis=0)
    radial = float(np.sqrt(x * y))
    if isinstance(shape, coal.Capsule | coal.Cylinder | coal.Cone):
        return type(shape)(shape.radius * radial, 2 * shape.halfLength * z)
    if isinstance(shape, coal.Sphere):
        return coal.Sphere(shape.radius * float(np.cbrt(x * y * z)))
    if isinstance(shape, coal.Box):
        side = 2 * np.asarray(shape.halfSide) * (x, y, z)
        return coal.Box(float(side[0]), float(side[1]), float(side[2]))
    if isinstance(shape, coal.Ellipsoid):
        radii = np.asarray(shape.radii) * (x, y, z)
        return coal.Ellipsoid(float(radii[0]), float(radii[1]), float(radii[2]))
    if isinstance(shape, coal.BVHModelBase):
        return _scaled_mesh(shape, linear)
    raise InputError(
        f"geometry {name!r} is a {type(shape).__name__}; expected a capsule, cylinder, cone, sphere, box, ellipsoid "
        "or mesh; remove it before scaling"
    )


def _scaled_mesh(shape: coal.BVHModelBase, linear: Array) -> coal.BVHModelBase:
    triangles = np.array(
        [[index[0], index[1], index[2]] for index in map(shape.tri_indices, range(shape.num_tris))],
        dtype=np.uint64,
    ).reshape(-1, 3)
    mesh = type(shape)()
    mesh.beginModel(shape.num_tris, shape.num_vertices)
    mesh.addVertices(np.asarray(shape.vertices()) @ linear.T)
    mesh.addTriangles(triangles)
    mesh.endModel()
    return mesh
