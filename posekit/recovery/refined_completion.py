"""Joints that were not seen, of survivors that were refined: regions about the likeliest places of those that were."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Final

import numpy as np
from numpy.typing import NDArray

from posekit.cameras import Camera, PinholeCamera
from posekit.geometry import Array
from posekit.recovery.certified import certifying_checks
from posekit.recovery.grower import Grower
from posekit.recovery.noise import Noise
from posekit.recovery.refined import RefinedSurvivors
from posekit.settings import MEASURED_TOLERANCE, RIGID_TOLERANCE, Tolerance
from posekit.skeleton import JOINTS, PARENTS, TREE_SEGMENTS, segment_name
from posekit.tree import Check

if TYPE_CHECKING:
    from posekit.hidden import CompletedSurvivors

TOLD_DEVIATIONS: Final = 2.5
"""Standard deviations by which regions are wider: of what they hang on, and of lengths beside the body's size."""


@dataclass(frozen=True, kw_only=True)
class RefinedCompletion:
    """Completes survivors that were refined.

    A body of size s at the root R looks as one of size 1 at R / s: survivors are completed in the figure's own size,
    and made as large as they are again about the camera.

    Parameters
    ----------
    grower : Grower
        Whose body and settings count.
    noise : Noise
        How well lengths are known.
    tolerance : Tolerance
        What refined postures may be off.
    checks : callable
        Whether a check can be told at all.
    """

    grower: Grower
    noise: Noise
    tolerance: Tolerance
    checks: Callable[[Check], bool]

    @cached_property
    def allowed(self) -> Tolerance:
        """How far lengths of the figure's own size may be off, metres: less than those of a body of any size."""
        lengths = self.grower.body.figure.lengths
        off = TOLD_DEVIATIONS * max(self.noise.lengths.own[name] * length for name, length in lengths.items())
        rigid = min(max(RIGID_TOLERANCE, off), self.tolerance.rigid)
        return replace(
            self.tolerance,
            rigid=rigid,
            tangent=max(MEASURED_TOLERANCE.tangent, off),
            hips=MEASURED_TOLERANCE.hips,
        )

    def complete(
        self,
        survivors: RefinedSurvivors,
        hypothesis: NDArray[np.intp],
        camera: Camera,
        image: Array,
        frame: NDArray[np.intp],
    ) -> CompletedSurvivors | None:
        """Describe where joints that were not seen can be; None where all were.

        Parameters
        ----------
        survivors : RefinedSurvivors
            N of them.
        hypothesis : int array (N,)
            The hypothesis of each.
        camera : Camera
            Of the hypotheses.
        image : array (H, 14, 2)
            What each hypothesis saw, pixels.
        frame : int array (H,)
            The view's frame of each.
        """
        worth = self.grower.worth_completing(hypothesis, image, frame, self.allowed)
        if not worth.any():
            return None
        from posekit.hidden import complete_points

        figure, settings = self.grower.body.figure, self.grower.settings
        joints = survivors.joints[worth]
        size = self._size(joints) if isinstance(camera, PinholeCamera) else np.ones(len(joints))
        done = complete_points(
            np.concatenate([joints, survivors.head[worth]], axis=1) / size[:, None, None],
            hypothesis[worth],
            camera,
            image,
            figure,
            [check for check in certifying_checks(figure, settings, self.allowed) if self.checks(check)],
            tolerance=self.allowed.tangent,
        )
        margin = TOLD_DEVIATIONS * _deviation(survivors.covariance[worth])
        done = done.scaled(size, margin)
        return done.among(survivors.joints, worth)

    def _size(self, joints: Array) -> Array:
        """Return how many times as large as the figure bodies (N, 14, 3) are: the mean of what is known of segments."""
        lengths = self.grower.body.figure.lengths
        ratio = [
            np.linalg.norm(joints[:, a] - joints[:, b], axis=1) / lengths[segment_name((a, b))]
            for a, b in TREE_SEGMENTS
        ]
        known = np.isfinite(ratio)
        mean = np.log(np.where(known, ratio, 1.0)).sum(axis=0) / np.maximum(known.sum(axis=0), 1)
        return np.asarray(np.exp(mean))


def _deviation(covariance: Array) -> Array:
    """Return how far joints are off along each axis (N, 14, 3), metres; unknown ones as what they hang on."""
    deviation = np.sqrt(np.einsum("njkk->njk", covariance))
    for joint in range(1, len(JOINTS)):
        unknown = np.isnan(deviation[:, joint])
        deviation[:, joint] = np.where(unknown, deviation[:, PARENTS[joint]], deviation[:, joint])
    return np.asarray(deviation)
