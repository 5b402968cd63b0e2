"""Cameras that were not calibrated: from an angle of view or from a 35 mm equivalent focal length."""

from __future__ import annotations

import math
from typing import Final, Literal

import numpy as np

from posekit.cameras.calibrated import CalibratedCamera
from posekit.errors import CameraError

Axis = Literal["diagonal", "horizontal", "vertical"]

FILM_DIAGONAL_MM: Final = math.hypot(36.0, 24.0)
"""Diagonal of a 35 mm film's picture, millimetres (43.27)."""
FOCAL_DEVIATION: Final = 0.05
"""Of f: angles and equivalents are rounded, taken along one axis or another, and quoted for a lens without
distortion. Rounding 26 mm to a millimetre costs 2 %; an equivalent by width instead of by diagonal 4 % at 4:3."""


def camera_from_fov(
    size: tuple[int, int],
    fov_degrees: float,
    axis: Axis = "diagonal",
    *,
    name: str = "camera",
    deviation: float = FOCAL_DEVIATION,
) -> CalibratedCamera:
    r"""Guess a camera from its angle of view, :math:`f = d / (2 \tan(\alpha / 2))`.

    Square pixels, the principal point in the middle, no distortion.

    Parameters
    ----------
    size : (int, int)
        Width and height of the picture, pixels.
    fov_degrees : float
        The angle, between 0 and 180 degrees.
    axis : str
        ``diagonal``, ``horizontal`` or ``vertical``: what the angle is across.
    deviation : float
        Standard deviation of f, as a fraction of it.

    Raises
    ------
    CameraError
        Where there is no such camera.

    Examples
    --------
    >>> float(camera_from_fov((640, 480), 90, "horizontal").K[0, 0].round(6))
    320.0
    """
    if not (math.isfinite(fov_degrees) and 0 < fov_degrees < 180):
        raise CameraError(
            f"the angle of view is {fov_degrees:g} degrees; expected more than 0 and less than 180"
        )
    _check(size)
    extents = {"diagonal": math.hypot(*size), "horizontal": size[0], "vertical": size[1]}
    if axis not in extents:
        raise CameraError(f"the angle of view is across {axis!r}; expected {', '.join(extents)}")
    f = extents[axis] / (2 * math.tan(math.radians(fov_degrees) / 2))
    how = f"a guess: {fov_degrees:g} degrees of view ({axis}), f within {100 * deviation:.0f} %"
    return _guess(name, size, f, how, deviation)


def camera_from_focal35(
    size: tuple[int, int],
    mm: float,
    *,
    name: str = "camera",
    deviation: float = FOCAL_DEVIATION,
    how: str = "",
) -> CalibratedCamera:
    r"""Guess a camera from its 35 mm equivalent focal length, :math:`f = d\,l / 43.27\,\mathrm{mm}`.

    The equivalent is that of equal diagonals, d of the picture and 43.27 mm of the film's 36 x 24 mm (CIPA
    DCG-001, "Guideline for Noting Digital Camera Specifications in Catalogs").

    Parameters
    ----------
    size : (int, int)
        Width and height of the whole picture, pixels: not of a part cut out of it.
    mm : float
        Millimetres.
    deviation : float
        Standard deviation of f, as a fraction of it.
    how : str, optional
        What to say in the camera's `how`.

    Raises
    ------
    CameraError
        Where there is no such camera.
    """
    if not (math.isfinite(mm) and 0 < mm <= 10_000):
        raise CameraError(f"the 35 mm equivalent focal length is {mm:g} mm; expected 0 to 10,000 mm")
    _check(size)
    says = how or f"a guess: {mm:g} mm equivalent to 35 mm film, f within {100 * deviation:.0f} %"
    return _guess(name, size, math.hypot(*size) * mm / FILM_DIAGONAL_MM, says, deviation)


def _check(size: tuple[int, int]) -> None:
    if len(size) != 2 or not all(isinstance(side, int) and 0 < side <= 10**6 for side in size):
        raise CameraError(f"size must be width and height in pixels, whole numbers above 0; got {size}")


def _guess(name: str, size: tuple[int, int], f: float, how: str, deviation: float) -> CalibratedCamera:
    K = np.array([[f, 0.0, (size[0] - 1) / 2], [0.0, f, (size[1] - 1) / 2], [0.0, 0.0, 1.0]])
    return CalibratedCamera(name=name, K=K, size=size, how=how, deviation=deviation)
