"""What hypotheses of a view observed, as refinement takes it: image points, necks, and how far both may be off."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from posekit.body import Figure
from posekit.body.angles import Limits
from posekit.cameras import Camera, PinholeCamera
from posekit.cameras.neck import NeckPlacement
from posekit.formats.own import View
from posekit.geometry import Array
from posekit.recovery.fit_camera import CameraFit
from posekit.recovery.noise import Noise
from posekit.refinement import ObservedFrames, RootPrior
from posekit.refinement.walls import Walls
from posekit.skeleton import JOINTS, PARENTS

LATERAL_DEVIATIONS: Final = 10.0
"""Deviations of an image point within which a placed neck may lie beside its ray: its image point says the rest."""

LEAST_STEP_METRES: Final = 0.01
"""Metres: the least deviation of a placed neck's depth."""


@dataclass(frozen=True, kw_only=True, eq=False)
class ObservedHypotheses:
    """What H hypotheses of a view saw, and how well.

    Parameters
    ----------
    sight : ObservedFrames
        Without their heads.
    deviation : array (H, 19)
        Of joints and head points, pixels.
    focal : array (H,)
        Pixels.
    step : float
        The largest deviation of a neck's depth, metres.
    """

    sight: ObservedFrames
    deviation: Array
    focal: Array
    step: float

    @property
    def worst(self) -> float:
        """The largest deviation of a joint that was seen, radians."""
        seen = np.isfinite(self.sight.points()).all(axis=2)
        angular = self.deviation[:, : len(JOINTS)] / self.focal[:, None]
        return float(np.max(angular, where=seen, initial=0.0))

    @staticmethod
    def of(
        view: View,
        fit: CameraFit,
        chosen: NDArray[np.intp],
        camera: PinholeCamera,
        figure: Figure,
        noise: Noise,
        limits: Limits | None = None,
        walls: Walls | None = None,
    ) -> ObservedHypotheses:
        """Gather what some hypotheses saw with their `camera`; `limits` are the figure's if not given.

        Those of limbs may be `walls` instead.
        """
        frames = fit.frame[chosen]
        focal = np.broadcast_to(np.sqrt(camera.K[..., 0, 0] * camera.K[..., 1, 1]), len(chosen))
        deviation = noise.of_points(view, frames, fit.root[chosen, 2], focal)
        necks, step = neck_priors(fit, chosen, camera, float((deviation[:, 0] / focal).max()))
        sight = ObservedFrames(
            figure=figure,
            camera=camera,
            image=connected(view.image[frames]),
            deviation=deviation[:, : len(JOINTS)],
            root=necks,
            length_deviation=noise.lengths.own,
            size_deviation=noise.lengths.common,
            limits=limits,
            walls=walls,
        )
        return ObservedHypotheses(sight=sight, deviation=deviation, focal=focal, step=step)


def connected(image: Array) -> Array:
    """Return image points (H, 14, 2) without those that hang on a joint that was not seen: they tell no place."""
    out = image.copy()
    for joint, parent in enumerate(PARENTS):
        if joint:
            out[np.isnan(out[:, parent]).any(axis=1), joint] = np.nan
    return out


def neck_priors(
    fit: CameraFit, chosen: NDArray[np.intp], camera: Camera, beside: float
) -> tuple[RootPrior, float]:
    """Return what is known of the neck in some hypotheses, and the largest deviation of a placed depth, metres.

    A neck that was given is there; one that was placed, within its step along the ray. Each hypothesis keeps its own
    depth: how far a person is, one picture tells badly, and a single best depth would stand for a whole valley.
    A placed neck is where the figure's size puts it.

    Parameters
    ----------
    fit : CameraFit
        Where the necks are.
    chosen : int array (H,)
        Hypotheses.
    camera : Camera
        Theirs.
    beside : float
        Standard deviation of an image point, radians.
    """
    root = fit.root[chosen]
    by_frame = fit.placements or [None] * len(fit.reasons)
    step = np.array([_step(by_frame[k]) for k in fit.frame[chosen].tolist()])
    lateral = np.where(step > 0, LATERAL_DEVIATIONS * beside * root[:, 2], 0.0)
    prior = RootPrior.along_ray(camera, root, depth=step, lateral=lateral)
    return replace(prior, by_size=step > 0), float(step.max(initial=0.0))


def _step(placement: NeckPlacement | None) -> float:
    """Return how far the depth may be from the nearest of the necks that were placed, metres."""
    if placement is None:
        return 0.0
    deviation = (
        placement.deviation if math.isfinite(placement.deviation) and len(placement.necks) == 1 else 0.0
    )
    return max(placement.step, deviation, LEAST_STEP_METRES)
