r"""Whether uncertain lengths tell how far the shoulders lie beside the line from neck to pelvis.

With a shoulder :math:`h` below the neck along that line, :math:`y` beside it and :math:`a` from the neck, the
shoulders lie :math:`f = \pm\sqrt{a^2 - h^2 - y^2}` in front of it or behind. Small errors of the lengths change
:math:`f^2`, and so the deviation of f is that of :math:`f^2` over :math:`2 f`: the flatter a torso, the less lengths
say of its sides.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Final

from posekit.body.closing import TORSO_LENGTHS
from posekit.body.lengths import forward_squared
from posekit.body.uncertainty import LengthUncertainty
from posekit.errors import FigureError

SIDE_DEVIATIONS: Final = 3.0
"""Standard deviations that the shoulders must lie beside the line, so that a mirror image is another body."""

RELATIVE_STEP: Final = 1e-6
"""Of a length, for differences."""


def offset_deviation(lengths: Mapping[str, float], known: LengthUncertainty) -> float:
    """Return the standard deviation (m) of how far the shoulders lie beside the line from neck to pelvis.

    What all lengths have in common only scales it.

    Parameters
    ----------
    lengths : mapping
        Metres, by segment name.
    known : LengthUncertainty
        How well they are known.

    Returns
    -------
    float
        Infinite where the torso is flat, and its lengths are not exact.
    """
    squared = max(forward_squared(lengths), 0.0)
    variance = 0.0
    for name in TORSO_LENGTHS:
        if known.own[name]:
            variance += (known.own[name] * _slope(lengths, name)) ** 2
    if variance == 0.0:
        return 0.0
    return math.sqrt(variance) / (2 * math.sqrt(squared)) if squared > 0 else math.inf


def side_is_certain(lengths: Mapping[str, float], known: LengthUncertainty) -> bool:
    """Tell whether the shoulders are more than `SIDE_DEVIATIONS` deviations beside the line from neck to pelvis."""
    offset = math.sqrt(max(forward_squared(lengths), 0.0))
    return offset > SIDE_DEVIATIONS * offset_deviation(lengths, known)


def _slope(lengths: Mapping[str, float], name: str) -> float:
    """Return the derivative of the squared offset by the logarithm of a length, m^2."""
    ends = []
    for sign in (1.0, -1.0):
        try:
            ends.append(forward_squared({**lengths, name: lengths[name] * (1 + sign * RELATIVE_STEP)}))
        except FigureError:  # a triangle is at its edge: the other end tells as much
            ends.append(math.nan)
    above, below = ends
    middle = forward_squared(lengths)
    if math.isnan(above):
        return (middle - below) / RELATIVE_STEP
    return (above - (middle if math.isnan(below) else below)) / (
        RELATIVE_STEP * (1 if math.isnan(below) else 2)
    )
