"""Where the search for a placement starts: the linear solution, and the scaled orthographic view."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from posekit.cameras.head.dlt import solve
from posekit.cameras.head.perspective import HeadPlacement
from posekit.geometry import Array, cross

FLAT_EXTENT = 1e-12
"""Added to the squared extent of points of size 1, so that the rest of a head, if flat, has a start too."""


def affine_start(points: Array, image: Array, seen: NDArray[np.bool_], known: bool) -> HeadPlacement:
    """Fit a scaled orthographic view: the limit of a distant camera (DeMenthon & Davis 1995).

    Parameters
    ----------
    points : array (F, P, 3)
        As `posekit.cameras.head.perspective.Heads` has them.
    image : array (F, P, 2)
        Normalised image points, or metres where f is free.
    seen : bool array (F, P)
        At least four a frame.
    known : bool
        Whether f is: then the scale tells the depth, else the camera is infinitely far.
    """
    weight = (seen / seen.sum(axis=-1, keepdims=True))[..., None]
    centre, middle = (weight * points).sum(axis=1), (weight * image).sum(axis=1)
    space = np.where(seen[..., None], points - centre[:, None], 0.0)
    offset = np.where(seen[..., None], image - middle[:, None], 0.0)
    transposed = np.swapaxes(space, -1, -2)
    normal = transposed @ space + FLAT_EXTENT * np.eye(3)
    affine = np.swapaxes(np.linalg.solve(normal, transposed @ offset), -1, -2)
    left, values, right = np.linalg.svd(affine, full_matrices=False)
    axes = left @ right
    R = np.concatenate([axes, cross(axes[:, 0], axes[:, 1])[:, None]], axis=1)
    scale = values.mean(axis=-1)
    shift = middle - scale[:, None] * np.einsum("fij,fj->fi", axes, centre)
    return HeadPlacement(R, shift, scale, scale.copy() if known else np.zeros(len(R)))


def reversed_start(points: Array, placement: HeadPlacement) -> HeadPlacement:
    """Turn heads (F, P, 3) so that they look nearly the same with their depths reversed (Necker 1832).

    The head is mirrored in the plane across its thinnest direction, then along the optical axis: together a
    rotation. A flat head would look exactly the same from afar.
    """
    thinnest = np.linalg.svd(points, full_matrices=False)[2][:, 2]
    mirror = np.eye(3) - 2 * thinnest[:, :, None] * thinnest[:, None, :]
    return placement._replace(R=np.diag([1.0, 1.0, -1.0]) @ placement.R @ mirror)


def direct_start(
    points: Array, image: Array, seen: NDArray[np.bool_]
) -> tuple[HeadPlacement, NDArray[np.bool_]]:
    """Take the placement from the direct linear transformation, and say whether it lies behind the camera.

    NaN where the linear equations do not determine it or it has points on both sides of the camera.
    """
    direct = solve(points, image, seen)
    depth = direct.t[:, 2]
    ahead = (np.einsum("fi,fpi->fp", direct.R[:, 2], points) + depth[:, None]) * np.sign(depth)[:, None]
    usable = direct.determined & ((ahead > 0) | ~seen).all(axis=-1)
    behind = usable & (depth < 0)
    side = np.where(behind, -1.0, 1.0)
    # A head behind the camera looks as one turned by half a turn about the optical axis, its depths reversed.
    R = direct.R * np.stack([side, side, np.ones_like(side)], axis=-1)[..., None]
    R = np.where(usable[:, None, None], R, np.nan)
    shift = direct.f[:, None] * direct.t[:, :2] / depth[:, None]
    return HeadPlacement(R, shift, direct.f / np.abs(depth), 1 / depth), behind
