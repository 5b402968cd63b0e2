"""Which way is up in the camera's frame, and who says so."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from posekit.display.short_repr import ShortRepr
from posekit.errors import InputError
from posekit.geometry import Array

LEVEL_WITHIN = 20.0
"""Degrees by which a camera that is taken to be level may not be: its standard deviation."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Up(ShortRepr):
    """The direction against gravity.

    Parameters
    ----------
    direction : array (3,) or (F, 3)
        In the frame of the postures (OpenCV: x right, y down, z forward), of any length; one for all frames or one a
        frame, NaN for a frame of which it is not known.
    deviation : float
        Its standard deviation, degrees, less than 90.
    says : str
        Where it comes from, as a result shall put it.

    Raises
    ------
    InputError
        Where it is no direction.

    Examples
    --------
    >>> Up(direction=[0, -2, 0]).direction.tolist()
    [0.0, -1.0, 0.0]
    >>> Up.level().says
    'assumed: a level camera, within 20 degrees'
    """

    direction: Array
    deviation: float = 0.0
    says: str = "known"

    def __post_init__(self) -> None:
        given = np.array(self.direction, dtype=np.float64)
        if given.shape[-1:] != (3,) or given.ndim > 2:
            raise InputError(
                f"up has shape {given.shape}; expected (3,) or (F, 3), x right, y down, z forward"
            )
        length = np.linalg.norm(given, axis=-1, keepdims=True)
        known = ~np.isnan(given).any(axis=-1)
        if not (np.isfinite(length[known]) & (length[known] > 0)).all() or (given.ndim == 1 and not known):
            raise InputError("up has a vector without a direction; expected finite vectors, not zero")
        if not (math.isfinite(self.deviation) and 0 <= self.deviation < 90):
            raise InputError(
                f"up has a deviation of {self.deviation!r} degrees; expected 0 up to less than 90"
            )
        direction = given / length
        direction.flags.writeable = False
        object.__setattr__(self, "direction", direction)

    @staticmethod
    def level(deviation: float = LEVEL_WITHIN) -> Up:
        """Take the camera to be level: up is against the image's y, within a standard deviation in degrees."""
        return Up(
            direction=np.array([0.0, -1.0, 0.0]),
            deviation=deviation,
            says=f"assumed: a level camera, within {deviation:g} degrees",
        )

    @staticmethod
    def of_camera(R_cam_world: ArrayLike, up_world: ArrayLike, *, says: str = "known") -> Up:
        """Turn the world's up into a camera's frame: R_cam_world is (3, 3) or (F, 3, 3)."""
        direction = np.asarray(R_cam_world, dtype=np.float64) @ np.asarray(up_world, dtype=np.float64)
        return Up(direction=direction, says=says)

    @property
    def sine(self) -> float:
        """The sine of the deviation."""
        return math.sin(math.radians(self.deviation))
