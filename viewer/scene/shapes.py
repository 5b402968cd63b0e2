"""The simple shapes of a scene: balls, tubes, sheets and the materials they are drawn with."""

from __future__ import annotations

import base64
from typing import Any

import meshcat.geometry as mg
import numpy as np
from numpy.typing import NDArray

from posekit.geometry import Array, cross
from posekit.viewer.scene.colours import Rgb, number
from posekit.viewer.scene.scene import Json, Scene

UNIT_BALL = mg.Sphere(1.0)
"""Every ball is this one, scaled: one geometry for all."""

N_TUBE_SIDES = 10
"""Sides of a tube."""


def matte(colour: Rgb, opacity: float = 1.0) -> mg.MeshLambertMaterial:
    """Return the material of solid things."""
    return mg.MeshLambertMaterial(color=number(colour), side=0, **_translucent(opacity))


def glow(colour: Rgb, opacity: float = 1.0, *, vertex_colours: bool = False) -> mg.MeshBasicMaterial:
    """Return a material that no light and no shadow changes: its pixels have exactly this colour."""
    return mg.MeshBasicMaterial(
        color=number(colour), side=2, vertexColors=vertex_colours, **_translucent(opacity)
    )


def _translucent(opacity: float) -> dict[str, Any]:
    # What is translucent does not hide what is behind it.
    return {} if opacity >= 1 else {"opacity": opacity, "transparent": True, "depthWrite": False}


def add_ball(scene: Scene, path: str, middle: Array, radius: float, material: mg.Material) -> None:
    """Put a ball (metres, world) at `path`; where its middle is not known it is invisible."""
    node = scene.meshcat[path]
    node.set_object(mg.Mesh(UNIT_BALL, material))
    matrix = np.diag([radius, radius, radius, 1.0])
    matrix[:3, 3] = middle
    node.set_transform(matrix)


def add_tubes(
    scene: Scene,
    path: str,
    starts: Array,
    ends: Array,
    colours: Array,
    *,
    radius: float,
    opacity: float = 1.0,
) -> None:
    """Put straight tubes at `path` as one mesh; those of which an end is not known are left out.

    Parameters
    ----------
    starts, ends : array (N, 3)
        World, metres.
    colours : array (N, 3)
        0 to 1; they are drawn as they are, without light.
    radius : float
        Metres.
    """
    known = np.asarray(np.isfinite(starts).all(axis=1) & np.isfinite(ends).all(axis=1))
    lengths = np.linalg.norm(np.where(known[:, None], ends - starts, 0.0), axis=1)
    known = np.asarray(known & (lengths > 0))
    if not known.any():
        return
    vertices, faces = tubes(starts[known], ends[known], radius)
    shades = np.repeat(colours[known], 2 * N_TUBE_SIDES, axis=0)
    mesh = mg.TriangularMeshGeometry(vertices, faces, color=shades)
    scene.meshcat[path].set_object(mesh, glow((1.0, 1.0, 1.0), opacity, vertex_colours=True))


def tubes(starts: Array, ends: Array, radius: float) -> tuple[Array, Array]:
    """Return vertices (N * 2 * N_TUBE_SIDES, 3) and faces (N * 2 * N_TUBE_SIDES, 3) of open tubes."""
    axis = ends - starts
    axis = axis / np.linalg.norm(axis, axis=1, keepdims=True)
    # The axis farthest from the tube's own gives a cross product that is well away from zero.
    least = np.eye(3)[np.argmin(np.abs(axis), axis=1)]
    across = cross(axis, least)
    across = across / np.linalg.norm(across, axis=1, keepdims=True)
    third = cross(axis, across)
    angle = 2 * np.pi * np.arange(N_TUBE_SIDES) / N_TUBE_SIDES
    ring = radius * (
        np.cos(angle)[None, :, None] * across[:, None] + np.sin(angle)[None, :, None] * third[:, None]
    )
    vertices = np.stack([starts[:, None] + ring, ends[:, None] + ring], axis=1).reshape(-1, 3)
    k = np.arange(N_TUBE_SIDES)
    after = (k + 1) % N_TUBE_SIDES
    faces = np.concatenate(
        [
            np.stack([k, after, k + N_TUBE_SIDES], axis=1),
            np.stack([after, after + N_TUBE_SIDES, k + N_TUBE_SIDES], axis=1),
        ]
    )
    offset = 2 * N_TUBE_SIDES * np.arange(len(starts))
    return vertices, (offset[:, None, None] + faces).reshape(-1, 3)


def smooth(geometry: Json, half_length: float) -> None:
    """Give a capsule's mesh, its axis along z, the normals of the capsule itself, and turn its faces outward.

    The viewer would average the normals of the triangles, which are long and thin: that shows as stripes.
    """
    attributes = geometry["data"]["attributes"]
    if "normal" in attributes:
        return
    vertices = _unpacked(attributes["position"], "<f4")
    normals = vertices.copy()
    # A capsule's surface is a radius away from its middle line: the normal points from the nearest place on that.
    normals[:, 2] -= np.clip(vertices[:, 2], -half_length, half_length)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    attributes["normal"] = _packed(attributes["position"], normals)
    index = geometry["data"]["index"]
    faces = _unpacked(index, "<u4")
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    inward = np.einsum("ni,ni->n", cross(b - a, c - a), normals[faces].sum(axis=1)) < 0
    geometry["data"]["index"] = _packed(index, np.where(inward[:, None], faces[:, ::-1], faces))


def _unpacked(attribute: Json, dtype: str) -> NDArray[Any]:
    return np.frombuffer(base64.b64decode(attribute["array"]["base64"]), dtype=dtype).reshape(-1, 3)


def _packed(attribute: Json, values: NDArray[Any]) -> Json:
    text = base64.b64encode(values.tobytes()).decode("ascii")
    return {**attribute, "array": {**attribute["array"], "base64": text}}


def add_sheet(scene: Scene, path: str, corners: Array, material: mg.Material) -> None:
    """Put a flat quadrilateral (4, 3), world, metres, at `path`."""
    faces = np.array([[0, 1, 2], [0, 2, 3]])
    scene.meshcat[path].set_object(mg.TriangularMeshGeometry(corners, faces), material)
