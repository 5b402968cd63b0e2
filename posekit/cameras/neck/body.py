r"""What the search asks of a body and its image: lengths, the angles between rays, and how far away it can be.

Distances along the rays of a pinhole camera stand for points: with the neck at distance :math:`\rho` on its ray, a
joint whose ray is at the angle :math:`\theta` to it and whose segment has the length l is at

.. math:: \rho \cos\theta \pm \sqrt{l^2 - \rho^2 \sin^2\theta}

(Lee & Chen 1985, eqs. 6-7), and two joints at :math:`\rho_i, \rho_j` are
:math:`\sqrt{(\rho_i - \rho_j)^2 + 4 \rho_i \rho_j \sin^2(\phi/2)}` apart.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from posekit.body import Figure
from posekit.cameras import PinholeCamera
from posekit.geometry import Array, cross
from posekit.skeleton import JOINTS, PARENTS, RIGID_SEGMENTS, TREE_SEGMENTS, segment_name

NEAREST_DEPTH = 0.25
"""Distance of the neck from the camera, in neck-pelvis lengths, below which the body would be at the camera."""

SEGMENT_OF_PAIR = {frozenset(pair): segment_name(pair) for pair in (*TREE_SEGMENTS, *RIGID_SEGMENTS)}


@dataclass(frozen=True, kw_only=True, eq=False)
class NeckRays:
    """The rays of F frames, and the farthest that each joint can be.

    Parameters
    ----------
    rays : array (F, 14, 3)
        Unit vectors from the optical centre; NaN where a joint is not seen.
    lengths : mapping
        The figure's, metres, by segment name.
    tangent : array (F,)
        Metres by which a segment may be too short for its image.
    farthest : array (F, 14)
        The farthest distance (m) at which a joint and all joints beyond it still have a solution; infinite where none
        is seen beyond it, NaN where the joint is not.
    bounding : int array (F, 14)
        The joint whose segment is too short beyond that; -1 where nothing bounds.
    """

    rays: Array
    lengths: dict[str, float]
    tangent: Array
    farthest: Array
    bounding: NDArray[np.intp]

    def angle(self, a: int, b: int) -> tuple[Array, Array]:
        """Return cosine and sine of the angle between the rays of two joints (F,)."""
        return _angle(self.rays[:, a], self.rays[:, b])

    def length(self, a: int, b: int) -> float:
        """Return the distance between two joints of one segment, metres."""
        return self.lengths[SEGMENT_OF_PAIR[frozenset((a, b))]]

    @property
    def nearest(self) -> float:
        """The least distance of the neck, metres."""
        return NEAREST_DEPTH * self.lengths["neck-pelvis"]

    def segment(self, frame: int) -> str:
        """Name the segment that bounds the neck of a frame; empty where none does."""
        joint = int(self.bounding[frame, 0])
        return "" if joint < 0 else segment_name((PARENTS[joint], joint))


def sight(camera: PinholeCamera, figure: Figure, image: Array, tangent: Array) -> NeckRays:
    r"""Measure the rays of joints (F, 14, 2), NaN where not seen, and bound every joint's distance; tangent is (F,).

    Going up the tree, a joint is bounded by each child: :math:`\rho \sin\theta \le l`, and where the child itself
    is bounded nearer than at the tangent, by where the child's nearer solution reaches its own bound. This is what
    Taylor's bound (2000, eq. 3) becomes in perspective: there every segment bounds the scale alone, here a chain does.
    """
    with np.errstate(
        all="ignore"
    ):  # absurd pixels overflow, and far outside the image a distortion has no ray
        normalized = camera.normalize(image)
        rays = np.concatenate([normalized, np.ones_like(normalized[..., :1])], axis=-1)
        rays /= np.linalg.norm(rays, axis=-1, keepdims=True)
        rays[~(np.linalg.norm(rays, axis=-1) > 0.5)] = np.nan
    lengths = dict(figure.lengths)
    farthest = np.where(np.isnan(rays[..., 0]), np.nan, np.inf)
    bounding = np.full(farthest.shape, -1, dtype=np.intp)
    for child in range(len(JOINTS) - 1, 0, -1):
        parent = PARENTS[child]
        cosine, sine = _angle(rays[:, parent], rays[:, child])
        length = lengths[SEGMENT_OF_PAIR[frozenset((parent, child))]]
        bound, own = _bound(farthest[:, child], cosine, sine, length, tangent)
        source = np.where(own, child, bounding[:, child])
        nearer = bound < farthest[:, parent]  # False where either is NaN: not seen
        farthest[nearer, parent] = bound[nearer]
        bounding[nearer, parent] = source[nearer]
    return NeckRays(rays=rays, lengths=lengths, tangent=tangent, farthest=farthest, bounding=bounding)


def _bound(
    child: Array, cosine: Array, sine: Array, length: float, tangent: Array
) -> tuple[Array, NDArray[np.bool_]]:
    """Bound a parent by a child's bound (F,), and tell whether the segment itself is the reason."""
    with np.errstate(divide="ignore", invalid="ignore"):
        touching = length / sine
        beyond = (length + tangent) / sine
        by_child = np.where(
            child < touching * cosine,
            child * cosine + np.sqrt(np.maximum(length**2 - (child * sine) ** 2, 0.0)),
            child / cosine,
        )
        own = ~(child < beyond * cosine)
        bound = np.where(own, beyond, by_child)
    behind = cosine <= 0  # more than a right angle apart: only from nearer than the segment's length
    return np.where(behind, length, bound), own | behind


def _angle(a: Array, b: Array) -> tuple[Array, Array]:
    cosine: Array = np.einsum("...i,...i->...", a, b)
    return cosine, np.linalg.norm(cross(a, b), axis=-1)
