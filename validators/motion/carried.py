"""Rests that carry a body, and rests that hang in the air.

A body gets from one level to another by a step, while a foot rests, or by a jump, while its centre of mass falls. A
stretch of rest at another level that it got to otherwise carries nothing.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from posekit.geometry import Array, runs

LEVEL_METRES: Final = 0.05
"""Levels that differ by less are of one ground."""

SHORTEST_FLIGHT: Final = 0.25
"""Seconds below which it cannot be told from the motion of limbs whether a body falls."""

GRAVITY_ACCELERATION: Final = 9.81
"""Metres a second squared."""

FEWEST_FRAMES: Final = 6
"""That tell how a centre of mass falls."""

FALL_SHARE: Final = 0.5
"""Of gravity, by which the centre of mass of a body in the air falls; whole jumps have 0.8 to 1.1."""


def carried(resting: NDArray[np.bool_], lowest: Array, centre: Array, step: float) -> NDArray[np.bool_]:
    """Leave rests out that hang in the air: at another level than those before, with no step and no jump to it.

    Parameters
    ----------
    resting : bool array (T,)
        Whether something rests.
    lowest, centre : array (T,)
        How high the lowest point and the centre of mass are, metres.
    step : float
        Seconds from a frame to the next.

    Returns
    -------
    bool array (T,)
        Those of `resting` that carry the body.
    """
    rests = runs(resting)
    if len(rests) < 2 or not step > 0:
        return resting
    group = np.zeros(len(rests), dtype=np.intp)
    levels = np.array([np.median(lowest[start:stop]) for start, stop in rests])
    for k in range(1, len(rests)):
        # A rest may be of a group that was left before: the body comes down again where it hung from.
        alike = np.flatnonzero(~(np.abs(levels[:k] - levels[k]) > LEVEL_METRES))
        between = slice(rests[k - 1][1], rests[k][0])
        if len(alike):
            group[k] = group[alike[-1]]
        elif (between.stop - between.start) * step >= SHORTEST_FLIGHT and falls(centre[between], step):
            group[k] = group[k - 1]
        else:
            group[k] = group.max() + 1
    count = np.bincount(group, weights=[stop - start for start, stop in rests])
    left = resting.copy()
    for (start, stop), of in zip(rests, group, strict=True):
        left[start:stop] = of == count.argmax()
    return left


def falls(centre: Array, step: float, share: float = FALL_SHARE) -> bool:
    """Tell by its parabola whether a centre of mass (N,) falls, by a share of gravity; yes where it is not known."""
    known = np.isfinite(centre)
    if known.sum() < FEWEST_FRAMES:
        return True
    curve = np.polyfit(np.arange(len(centre))[known] * step, centre[known], 2)[0]
    return bool(2 * curve <= -share * GRAVITY_ACCELERATION)
