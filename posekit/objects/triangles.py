r"""The scale from rigid triangles: each is seen at one scale alone, whichever way it is flipped.

Of two sides with lengths :math:`l_1, l_2` and inner product g, and their images' inner products a, b (with themselves)
and c (with each other), the depths satisfy

.. math:: (l_1^2 - a w)(l_2^2 - b w) = (g - c w)^2, \qquad w = 1/s^2,

a quadratic in w whose smaller root alone leaves both depths real (Huttenlocher & Ullman 1990, Recognizing solid objects
by alignment with an image, *International Journal of Computer Vision* 5, 195-212).
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from posekit.geometry import Array
from posekit.linkages import Linkage
from posekit.linkages.linkage_family import LinkageFamily

NEAREST_TO_RIGHT_ANGLE = 1e-3
"""How near (rad) the search goes to the right angle: a thousand times the bound."""

N_GRID_POINTS = 4000
"""Angles at which the residual is sampled for brackets."""

N_GOLDEN_SECTIONS = 80
"""Golden sections of a bracket: more than its last digits."""

OWN_SCALE_RATIO = 1e-4
"""Of the scale: a minimum is moved to a triangle's own scale that is so near and fits better."""

GOLDEN_RATIO = (np.sqrt(5) - 1) / 2


@dataclass(frozen=True, kw_only=True, eq=False)
class Triangles:
    """The rigid triangles of a linkage that one image shows.

    Parameters
    ----------
    squares : array (T, 3)
        l1^2, l2^2 and g.
    seen : array (T, 3)
        a, b and c, pixels squared.
    """

    squares: Array
    seen: Array

    @staticmethod
    def of(family: LinkageFamily) -> Triangles:
        """Collect the triangles whose corners are seen."""
        linkage = family.linkage
        corners = triangles(linkage)
        known = np.isfinite(family.place[corners]).all(axis=(1, 2))
        corners = corners[known]
        length = {
            frozenset(ends): size
            for ends, size in zip(linkage.segments, linkage.lengths.tolist(), strict=True)
        }
        sides = np.array(
            [[length[frozenset((p, q))] for p, q in ((a, b), (a, c), (b, c))] for a, b, c in corners.tolist()]
        ).reshape(-1, 3)
        one, two, three = (sides**2).T
        u = family.place[corners[:, 1]] - family.place[corners[:, 0]]
        v = family.place[corners[:, 2]] - family.place[corners[:, 0]]
        return Triangles(
            squares=np.stack([one, two, (one + two - three) / 2], axis=-1),
            seen=np.stack([(u * u).sum(axis=1), (v * v).sum(axis=1), (u * v).sum(axis=1)], axis=-1),
        )

    def __len__(self) -> int:
        return len(self.squares)

    def scales(self) -> Array:
        """Return the scale (T,) of each triangle alone; NaN where its image is a line."""
        (p, q, g), (a, b, c) = self.squares.T, self.seen.T
        A, B, C = a * b - c * c, a * q + b * p - 2 * g * c, p * q - g * g
        root = np.sqrt(np.maximum(B * B - 4 * A * C, 0.0))
        with np.errstate(divide="ignore", invalid="ignore"):
            w = 2 * C / (B + root)  # the smaller root, without cancellation
            scale = np.sqrt(1 / w)
        return np.asarray(np.where(np.isfinite(scale) & (C > 0), scale, np.nan))

    def residual(self, s: Array) -> Array:
        """Return how far the third sides are off at some scales (...): the sum of their squares' relative errors."""
        w = 1 / np.asarray(s, dtype=np.float64)[..., None] ** 2
        (p, q, g), (a, b, c) = self.squares.T, self.seen.T
        depths = np.sqrt(np.maximum(p - a * w, 0.0) * np.maximum(q - b * w, 0.0))
        off = np.abs(np.abs(g - c * w) - depths) / np.sqrt(p * q)
        return np.asarray((off * off).sum(axis=-1))

    def minima(self, bound: float) -> tuple[Array, Array, Array]:
        """Find all local minima of the residual above a bound.

        Returns
        -------
        minima : array (M, 2)
            Scale and residual, best first.
        curve_s, curve_residual : array (G,)
        """
        psi = np.linspace(0.0, np.pi / 2 - NEAREST_TO_RIGHT_ANGLE, N_GRID_POINTS)
        curve = self.residual(bound / np.cos(psi))
        before, after = np.append(np.inf, curve[:-1]), np.append(curve[1:], -np.inf)
        lowest = np.flatnonzero((curve <= before) & (curve < after))
        low, high = psi[np.maximum(lowest - 1, 0)], psi[lowest + 1]
        for _ in range(N_GOLDEN_SECTIONS):
            width = GOLDEN_RATIO * (high - low)
            first, second = high - width, low + width
            left = self.residual(bound / np.cos(first)) <= self.residual(bound / np.cos(second))
            low, high = np.where(left, low, first), np.where(left, second, high)
        s = bound / np.cos((low + high) / 2)
        # Near its minimum the sum is flat: where the image is exact, the triangles' own scales have more digits.
        own = self.scales()
        own = np.maximum(own[np.isfinite(own) & (own >= bound * (1 - OWN_SCALE_RATIO))], bound)
        for k, scale in enumerate(s):
            near = np.append(own[np.abs(own - scale) <= OWN_SCALE_RATIO * scale], scale)
            s[k] = near[np.argmin(self.residual(near))]
        residual = self.residual(s)
        order = np.argsort(residual, kind="stable")
        return np.stack([s, residual], axis=-1)[order], bound / np.cos(psi), curve


def triangles(linkage: Linkage) -> NDArray[np.intp]:
    """Return the triples of nodes (T, 3) that are joined each with each, and not on one line."""
    length = {
        frozenset(ends): size for ends, size in zip(linkage.segments, linkage.lengths.tolist(), strict=True)
    }
    found = []
    for a, b, c in combinations(range(len(linkage.nodes)), 3):
        sides = sorted(length.get(frozenset(pair), 0.0) for pair in ((a, b), (a, c), (b, c)))
        if sides[0] > 0 and sides[0] + sides[1] > sides[2] * (1 + 1e-6):
            found.append((a, b, c))
    return np.array(found, dtype=np.intp).reshape(-1, 3)
