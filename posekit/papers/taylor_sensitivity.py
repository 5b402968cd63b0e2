r"""How far a pixel moves what is recovered of a closed or flat chain.

Unknown are the points :math:`X` (in units of length, the first at depth 0) and the scale :math:`s`; seen is
:math:`u = s\,(X_x, X_y)`. Segments have their lengths, all of them where the chain is closed; of points in a plane each
besides lies in that of the first three. Those are equations :math:`c(X) = 0`, so that only motions along
:math:`N = \ker \partial c` are free, in which the points' noise leaves the covariance
:math:`N (N^T H^T H N)^{-1} N^T \sigma^2`, :math:`H = \partial u / \partial (X, s)`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from posekit.geometry import Array
from posekit.linkages import Linkage
from posekit.measures import joint_angles

FREE_RATIO = 1e-9
"""Singular value of the equations, as a fraction of the largest, below which a motion is free."""

ANGLE_STEP = 1e-6
"""Step of the angles' central differences, as a fraction of the object's size."""


@dataclass(frozen=True, kw_only=True, eq=False)
class ConstrainedChain:
    """A chain of which the shape fixes the scale.

    Parameters
    ----------
    linkage : Linkage
        Points and lengths; a closed chain's last segment closes it.
    planes : sequence of (int, int, int, int)
        Points that are known to lie in a plane, four by four.
    triples : sequence of (int, int, int)
        The points before, at and after each joint whose angle is measured.
    """

    linkage: Linkage
    planes: Sequence[tuple[int, int, int, int]]
    triples: Sequence[tuple[int, int, int]]

    def sensitivity(self, points: Array, s: float) -> Array:
        """Return the angles' deviations (A, M), degrees, of M independent errors of one pixel.

        Parameters
        ----------
        points : array (P, 3)
            The posture, camera frame, units of length.
        s : float
            Pixels a unit.
        """
        X = points - [0.0, 0.0, points[0, 2]]
        free = self._free_motions(X)
        _, sizes, axes = np.linalg.svd(_seen(X, s) @ free, full_matrices=False)
        moves: Array = self._angles(X) @ (free @ (axes.T / np.maximum(sizes, FREE_RATIO)))[:-1]
        return moves

    def depth_factors(self, points: Array) -> tuple[float, float]:
        r"""Return how far depth moves, at most over the segments: by image points and by scale (Taylor 2000, eq. 2).

        With :math:`dZ^2 = l^2 - d^2`, `d` the length in the image over s: :math:`|\partial dZ / \partial d| = d / dZ`
        (depth's pixels a pixel) and :math:`\partial dZ / \partial \ln s = d^2 / dZ`, in the segment's lengths.
        """
        step = points[[b for _, b in self.linkage.segments]] - points[[a for a, _ in self.linkage.segments]]
        d, depth = np.hypot(step[:, 0], step[:, 1]), np.abs(step[:, 2])
        with np.errstate(divide="ignore"):
            by_image, by_scale = d / depth, d**2 / depth / np.asarray(self.linkage.lengths)
        return float(by_image.max()), float(by_scale.max())

    def _free_motions(self, X: Array) -> Array:
        """Return a basis (3 P + 1, M) of the motions of (X, s) along which the equations hold to first order."""
        gradients = []
        for a, b in self.linkage.segments:
            gradient = np.zeros_like(X)
            gradient[b], gradient[a] = X[b] - X[a], X[a] - X[b]
            gradients.append(gradient)
        for a, b, c, d in self.planes:
            first, second, third = X[b] - X[a], X[c] - X[a], X[d] - X[a]
            gradient = np.zeros_like(X)
            gradient[b], gradient[c] = np.cross(second, third), np.cross(third, first)
            gradient[d] = np.cross(first, second)
            gradient[a] = -gradient.sum(axis=0)
            gradients.append(gradient)
        depth = np.zeros_like(X)
        depth[0, 2] = 1.0
        rows = np.stack([one.ravel() for one in (*gradients, depth)])
        rows = np.column_stack([rows / np.linalg.norm(rows, axis=1, keepdims=True), np.zeros(len(rows))])
        _, values, axes = np.linalg.svd(rows)
        free: Array = axes[int((values > FREE_RATIO * values[0]).sum()) :].T
        return free

    def _angles(self, X: Array) -> Array:
        """Return the angles' derivatives (A, 3 P) by the points, degrees a unit of length."""
        step = ANGLE_STEP * float(np.ptp(X))
        moved = step * np.eye(X.size).reshape(X.size, *X.shape)
        return (joint_angles(X + moved, self.triples) - joint_angles(X - moved, self.triples)).T / (2 * step)


def _seen(X: Array, s: float) -> Array:
    """Return the derivatives (2 P, 3 P + 1) of the image points by (X, s)."""
    H = np.zeros((len(X), 2, X.size + 1))
    for k, point in enumerate(X):
        H[k, 0, 3 * k] = H[k, 1, 3 * k + 1] = s
        H[k, :, -1] = point[:2]
    return H.reshape(-1, X.size + 1)
