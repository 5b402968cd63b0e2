r"""How far a posture is from what is known of its shape, and how that changes with the scale (Taylor 2000, §2.1).

Residuals are dimensionless: lengths are in units of the mean segment. Each comes with its exact derivative by the
angle of `posekit.linkages.bound_angle`. A minimum is then a root of the derivative, which is known to full precision
where the residual itself, a sum of squares near zero, would be known to half of it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple, Protocol

import numpy as np

from posekit.geometry import Array


class Slice(NamedTuple):
    """Postures along the family: one for each choice of flips and angle.

    Attributes
    ----------
    signed, signed_slope : array (..., k)
        Flip times foreshortening of the segments that matter, and its derivative.
    shrink, shrink_slope : array broadcastable to (...)
        What the image at the bound is multiplied by, the cosine of the angle, and its derivative.
    """

    signed: Array
    signed_slope: Array
    shrink: Array
    shrink_slope: Array


class Residual(Protocol):
    """One constraint."""

    def evaluate(self, postures: Slice) -> tuple[Array, Array]:
        """Return the residual and its derivative (...)."""
        ...


@dataclass(frozen=True, kw_only=True, eq=False)
class LoopClosure:
    """Squared distance between the two ends of a loop that was cut open.

    Parameters
    ----------
    loop : array (k,)
        Its row of C.
    """

    loop: Array

    def evaluate(self, postures: Slice) -> tuple[Array, Array]:
        """Sum the foreshortenings around the loop."""
        gap = postures.signed @ self.loop
        residual: Array = gap * gap
        slope: Array = 2 * gap * (postures.signed_slope @ self.loop)
        return residual, slope


@dataclass(frozen=True, kw_only=True, eq=False)
class Flatness:
    """Sum of squared distances of some points to their best plane (`rank` 2) or line (`rank` 1).

    The smallest eigenvalue of their scatter matrix, or the sum of the two smallest. At a minimum over the plane the
    derivative is that with the plane held still.

    Parameters
    ----------
    spread : array (n, k)
        Depths from signed foreshortenings, relative to the mean.
    place : array (n, 2)
        The points in the image at the bound, relative to their mean.
    rank : {1, 2}
        How many dimensions the points should have: a plane has 2, a line 1.
    """

    spread: Array
    place: Array
    rank: int

    def evaluate(self, postures: Slice) -> tuple[Array, Array]:
        """Measure the points along the directions in which they should have no extent."""
        points = self._points(postures.signed, postures.shrink)
        slopes = self._points(postures.signed_slope, postures.shrink_slope)
        scatter = np.swapaxes(points, -1, -2) @ points
        _, axes = np.linalg.eigh(scatter)
        normals = axes[..., : 3 - self.rank]
        off = points @ normals
        residual: Array = (off * off).sum(axis=(-1, -2))
        slope: Array = 2 * (off * (slopes @ normals)).sum(axis=(-1, -2))
        return residual, slope

    def _points(self, signed: Array, shrink: Array) -> Array:
        depth = signed @ self.spread.T
        points = np.empty((*depth.shape, 3))
        points[..., :2] = shrink[..., None, None] * self.place
        points[..., 2] = depth
        return points


@dataclass(frozen=True, kw_only=True, eq=False)
class Perpendicularity:
    """Squared cosine of the angle between two segments.

    Parameters
    ----------
    pair : (int, int)
        Which of the k segments.
    product : float
        Dot product of their images at the bound.
    lengths : float
        Product of their lengths.
    """

    pair: tuple[int, int]
    product: float
    lengths: float

    def evaluate(self, postures: Slice) -> tuple[Array, Array]:
        """Multiply the two segments."""
        a, b = (postures.signed[..., k] for k in self.pair)
        a_slope, b_slope = (postures.signed_slope[..., k] for k in self.pair)
        cosine = (postures.shrink**2 * self.product + a * b) / self.lengths
        slope = (2 * postures.shrink * postures.shrink_slope * self.product + a_slope * b + a * b_slope) / (
            self.lengths
        )
        residual: Array = cosine * cosine
        return residual, 2 * cosine * slope
