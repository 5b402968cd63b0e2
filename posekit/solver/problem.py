r"""The data of the solver: image points, root, segment lengths and joint limits, each with its standard deviation.

The unknowns of a frame are the 14 joint positions X in the camera frame, and the logarithm s of a common factor on all
segment lengths. Let :math:`\pi` be the projection, r the normalised image points, :math:`\mu` the known neck position,
and l the given segment lengths. The residuals, in standard deviations, are

.. math::

   W_j (\pi(X_j) - r_j), \quad W_0 (X_0 - \mu), \quad
   \frac{\ln|X_a - X_b| - \ln l_{ab} - s}{\sigma_{ab}}, \quad \frac{s}{\sigma_s}, \quad
   \frac{\text{angle beyond its limit}}{\sigma_\text{limit}} .
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from posekit.cameras import Camera
from posekit.geometry import Array, Flags, Ints, unit
from posekit.skeleton import JOINTS, SEGMENTS
from posekit.solver.limits import Limits

#: Smallest relative standard deviation of lengths, also of exact lengths. With smaller values the solver's steps become
#: short.
LEAST_LENGTH_DEVIATION: Final = 2e-3

#: Standard deviation (radians) with which joint limits are known.
LIMIT_DEVIATION: Final = float(np.radians(2.0))

#: Error of a detected image point, in standard deviations, that halves its squared residual (Geman & McClure 1985).
ROBUST_DEVIATIONS: Final = 4.0

#: Weight (1/metres) that fixes the depth of the neck for a camera without perspective, whose image does not depend on
#: it.
HELD_DEPTH_WEIGHT: Final = 1e3

#: Standard deviation (metres) of a given neck position whose uncertainty is not stated.
EXACT_ROOT_METRES: Final = 2e-4

#: Names of the residuals of `posekit.solver.modes.Modes.residuals`, except limits.
RESIDUAL_NAMES: Final = (
    *(f"image {joint}" for joint in JOINTS),
    *(f"length {JOINTS[min(pair)]}-{JOINTS[max(pair)]}" for pair in SEGMENTS),
    "root",
    "size",
)

#: A frame as the solver reads it.
#:
#: `ray` has image points x/z and y/z without intrinsics and lens distortion, or x and y in metres for a scaled
#: orthographic camera. `image` maps errors of `ray` to standard deviations. Both are zero for a hidden joint. `root` is
#: the neck, metres, and `root_weight` the inverse square root of its covariance, zero if the neck is unknown. The other
#: weights are inverse standard deviations: of lengths, of the size (0 if the size is known), of limits (1/radians).
#: `robust` is one over the square of `ROBUST_DEVIATIONS`, or 0 where image points have no gross errors.
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


@dataclass(frozen=True, kw_only=True, eq=False)
class Problem:
    """Image points and prior knowledge of F frames, which the solver treats independently.

    Parameters
    ----------
    records : records (F,) of `PROBLEM`
        Data of the frames; all frames have the same kind of camera.
    limits : Limits, optional
        Joint ranges; angles beyond them have residuals.
    """

    records: NDArray[np.void]
    limits: Limits | None = None

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
        limits: Limits | None = None,
        robust: bool = False,
    ) -> Problem:
        """Make a problem from the image points of a camera and the prior knowledge of the person.

        Parameters
        ----------
        camera : Camera
            Pinhole, scaled orthographic or Lee & Chen's camera; its focal length or scale may be an array (F,).
        image : array (F, 14, 2)
            Image points, pixels; NaN where a joint is hidden.
        deviation : float or array broadcastable to (F, 14)
            Standard deviation of each coordinate of the image points, pixels.
        lengths : array (17,) or (F, 17)
            Segment lengths, metres, in the order of `posekit.skeleton.SEGMENTS`.
        length_deviation, size_deviation : float or array broadcastable to (F, 17), (F,)
            Relative standard deviations of each length, and of a common factor on all lengths.
        root : array (F, 3), optional
            Known position of the neck, metres; NaN where it is not known.
        limits : Limits, optional
            Joint ranges.
        robust : bool
            Whether the loss function of image points is bounded (robust), because detectors make gross errors.
        """
        rays = camera.normalize(image)
        hidden = np.asarray(np.isnan(rays).any(axis=-1))
        rays = np.where(hidden[..., None], 0.0, rays)
        sigma = np.broadcast_to(np.asarray(deviation, dtype=np.float64), hidden.shape)
        whitening = camera.jacobian(rays) / sigma[..., None, None]
        out = np.zeros(len(image), dtype=PROBLEM)
        out["ray"] = rays
        out["image"] = np.where((hidden | ~np.isfinite(sigma))[..., None, None], 0.0, whitening)
        if not camera.perspective:
            out["root_weight"][:, 2, 2] = HELD_DEPTH_WEIGHT
        if root is not None:
            known = np.asarray(np.isfinite(root).all(axis=1))
            out["root"][known] = root[known]
            out["root_weight"][known] = np.eye(3) / EXACT_ROOT_METRES
        out["log_length"] = np.log(lengths)
        out["length_weight"] = 1 / np.maximum(length_deviation, LEAST_LENGTH_DEVIATION)
        size = np.broadcast_to(np.asarray(size_deviation, dtype=np.float64), len(out))
        out["size_weight"][size > 0] = 1 / size[size > 0]
        out["limit_weight"] = 0.0 if limits is None else 1 / LIMIT_DEVIATION
        out["perspective"], out["robust"] = camera.perspective, robust / ROBUST_DEVIATIONS**2
        return Problem(records=out, limits=limits)

    def __len__(self) -> int:
        """Return the number of frames."""
        return len(self.records)

    def take(self, frames: Ints | slice) -> Problem:
        """Return the problem of selected frames."""
        return Problem(records=self.records[frames], limits=self.limits)

    @property
    def perspective(self) -> bool:
        """Whether the camera is a perspective camera."""
        return bool((self.records["perspective"] > 0).any())

    @cached_property
    def seen_joints(self) -> Flags:
        """Whether each joint has an image point (F, 14)."""
        return np.asarray((self.records["image"] != 0).any(axis=(2, 3)))

    @property
    def sized(self) -> Flags:
        """Whether the common factor on all lengths is unknown, for each frame (F,)."""
        return np.asarray(self.records["size_weight"] > 0)

    @property
    def rooted(self) -> Flags:
        """Whether the position of the neck is known, for each frame (F,)."""
        return np.asarray((self.records["root_weight"] != 0).any(axis=2).all(axis=1))

    @property
    def freedom(self) -> Ints:
        """Degrees of freedom of chi2 (F,): number of image coordinates and priors minus number of unknowns.

        Limbs contribute nothing, because a limb has at least as many unknowns as image coordinates. The torso
        contributes its image coordinates and priors minus the six unknowns of its pose. The hips contribute their image
        coordinates minus the three unknowns of their orientation. A negative contribution counts as zero.
        """
        seen = self.seen_joints
        priors = (self.records["root_weight"] != 0).any(axis=2).sum(axis=1) - self.sized
        torso = 2 * seen[:, :4].sum(axis=1) + priors - 6
        return np.asarray(np.maximum(torso, 0) + np.maximum(2 * seen[:, 4:6].sum(axis=1) - 3, 0))

    @cached_property
    def rays(self) -> tuple[Array, Array]:
        """Origins and unit directions (F, 14, 3) of the rays of the image points."""
        flat, ones = self.records["ray"], np.ones((len(self), 14, 1))
        if self.perspective:
            return np.zeros((len(self), 14, 3)), unit(np.concatenate([flat, ones], axis=2))
        return np.concatenate([flat, 0 * ones], axis=2), np.broadcast_to([0.0, 0.0, 1.0], (len(self), 14, 3))
