"""All that a frame can be: the bodies that it lists, how sure each is, and how probable."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from posekit.errors import InputError
from posekit.geometry import Array

FLOOR_METRES: Final = 1e-3
"""Metres, added to every covariance: what is given, as a neck is, is not known better."""


@dataclass(frozen=True, kw_only=True, eq=False)
class ListedBodies:
    """The N bodies of a frame.

    Parameters
    ----------
    joints : array (N, 14, 3)
        Camera frame, metres; NaN where a joint is not known.
    probability : array (N,)
        They sum to one.
    uncertainty : array (N, 14, 3, 3) or float
        The covariance of every joint, square metres, NaN where it is not known; or the metres that all joints are off
        in each direction.

    Raises
    ------
    InputError
        Where there are not as many probabilities, or covariances, as bodies.
    """

    joints: Array
    probability: Array
    uncertainty: Array | float = 0.0

    def __post_init__(self) -> None:
        joints = np.asarray(self.joints, dtype=np.float64)
        shapes = {"joints": (len(joints), 14, 3), "probability": (len(joints),)}
        if not isinstance(self.uncertainty, float | int):
            shapes["uncertainty"] = (len(joints), 14, 3, 3)
        for name, shape in shapes.items():
            values = np.asarray(getattr(self, name), dtype=np.float64).view()
            if values.shape != shape:
                raise InputError(f"{name} has shape {values.shape}; expected {shape}, one a body")
            values.flags.writeable = False
            object.__setattr__(self, name, values)

    def __len__(self) -> int:
        """Count the bodies."""
        return len(self.joints)

    @property
    def covariance(self) -> Array:
        """The covariance of every joint (N, 14, 3, 3), square metres, of full rank; NaN where it is not known."""
        given = self.uncertainty
        if isinstance(given, float | int):
            given = np.broadcast_to(np.eye(3) * given**2, (len(self), 14, 3, 3))
        return np.asarray(given + np.eye(3) * FLOOR_METRES**2)

    @property
    def depth_variance(self) -> Array:
        """The variance of every joint's depth (N, 14), square metres; NaN where it is not known."""
        given = self.uncertainty
        own = np.full((len(self), 14), given**2) if isinstance(given, float | int) else given[..., 2, 2]
        return np.asarray(own + FLOOR_METRES**2)
