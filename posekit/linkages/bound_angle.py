r"""The scale as an angle: :math:`s = s_{min} / \cos\psi`, in which foreshortenings are smooth.

As a function of s, dZ starts at the bound with a vertical tangent. As a function of :math:`\psi` the segment that sets
the bound has :math:`dZ = l \sin\psi`, which goes on through zero into its other flip, and all others are smooth.
The scale grows without end as :math:`\psi` nears a right angle.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from posekit.geometry import Array

NEAREST_TO_RIGHT_ANGLE = 1e-3
"""How near (rad) the search goes to the right angle: a thousand times the bound."""

N_UNIFORM_POINTS = 160
"""Points of the grid that are evenly spaced."""

NEAR_BOUND = np.geomspace(1e-5, 0.03, 36)
"""Points that resolve the corners of segments that are almost at the bound themselves."""


@dataclass(frozen=True, kw_only=True, eq=False)
class BoundAngle:
    r"""Foreshortenings of k segments against the angle, lengths in units of the mean segment.

    :math:`dZ = \sqrt{\delta^2 + m^2 \sin^2\psi}` with the image's length over the bound :math:`m` and
    :math:`\delta^2 = l^2 - m^2`.

    Parameters
    ----------
    minimum_scale : float
        The bound, pixels a mean segment.
    at_scale : array (k,)
        m of each segment.
    squared_rest : array (k,)
        :math:`\delta^2` of each; exactly zero where it sets the bound.
    """

    minimum_scale: float
    at_scale: Array
    squared_rest: Array

    def foreshortening(self, psi: Array) -> tuple[Array, Array]:
        """Return dZ and its derivative at some angles: (..., k) each."""
        sine, cosine = np.sin(psi)[..., None], np.cos(psi)[..., None]
        reach = self.at_scale * sine
        dZ = np.sqrt(self.squared_rest + reach * reach)
        # Where the segment sets the bound the ratio is one, at the bound too.
        ratio = np.divide(reach, dZ, out=np.ones_like(dZ), where=dZ > 0)
        return dZ, ratio * self.at_scale * cosine

    def scale(self, psi: Array) -> Array:
        """Return s, pixels a mean segment."""
        scale: Array = self.minimum_scale / np.cos(psi)
        return scale


def grid() -> Array:
    """Return the angles (G,) at which curves are sampled, from the bound to a thousand times it."""
    even = np.linspace(0.0, np.pi / 2 - NEAREST_TO_RIGHT_ANGLE, N_UNIFORM_POINTS)
    return np.unique(np.concatenate([even, NEAR_BOUND]))
