r"""Knowledge of a body before any posture: image points, the root, lengths and limits, each with its deviation.

The unknowns of a frame are its 14 joint positions in the camera frame and the logarithm s of a size that all lengths
share. With :math:`\pi` the projection, the residuals are

.. math::

   W_j (\pi(X_j) - r_j), \quad W_0 (X_0 - \mu), \quad
   \frac{\ln|X_a - X_b| - \ln l_{ab} - s}{\sigma_{ab}}, \quad \frac{s}{\sigma_s}, \quad
   \frac{\text{angle beyond its limit}}{\sigma_\text{limit}} .
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from posekit.cameras import Camera
from posekit.geometry import Array, Flags, Ints
from posekit.skeleton import JOINTS, SEGMENTS
from posekit.solver.limits import Limits

#: Relative deviation of lengths that are given as exact: two millimetres a metre, below which steps become short.
LEAST_LENGTH_DEVIATION: Final = 2e-3

#: Standard deviation (radians) with which joint limits are known.
LIMIT_DEVIATION: Final = float(np.radians(2.0))

#: Standard deviations at which a detector's image point keeps half of its squared residual (Geman & McClure 1985).
ROBUST_DEVIATIONS: Final = 4.0

#: One over metres: holds the depth of the neck before a camera without perspective, which does not show it.
HELD_DEPTH_WEIGHT: Final = 1e3

#: Standard deviation (metres) of a given neck position whose uncertainty is not stated.
EXACT_ROOT_METRES: Final = 2e-4

#: Names of the residuals of `posekit.solver.modes.Modes.residuals`, limits aside.
RESIDUAL_NAMES: Final = (
    *(f"image {joint}" for joint in JOINTS),
    *(f"length {JOINTS[min(pair)]}-{JOINTS[max(pair)]}" for pair in SEGMENTS),
    "root",
    "size",
)

#: A frame as the compiled solver reads it.
PROBLEM: Final = np.dtype(
    [
        ("ray", "f8", (14, 2)),
        ("image", "f8", (14, 2, 2)),
        ("root", "f8", (3,)),
        ("root_weight", "f8", (3, 3)),
        ("log_length", "f8", (17,)),
        ("length_weight", "f8", (17,)),
        ("size_weight", "f8"),
        ("limit_weight", "f8"),
        ("perspective", "f8"),
        ("robust", "f8"),
    ]
)


PER_FRAME: Final = "rays whitening log_lengths length_deviation size_deviation root root_whitening".split()


@dataclass(frozen=True, kw_only=True, eq=False)
class Problem:
    """F frames to be solved, each alone.

    Parameters
    ----------
    rays : array (F, 14, 2)
        Image points free of intrinsics and lens: x/z and y/z; x and y in metres before a scaled orthographic camera.
        Zero where a joint is hidden.
    whitening : array (F, 14, 2, 2)
        Maps an error of a ray to standard deviations of the image point; zero where a joint is hidden.
    log_lengths, length_deviation : array (F, 17)
        Natural logarithms of the lengths (metres) in the order of `posekit.skeleton.SEGMENTS`, and their deviations.
    size_deviation : array (F,)
        Standard deviation of the logarithm of the shared size; 0 if the lengths are of the person's own size.
    root, root_whitening : array (F, 3), (F, 3, 3)
        Known position of the neck, metres, and the inverse square root of its covariance; zero if unknown.
    perspective : bool
        Whether the camera has an optical centre.
    limits : Limits, optional
        Joint ranges that pull at postures beyond them.
    limit_deviation : float
        Radians.
    robust : bool
        Whether the image's residuals are bounded, for detectors, whose points may be gross errors.
    """

    rays: Array
    whitening: Array
    log_lengths: Array
    length_deviation: Array
    size_deviation: Array
    root: Array
    root_whitening: Array
    perspective: bool = True
    limits: Limits | None = None
    limit_deviation: float = LIMIT_DEVIATION
    robust: bool = False

    @staticmethod
    def seen(
        camera: Camera,
        image: Array,
        deviation: ArrayLike,
        *,
        lengths: ArrayLike,
        length_deviation: ArrayLike = 0.0,
        size_deviation: ArrayLike = 0.0,
        root: Array | None = None,
        root_covariance: Array | None = None,
        limits: Limits | None = None,
        robust: bool = False,
    ) -> Problem:
        """Lay out what a camera saw.

        Parameters
        ----------
        camera : Camera
            Pinhole, scaled orthographic or Lee & Chen's; its first axis, where it has one, counts frames.
        image : array (F, 14, 2)
            Image points, pixels; NaN where a joint is hidden.
        deviation : float or array broadcastable to (F, 14)
            Standard deviation of each coordinate, pixels.
        lengths : array (17,) or (F, 17)
            Metres, in the order of `posekit.skeleton.SEGMENTS`.
        length_deviation, size_deviation : float or array broadcastable to (F, 17), (F,)
            Relative standard deviations of each length, and of the size that all lengths share.
        root : array (F, 3), optional
            Known position of the neck, metres; NaN where it is not known.
        root_covariance : array (3, 3) or (F, 3, 3), optional
            Its covariance, square metres; (2 mm)^2 if not given.
        limits, robust
            See `Problem`.
        """
        count = len(image)
        rays = camera.normalize(image)
        hidden = np.asarray(np.isnan(rays).any(axis=-1))
        rays = np.where(hidden[..., None], 0.0, rays)
        sigma = np.broadcast_to(np.asarray(deviation, dtype=np.float64), (count, 14))
        whitening = camera.jacobian(rays) / sigma[..., None, None]
        whitening = np.where((hidden | ~np.isfinite(sigma))[..., None, None], 0.0, whitening)
        place, weight = np.zeros((count, 3)), np.zeros((count, 3, 3))
        if not camera.perspective:
            weight[:, 2, 2] = HELD_DEPTH_WEIGHT
        if root is not None:
            known = np.asarray(np.isfinite(root).all(axis=1))
            place[known] = root[known]
            spread = np.eye(3) * EXACT_ROOT_METRES**2 if root_covariance is None else root_covariance
            spread = np.broadcast_to(spread, (count, 3, 3))[known] + np.eye(3) * 1e-12
            weight[known] = np.linalg.inv(np.linalg.cholesky(spread))
        return Problem(
            rays=rays,
            whitening=whitening,
            log_lengths=np.log(np.broadcast_to(np.asarray(lengths, dtype=np.float64), (count, 17))),
            length_deviation=np.broadcast_to(np.asarray(length_deviation, dtype=np.float64), (count, 17)),
            size_deviation=np.broadcast_to(np.asarray(size_deviation, dtype=np.float64), (count,)),
            root=place,
            root_whitening=weight,
            perspective=camera.perspective,
            limits=limits,
            robust=robust,
        )

    def __len__(self) -> int:
        """Return the number of frames."""
        return len(self.rays)

    def take(self, frames: Ints | slice) -> Problem:
        """Return some frames."""
        return replace(self, **{name: getattr(self, name)[frames] for name in PER_FRAME})

    @cached_property
    def seen_joints(self) -> Flags:
        """Which joints have an image point (F, 14)."""
        return np.asarray((self.whitening != 0).any(axis=(2, 3)))

    @property
    def rooted(self) -> Flags:
        """In which frames the position of the neck is known (F,)."""
        return np.asarray((self.root_whitening != 0).any(axis=2).all(axis=1))

    @property
    def freedom(self) -> Ints:
        """Degrees of freedom of chi2 (F,): image coordinates and priors that are left over.

        A limb has as many unknowns as image coordinates, or more. What is left over are the torso's points and the
        root against six unknowns, and the hips' points against three.
        """
        seen = self.seen_joints
        priors = (self.root_whitening != 0).any(axis=2).sum(axis=1) - (self.size_deviation > 0)
        torso = 2 * seen[:, :4].sum(axis=1) + priors - 6
        return np.asarray(np.maximum(torso, 0) + np.maximum(2 * seen[:, 4:6].sum(axis=1) - 3, 0))

    @cached_property
    def records(self) -> NDArray[np.void]:
        """The frames as numbers (F,) of `PROBLEM`."""
        out = np.zeros(len(self), dtype=PROBLEM)
        out["ray"], out["image"] = self.rays, self.whitening
        out["root"], out["root_weight"] = self.root, self.root_whitening
        out["log_length"] = self.log_lengths
        out["length_weight"] = 1 / np.maximum(self.length_deviation, LEAST_LENGTH_DEVIATION)
        some = self.size_deviation > 0
        out["size_weight"] = np.where(some, 1 / np.where(some, self.size_deviation, 1.0), 0.0)
        out["limit_weight"] = 0.0 if self.limits is None else 1 / self.limit_deviation
        out["perspective"], out["robust"] = self.perspective, ROBUST_DEVIATIONS**2 * self.robust
        return out
