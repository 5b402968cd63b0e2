"""How far away the neck is, where something other than the picture's distances tells it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from posekit.errors import InputError
from posekit.geometry import Array
from posekit.ranking.student import excess

DEPTH_DEGREES_OF_FREEDOM: Final = 4.0
"""Degrees of freedom of the depth's t distribution: one estimate in some is plain wrong."""

MIN_DEVIATION_METRES: Final = 0.01
"""Metres: least standard deviation of a depth."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Depth:
    """What is known of the neck's depth in F frames.

    An estimate that was made from the distances inside torso and hips is no news where these are judged anyway: give
    only what comes from elsewhere, as from a head, a marker or a depth camera.

    Parameters
    ----------
    estimate : array (F,)
        Camera z of the neck, metres; NaN where nothing is known.
    deviation : array (F,)
        Its standard deviation, metres; NaN where nothing is known.

    Raises
    ------
    InputError
        Where the two do not belong together, or a deviation is not positive.
    """

    estimate: Array
    deviation: Array

    def __post_init__(self) -> None:
        estimate, deviation = (np.array(value, dtype=np.float64) for value in (self.estimate, self.deviation))
        if estimate.ndim != 1 or deviation.shape != estimate.shape:
            raise InputError(
                f"the neck's depth has shapes {estimate.shape} and {deviation.shape}; expected one estimate and one "
                "deviation a frame, (F,)"
            )
        if (deviation <= 0).any() or np.isinf(estimate).any():
            raise InputError(
                "the neck's depth needs finite estimates and positive deviations, metres; NaN for none"
            )
        for name, value in (("estimate", estimate), ("deviation", deviation)):
            value.flags.writeable = False
            object.__setattr__(self, name, value)

    def judge(self, depth: Array, frame: NDArray[np.intp]) -> Array:
        """Return the log-density of the necks' depths (N,), above its average; 0 where nothing is known."""
        away = (depth - self.estimate[frame]) / np.maximum(self.deviation[frame], MIN_DEVIATION_METRES)
        return np.nan_to_num(excess(away**2, 1, DEPTH_DEGREES_OF_FREEDOM))
