"""How well a survivor agrees with the picture and the person's lengths."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

import numpy as np

from posekit.errors import InputError
from posekit.geometry import Array, dot
from posekit.ranking.student import excess
from posekit.safe_io import nearest
from posekit.skeleton import RIGID_SEGMENTS, segment_name

MISFIT_DEGREES_OF_FREEDOM: Final = 4.0
"""Degrees of freedom of a misfit's t distribution: torsos give now and then by more than they mostly do."""

MIN_DEVIATION_METRES: Final = 0.006
"""Metres: least deviation of a distance inside torso and hips. A real torso is no more rigid (docs, "Ranking")."""

RIGID_SEGMENT_NAMES: Final = tuple(map(segment_name, RIGID_SEGMENTS))


def rigid_lengths(lengths: Mapping[str, float]) -> Array:
    """Return the person's four distances that lift nothing (4,), metres.

    Raises
    ------
    InputError
        Where one is missing or not positive.
    """
    for name in RIGID_SEGMENT_NAMES:
        if name not in lengths:
            raise InputError(
                f"lengths: {name} is missing; expected the four of torso and hips; {nearest(name, lengths)}"
            )
        if not 0 < lengths[name] < np.inf:
            raise InputError(f"lengths: {name} is {lengths[name]!r} m; expected a positive length")
    return np.array([lengths[name] for name in RIGID_SEGMENT_NAMES], dtype=np.float64)


def misfit(joints: Array, lengths: Array, length_residual: Array | None, deviation: Array) -> Array:
    """Return the log-density of what does not fit, above its average (N,).

    Four distances inside torso and hips lift no joint: their misfit is evidence. So is how much too short a segment was
    for its image.

    Parameters
    ----------
    joints : array (14, 3, N)
        Metres; a distance with an unknown end counts nothing.
    lengths : array (4,)
        Metres, in the order of `RIGID_SEGMENTS`.
    length_residual : array (N,), optional
        Metres.
    deviation : array (N,)
        Of each distance, metres; taken to be at least `MIN_DEVIATION_METRES`.
    """
    inverse = 1.0 / np.maximum(deviation, MIN_DEVIATION_METRES)
    total = np.zeros(joints.shape[2])
    for (start, end), length in zip(RIGID_SEGMENTS, lengths, strict=True):
        apart = joints[end] - joints[start]
        total += _known(
            excess(
                ((np.sqrt(dot(apart, apart, axis=-2)) - length) * inverse) ** 2, 1, MISFIT_DEGREES_OF_FREEDOM
            )
        )
    if length_residual is not None:
        total += _known(excess((length_residual * inverse) ** 2, 1, MISFIT_DEGREES_OF_FREEDOM))
    return total


def _known(values: Array) -> Array:
    return np.where(np.isnan(values), 0.0, values)
