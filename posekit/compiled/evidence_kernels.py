"""What an image says of the lengths of limbs' segments as a plain loop, for `posekit.refinement.limb_evidence`."""

from __future__ import annotations

import math

import numpy as np

from posekit.geometry import Array

NEGLIGIBLE_SQUARE = 72.0
"""Squared deviations beyond which a bell is nothing beside outliers: e^-36 of it is left."""


def weigh_lower(
    likely: Array,
    prior: Array,
    seen: Array,
    blur: Array,
    depth: Array,
    cosine: Array,
    width: Array,
    lengths: Array,
    least: Array,
    outlier: float,
    out: Array,
) -> None:
    """Add up, over the angles of the lower segment, how likely its lengths are at each angle of the upper one.

    Parameters
    ----------
    likely, prior : array (N, K, K)
        Log-likelihoods of pairs of angles, of which those below `least` (N,) are left out; and of their directions.
    seen, blur, depth : array (N, K)
        Where the end is seen beside its ray, and its deviation, metres; the middle's depth. NaN where it is not seen.
    cosine, width : array (K,)
        Of the lower segment's angles; and by how much of a length the angles around each spread it.
    lengths : array (G,)
        Metres.
    outlier : float
        Density of points that have nothing to do with the segment, one over metres.
    out : array (N, K, G)
        Filled with logarithms; what nothing is added to stays.
    """
    count, angles, grid = out.shape
    total = np.empty(grid)
    for n in range(count):
        for i in range(angles):
            most = -math.inf
            for j in range(angles):
                if likely[n, i, j] > least[n]:
                    most = max(most, prior[n, i, j])
            if most == -math.inf:
                continue
            known = not math.isnan(seen[n, i])
            for g in range(grid):
                total[g] = 0.0
            for j in range(angles):
                if not likely[n, i, j] > least[n]:
                    continue
                weight = math.exp(prior[n, i, j] - most) * cosine[j]
                for g in range(grid):
                    if not known:
                        total[g] += weight
                        continue
                    turning = lengths[g] * width[j]
                    variance = blur[n, i] * blur[n, i] + turning * turning
                    off = seen[n, i] - lengths[g] * cosine[j]
                    likely_here = outlier
                    if off * off < NEGLIGIBLE_SQUARE * variance:
                        likely_here += math.exp(-0.5 * off * off / variance) / math.sqrt(
                            2.0 * math.pi * variance
                        )
                    total[g] += weight * likely_here * depth[n, i]
            for g in range(grid):
                out[n, i, g] = math.log(total[g]) + most


COMPILED_TYPES = {
    "weigh_lower": (
        "(f8[:,:,::1], f8[:,:,::1], f8[:,::1], f8[:,::1], f8[:,::1], f8[::1], f8[::1], f8[::1], f8[::1], f8,"
        " f8[:,:,::1])"
    ),
}
"""The kernels, with the types that they take."""
