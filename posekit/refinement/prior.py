"""Where the root is known to be before the image is looked at."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from posekit.cameras import Camera, PinholeCamera
from posekit.errors import InputError
from posekit.geometry import Array

MAX_ROOT_METRES = 1e6
"""Metres beyond which a root is taken for a mistake."""

MIN_ROOT_DEVIATION_METRES = 1e-6
"""Metres: least standard deviation that a root is given; a root that is known exactly is known to a micrometre."""


@dataclass(frozen=True, kw_only=True, eq=False)
class RootPrior:
    """The neck of F frames from elsewhere than its image point: a marker, a depth camera, the frame before.

    Parameters
    ----------
    mean : array (F, 3)
        Camera frame, metres; NaN where nothing is known.
    covariance : array (F, 3, 3)
        Square metres, symmetric, not negative; zero for a root that is known exactly.
    by_size : bool array (F,), optional
        Roots that were found by the figure's size: a larger body is farther away. None of them if not given.

    Raises
    ------
    InputError
        Where a shape is wrong or a covariance is none.
    """

    mean: Array
    covariance: Array
    by_size: NDArray[np.bool_] = field(default_factory=lambda: np.zeros(0, dtype=np.bool_))

    def __post_init__(self) -> None:
        mean, covariance = np.array(self.mean, dtype=np.float64), np.array(self.covariance, dtype=np.float64)
        if mean.ndim != 2 or mean.shape[1] != 3:
            raise InputError(f"the root's mean has shape {mean.shape}; expected (F, 3), metres")
        if covariance.shape != (len(mean), 3, 3):
            raise InputError(
                f"the root's covariance has shape {covariance.shape}; expected ({len(mean)}, 3, 3)"
            )
        known = np.isfinite(mean).all(axis=1)
        if (np.abs(mean[known]) > MAX_ROOT_METRES).any():
            raise InputError(
                f"a root is {np.abs(mean[known]).max():g} m away; expected at most {MAX_ROOT_METRES:g} m"
            )
        part = covariance[known]
        if not np.isfinite(part).all() or np.abs(part - part.transpose(0, 2, 1)).max(initial=0.0) > 1e-9:
            raise InputError("the root's covariance must be finite and symmetric where the root is known")
        if len(part) and float(np.linalg.eigvalsh(part).min()) < -1e-12:
            raise InputError(
                "the root's covariance has a negative variance; expected square metres, zero or more"
            )
        by_size = np.array(self.by_size) if len(self.by_size) else np.zeros(len(mean), dtype=np.bool_)
        if by_size.shape != (len(mean),) or by_size.dtype != np.bool_:
            raise InputError(
                f"by_size has shape {by_size.shape} of {by_size.dtype}; expected ({len(mean)},) of bool"
            )
        for name, value in (("mean", mean), ("covariance", covariance), ("by_size", by_size)):
            value.flags.writeable = False
            object.__setattr__(self, name, value)

    @staticmethod
    def along_ray(
        camera: Camera, mean: Array, *, depth: Array | float, lateral: Array | float = 0.0
    ) -> RootPrior:
        """Make the prior of roots (F, 3) whose depth is known to `depth` and whose place beside the ray to `lateral`.

        Parameters
        ----------
        camera : Camera
            A pinhole camera, or one whose rays are parallel to z.
        mean : array (F, 3)
            Camera frame, metres.
        depth, lateral : float or array (F,)
            Standard deviations along the ray and across it, metres.
        """
        mean = np.asarray(mean, dtype=np.float64)
        along, across = (
            np.broadcast_to(np.asarray(value, dtype=np.float64), len(mean)) for value in (depth, lateral)
        )
        if not (np.isfinite(along) & (along >= 0) & np.isfinite(across) & (across >= 0)).all():
            raise InputError("the root's standard deviations must be finite, zero or more, metres")
        if isinstance(camera, PinholeCamera):
            ray = mean / np.linalg.norm(mean, axis=1, keepdims=True)
        else:
            ray = np.broadcast_to(np.array([0.0, 0.0, 1.0]), mean.shape)
        # Covariance along the ray r: lateral^2 (I - r r') + depth^2 r r'.
        outer = ray[:, :, None] * ray[:, None, :]
        across_squared, along_squared = across[:, None, None] ** 2, along[:, None, None] ** 2
        covariance = across_squared * (np.eye(3) - outer) + along_squared * outer
        return RootPrior(mean=mean, covariance=covariance)

    def widened(self, size: float) -> RootPrior:
        """Let roots vary along their rays by as much as the size of the body, a relative standard deviation."""
        if not size:
            return self
        mean = np.where(self.by_size[:, None], 0.0, self.mean)
        return replace(self, covariance=self.covariance + size**2 * mean[:, :, None] * mean[:, None, :])

    def whitening(self) -> Array:
        """Return W (F, 3, 3) with W' W the inverse covariance; zero where nothing is known."""
        known = np.isfinite(self.mean).all(axis=1)
        W = np.zeros((len(self.mean), 3, 3))
        if known.any():
            values, vectors = np.linalg.eigh(self.covariance[known])
            W[known] = (
                vectors.transpose(0, 2, 1)
                / np.sqrt(np.maximum(values, MIN_ROOT_DEVIATION_METRES**2))[:, :, None]
            )
        return W
