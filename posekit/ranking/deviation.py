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

LIMB_METRES: Final = 0.6
"""About two segments of a limb: with it the first is as sure as it is right, whether lengths are off by 1 % or 5 %."""


def deviation_of_noise(pixels: ArrayLike, metres_per_pixel: ArrayLike, lengths: ArrayLike = 0.0) -> Array:
    r"""Return the deviation of survivors whose root is known, metres.

    .. math:: \sqrt{(6 mm)^2 + (2 \sigma z / f)^2 + (0.6 m \cdot \rho)^2}

    The first is what torsos give, the second what noise makes of distances that are lifted: more than beside the ray,
    since depths are off by more; the third what lengths make of a limb.

    Parameters
    ----------
    pixels : float or array (F,)
        Standard deviation of image points.
    metres_per_pixel : float or array (F,)
        Depth over focal length, at the body.
    lengths : float or array (F,)
        Relative standard deviation of the limbs' lengths.

    Raises
    ------
    InputError
        Where one is negative or not finite.
    """
    given = {"pixels": pixels, "metres a pixel": metres_per_pixel, "deviations of lengths": lengths}
    noise, size, off = (np.asarray(values, dtype=np.float64) for values in given.values())
    for name, values in zip(given, (noise, size, off), strict=True):
        if not (np.isfinite(values) & (values >= 0)).all():
            raise InputError(f"the noise needs {name} that are finite and not negative")
    return np.asarray(np.hypot(np.hypot(MIN_DEVIATION_METRES, 2 * noise * size), LIMB_METRES * off))


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
