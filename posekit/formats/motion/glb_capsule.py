"""A capsule as triangles."""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from posekit.geometry import Array, cross

RING_CORNERS: Final = 24
"""Corners of a ring."""
HALF_SPHERE_RINGS: Final = 6
"""Rings of a half sphere, its equator among them, its pole not."""


class CapsuleMesh(NamedTuple):
    """Triangles.

    Attributes
    ----------
    vertices : array (V, 3)
        Metres.
    normals : array (V, 3)
        Unit, outward.
    faces : int array (F, 3)
        Counter-clockwise seen from outside.
    """

    vertices: Array
    normals: Array
    faces: NDArray[np.intp]


def capsule_mesh(start: Array, end: Array, radius: float) -> CapsuleMesh:
    """Mesh the capsule of a radius (m) about the line from one point (3,) to another, metres.

    Vertices lie on the capsule; its faces inside it, by 1 - cos(pi / 24) of the radius at most, under one percent.
    """
    axis = (end - start) / np.linalg.norm(end - start)
    across = cross(axis, np.eye(3)[np.argmin(np.abs(axis))])
    across /= np.linalg.norm(across)
    turn = 2 * np.pi * np.arange(RING_CORNERS) / RING_CORNERS
    ring = np.outer(np.cos(turn), across) + np.outer(np.sin(turn), cross(axis, across))
    lift = np.pi / 2 * np.arange(HALF_SPHERE_RINGS) / HALF_SPHERE_RINGS
    half = np.cos(lift)[:, None, None] * ring + np.sin(lift)[:, None, None] * axis  # from the equator up
    below = half - 2 * np.sin(lift)[:, None, None] * axis
    normals = np.concatenate([-axis[None], *below[::-1], *half, axis[None]])
    centres = np.where(np.arange(len(normals))[:, None] < len(normals) // 2, start, end)
    return CapsuleMesh(centres + radius * normals, normals, _faces(2 * HALF_SPHERE_RINGS))


def _faces(rings: int) -> NDArray[np.intp]:
    """Join a pole, so many rings, and the other pole."""
    k = np.arange(RING_CORNERS)
    after = (k + 1) % RING_CORNERS
    last = 1 + rings * RING_CORNERS
    pieces = [np.stack([np.zeros_like(k), 1 + after, 1 + k], axis=-1)]
    for ring in range(rings - 1):
        low, high = 1 + ring * RING_CORNERS, 1 + (ring + 1) * RING_CORNERS
        pieces.append(np.stack([low + k, low + after, high + after], axis=-1))
        pieces.append(np.stack([low + k, high + after, high + k], axis=-1))
    top = last - RING_CORNERS
    pieces.append(np.stack([top + k, top + after, np.full_like(k, last)], axis=-1))
    return np.concatenate(pieces)
