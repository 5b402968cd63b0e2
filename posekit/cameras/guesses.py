"""An uncalibrated camera, guessed from its angle of view."""

from __future__ import annotations

import math
from typing import Final, Literal

import numpy as np

from posekit.cameras.pinhole import PinholeCamera
from posekit.errors import CameraError, refusal

#: Relative standard deviation of f. Angles and equivalents are rounded, measured along one axis or another, and quoted
#: for a lens without distortion. Rounding 26 mm to a millimetre costs 2 %; an equivalent by width instead of by
#: diagonal 4 % at 4:3.
FOCAL_DEVIATION: Final = 0.05


def camera_from_fov(
    size: tuple[int, int],
    fov_degrees: float,
    axis: Literal["diagonal", "horizontal", "vertical"] = "diagonal",
    *,
    name: str = "",
    deviation: float = FOCAL_DEVIATION,
) -> PinholeCamera:
    r"""Guess a camera from its angle of view, :math:`f = d / (2 \tan(\alpha / 2))`.

    Pixels are square, the principal point is in the middle, and there is no distortion.

    Parameters
    ----------
    size : (int, int)
        Width and height of the whole picture, pixels.
    fov_degrees : float
        The angle, between 0 and 180 degrees.
    axis : str
        ``diagonal``, ``horizontal`` or ``vertical``: direction of the angle.
    deviation : float
        Standard deviation of f as a fraction of it.

    Raises
    ------
    CameraError
        If the numbers describe no camera.

    Examples
    --------
    >>> float(camera_from_fov((640, 480), 90, "horizontal").K[0, 0].round(6))
    320.0
    """
    if not 0 < fov_degrees < 180:
        raise refusal("camera", "fov", f"{fov_degrees:g}", "degrees between 0 and 180", error=CameraError)
    extents = {"diagonal": math.hypot(*size), "horizontal": size[0], "vertical": size[1]}
    f = extents[axis] / (2 * math.tan(math.radians(fov_degrees) / 2))
    how = f"a guess: {fov_degrees:g} degrees of view ({axis}), f within {100 * deviation:.0f} %"
    K = np.array([[f, 0.0, (size[0] - 1) / 2], [0.0, f, (size[1] - 1) / 2], [0.0, 0.0, 1.0]])
    return PinholeCamera(name=name, K=K, size=size, how=how, deviation=deviation)
