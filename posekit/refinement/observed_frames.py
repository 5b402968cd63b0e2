"""What is known of F frames before any posture: image points and their noise, the root, lengths and limits."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from posekit.body import Figure
from posekit.body.angles import Limits
from posekit.cameras import Camera
from posekit.errors import InputError
from posekit.geometry import Array
from posekit.refinement.figure_numbers import FigureNumbers
from posekit.refinement.inputs import batch_last, length_weights, numbers, root_of, weights
from posekit.refinement.optics import optics_of
from posekit.refinement.prior import RootPrior
from posekit.refinement.problem import RefinementProblem
from posekit.refinement.walls import Walls
from posekit.skeleton import HEAD_POINTS, JOINTS

LIMIT_DEVIATION = 2.0
"""Degrees: standard deviation with which limits of joints are known, unless told otherwise."""

MAX_COORDINATE_PIXELS = 1e8
"""Pixels beyond which key points are taken for as far: no posture is seen there, and squares stay finite."""

DEPTH_HOLD_PER_METRE = 1e6
"""One over metres: what holds the depth of a root that the camera does not see."""


@dataclass(frozen=True, kw_only=True, eq=False)
class ObservedFrames:
    """F frames as they were seen.

    Parameters
    ----------
    figure : Figure
        The person: lengths, limits, the head's points.
    camera : Camera
        A pinhole or scaled orthographic one; its first axis, where it has one, counts frames.
    image : array (F, 14, 2)
        Key points, pixels; NaN where a joint was not seen.
    deviation : float or array broadcastable to (F, 14)
        Their standard deviations in each coordinate, pixels; a joint whose deviation is infinite counts as not seen.
    root : RootPrior, optional
        What is known of the neck besides its key point. A scaled orthographic camera leaves its depth open; it is then
        held where it is, and uncertainties are those relative to it.
    head_image, head_deviation : array (F, 5 + K, 2), float or array (F, 5 + K), optional
        The head's key points; their deviation is a pixel unless told otherwise.
    length_deviation : float or mapping
        Relative standard deviation of all lengths, or by segment name ``a-b``; lengths are held where it is zero.
    size_deviation : float
        Standard deviation of the logarithm of the body's size, which all lengths share; zero behind a camera without
        a perspective, whose scale says the same.
    limits : Limits, optional
        The figure's unless told otherwise.
    limit_deviation : float
        Degrees; infinite for no limits.
    walls : Walls, optional
        Limits of the limbs in place of those in `limits`: what couples angles, or is no angle of the figure's.
    own_head : array (K, 3)
        Points of the head besides the figure's, from its neck, the head's frame (x forward, y up, z right), metres.

    Raises
    ------
    InputError
        Where a shape is wrong, a deviation is not positive, or a name is unknown.
    """

    figure: Figure
    camera: Camera
    image: ArrayLike
    deviation: ArrayLike
    root: RootPrior | None = None
    head_image: ArrayLike | None = None
    head_deviation: ArrayLike | None = None
    length_deviation: Mapping[str, float] | float = 0.0
    size_deviation: float = 0.0
    limits: Limits | None = None
    limit_deviation: float = LIMIT_DEVIATION
    walls: Walls | None = None
    own_head: ArrayLike = ()

    def points(self) -> Array:
        """Return the key points (F, 14, 2)."""
        return np.clip(
            numbers("image", self.image, (None, len(JOINTS), 2)),
            -MAX_COORDINATE_PIXELS,
            MAX_COORDINATE_PIXELS,
        )

    def roots(self) -> RootPrior | None:
        """Return where the necks of bodies of the figure's size are: as far off as the size is, too."""
        return None if self.root is None else self.root.widened(self.size_deviation)

    def problem(self, frames: NDArray[np.intp], necks: Array) -> RefinementProblem:
        """Lay out the data of survivors in some frames (N,); their necks (N, 3) are where a root is held."""
        points = self.points()
        count = len(points)
        if not self.limit_deviation > 0:
            raise InputError(
                f"the limits' deviation is {self.limit_deviation!r} degrees; expected a positive number"
            )
        weight = weights("deviation", self.deviation, points)
        shape_weight, limb_weight = length_weights(self.length_deviation)
        optics = optics_of(self.camera, frames)
        mean, whitening = root_of(self.roots(), count)
        held = np.zeros((3, 3))
        held[2, 2] = 0.0 if optics.perspective else DEPTH_HOLD_PER_METRE
        known = np.asarray(np.isfinite(mean).all(axis=1))[frames]
        root = np.where(known[:, None], mean[frames], necks)
        own = np.asarray(self.own_head, dtype=np.float64).reshape(-1, 3)
        head = head_weight = None
        if self.head_image is not None:
            head = np.clip(
                numbers("head_image", self.head_image, (count, len(HEAD_POINTS) + len(own), 2)),
                -MAX_COORDINATE_PIXELS,
                MAX_COORDINATE_PIXELS,
            )
            given = 1.0 if self.head_deviation is None else self.head_deviation
            head_weight = weights("head_deviation", given, head)
        seen = head is not None and head_weight is not None and bool(head_weight.any())
        return RefinementProblem(
            anatomy=FigureNumbers.of(self.figure, self.limits),
            optics=optics,
            image=batch_last(np.nan_to_num(points[frames])),
            weight=batch_last(weight[frames]),
            root=batch_last(np.nan_to_num(root)),
            root_weight=batch_last(np.where(known[:, None, None], whitening[frames], held)),
            limit_deviation=float(np.radians(self.limit_deviation)),
            head_image=batch_last(np.nan_to_num(head[frames])) if seen and head is not None else None,
            head_weight=batch_last(head_weight[frames]) if seen and head_weight is not None else None,
            shape_weight=shape_weight,
            limb_weight=limb_weight,
            walls=self.walls,
            own_head=own[:, [0, 2, 1]] * [1.0, -1.0, 1.0],
        )
