"""How far off survivors are, from the noise of the image or from what the tree was allowed."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from posekit.errors import InputError
from posekit.geometry import Array
from posekit.ranking.image_term import MIN_DEVIATION_METRES

PER_TOLERANCE: Final = 2.2
"""Deviations in the tolerance of rigid distances: as fitted weights have it (docs, "Ranking")."""


def deviation_of_noise(pixels: ArrayLike, metres_per_pixel: ArrayLike) -> Array:
    r"""Return the deviation of survivors whose root is known, metres.

    .. math:: \sqrt{(6 mm)^2 + (2 \sigma z / f)^2}

    The first is what torsos give, the second what noise makes of distances that are lifted: more than beside the ray,
    since depths are off by more.

    Parameters
    ----------
    pixels : float or array (F,)
        Standard deviation of image points.
    metres_per_pixel : float or array (F,)
        Depth over focal length, at the body.

    Raises
    ------
    InputError
        Where one is negative or not finite.
    """
    noise, size = np.asarray(pixels, dtype=np.float64), np.asarray(metres_per_pixel, dtype=np.float64)
    for name, values in (("pixels", noise), ("metres a pixel", size)):
        if not (np.isfinite(values) & (values >= 0)).all():
            raise InputError(f"the noise needs {name} that are finite and not negative")
    return np.asarray(np.hypot(MIN_DEVIATION_METRES, 2 * noise * size))


def deviation_of_tolerance(rigid: ArrayLike) -> Array:
    """Return the deviation of survivors of a tree that was allowed rigid distances to be off by `rigid` metres.

    Raises
    ------
    InputError
        Where it is negative or not finite.
    """
    values = np.asarray(rigid, dtype=np.float64)
    if not (np.isfinite(values) & (values >= 0)).all():
        raise InputError("the tolerance of rigid distances must be finite metres, not negative")
    return np.asarray(np.maximum(values / PER_TOLERANCE, MIN_DEVIATION_METRES))
