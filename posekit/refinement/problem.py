"""What is minimised: image points, root, lengths and limits, each divided by its standard deviation."""

from __future__ import annotations

from dataclasses import dataclass, field, fields, replace

import numpy as np
from numpy.typing import NDArray

from posekit.geometry import Array
from posekit.refinement.figure_numbers import FigureNumbers
from posekit.refinement.optics import Optics
from posekit.refinement.walls import Walls


@dataclass(frozen=True, kw_only=True, eq=False)
class RefinementProblem:
    """The data of N postures; the batch is the last axis.

    Parameters
    ----------
    anatomy : FigureNumbers
        The figure's lengths and limits.
    optics : Optics
        The camera, with the batch as its last axis.
    image, weight : array (14, 2, N), (14, N)
        Pixels, and one over their standard deviation; zero where a joint was not seen.
    head_image, head_weight : array (5 + K, 2, N), (5 + K, N), optional
        Likewise the head's points.
    root, root_weight : array (3, N), (3, 3, N)
        Where the neck is known to be, and the whitening of its uncertainty: zero where nothing is known.
    limit_deviation : float
        Radians; infinite for no limits.
    shape_weight, limb_weight : array (9,), (4, 2), optional
        One over the relative standard deviations of the trunk's nine distances, and of the limbs' lengths, where
        lengths are varied.
    free : bool array (4, N), optional
        Limbs without limits.
    walls : Walls, optional
        Limits of the limbs in place of the anatomy's.
    trunk_only : bool
        Leave the limbs as they are, and unseen.
    own_head : array (K, 3)
        The head's points besides the anatomy's, from the neck, head link's frame, metres.
    """

    anatomy: FigureNumbers
    optics: Optics
    image: Array
    weight: Array
    root: Array
    root_weight: Array
    limit_deviation: float
    head_image: Array | None = None
    head_weight: Array | None = None
    shape_weight: Array | None = None
    limb_weight: Array | None = None
    free: NDArray[np.bool_] | None = None
    walls: Walls | None = None
    trunk_only: bool = False
    own_head: Array = field(default_factory=lambda: np.empty((0, 3)))

    def take(self, rows: NDArray[np.intp] | slice) -> RefinementProblem:
        """Return the data of some postures."""
        changed: dict[str, object] = {"optics": self.optics.take(rows)}
        for item in fields(self):
            value = getattr(self, item.name)
            if item.name in PER_POSTURE and value is not None:
                changed[item.name] = value[..., rows]
        return replace(self, **changed)  # type: ignore[arg-type]

    def trunk_alone(self) -> RefinementProblem:
        """Return the same problem with the limbs left out."""
        return replace(self, trunk_only=True)

    def linearised_image(self, points: Array, joints: slice) -> tuple[Array, Array]:
        """Return residuals (J, 2, N) of some joints' image points, and their derivative (J, 2, 3, N) along the joints.

        Residuals are huge, and derivatives zero, where a joint that was seen is behind the camera.
        """
        return _whitened(*self.optics.project(points), self.image[joints], self.weight[joints])

    def image_residuals(self, points: Array, joints: slice) -> Array:
        """Return the residuals alone."""
        return _residual(self.optics.image(points), self.image[joints], self.weight[joints])

    def linearised_head(self, points: Array) -> tuple[Array, Array]:
        """Do for the head's points (5 + K, 3, N) what `linearised_image` does for joints."""
        image, jacobian = self.optics.project(points)
        if self.head_image is None or self.head_weight is None:
            return np.zeros((0, 2, points.shape[2])), jacobian[:0]
        return _whitened(image, jacobian, self.head_image, self.head_weight)

    @property
    def limited(self) -> bool:
        """Whether there are limits."""
        return bool(np.isfinite(self.limit_deviation))

    @property
    def legs_on_torso(self) -> bool:
        """Whether legs, too, are judged in the torso's frame."""
        return self.walls is not None and self.walls.on_torso

    @property
    def trunk_width(self) -> int:
        """How many numbers of the trunk are varied."""
        return 9 if self.shape_weight is None else 18

    @property
    def limb_width(self) -> int:
        """How many numbers of a limb are varied."""
        return 4 if self.limb_weight is None else 6


BLOCK_POSTURES = 2048
"""Postures worked on at once: enough to spread the overhead of each operation."""

PER_POSTURE = ("image", "weight", "head_image", "head_weight", "root", "root_weight", "free")


def _residual(image: Array, seen: Array, weight: Array) -> Array:
    residual = (image - seen) * weight[:, None]
    behind = np.isnan(residual)
    if behind.any():
        residual[behind] = np.broadcast_to(
            np.where(weight > 0, BEHIND_CAMERA_RESIDUAL, 0.0)[:, None], residual.shape
        )[behind]
    return residual


def _whitened(image: Array, jacobian: Array, seen: Array, weight: Array) -> tuple[Array, Array]:
    residual = _residual(image, seen, weight)
    jacobian *= weight[:, None, None]
    wrong = np.isnan(jacobian)
    if wrong.any():
        jacobian[wrong] = 0.0
    return residual, jacobian


BEHIND_CAMERA_RESIDUAL = 1e100
"""Standard deviations by which a joint behind the camera is off."""
