r"""Photographs without a camera: key points as far off as people put them, at a scale that is only likely.

Nothing else tells them from calibrated pictures under noise: the scaled orthographic camera of Taylor (2000) lifts
into the same tree, and `posekit.recovery.refiner` finds the likeliest postures. A scale that is not known is a size
that is not known: every length is as uncertain as the scale is, beside its own deviation.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Final

import numpy as np
from numpy.typing import NDArray

from posekit.body import LengthUncertainty
from posekit.body.anthropometry.view_likelihood import USUAL_DISTANCE_METRES
from posekit.cameras import Camera, ScaledOrthographicCamera
from posekit.formats.own import PER_METRE, ScaledOrthographicModel, View
from posekit.geometry import Array
from posekit.recovery.body import FigureBody
from posekit.recovery.fit_camera import CameraFit
from posekit.recovery.fit_scale import fit_scale
from posekit.recovery.grower import Grower
from posekit.recovery.hypotheses import (
    LATERAL_DEVIATIONS,
    LEAST_STEP_METRES,
    ObservedHypotheses,
    connected,
)
from posekit.recovery.key_point_offsets import PIXEL_DEVIATION, joint_offsets
from posekit.recovery.noise import LEAST_CONFIDENCE, Noise
from posekit.recovery.refiner import Lifted, Refiner
from posekit.recovery.seen_trunk import SeenTrunk, with_trunk
from posekit.refinement import ObservedFrames, RootPrior
from posekit.settings import RecoverSettings, Tolerance
from posekit.settings.recover import MAX_LENGTH_DEVIATION
from posekit.settings.scale import Scale, way_of
from posekit.skeleton import JOINTS, N_TRUNK_JOINTS, POINTS

SCALE_DEVIATIONS: Final[Mapping[str, float]] = {"likely": 0.08, "min": 0.08, "stature": 0.03}
"""Relative standard deviation of a scale, by how it was found; one that is given leaves the size as
uncertain as it is. The likelihood of single
pictures of people leaves it 6 to 12 %; who stands for their stature does not stand quite straight."""

RELIEF_METRES: Final = 0.25
"""Metres in depth by which a joint is off the body's middle, standard deviation: a forearm's or a shank's
(`posekit.body.anthropometry.views`). What is nearer looks larger, which no scaled orthographic camera shows:
the farther a joint is from the middle of the body's picture, the farther off it is."""

OVERLAP_METRES: Final = 0.06
"""Metres by which bodies may overlap: joints deviate by 3 to 5 cm in the picture, and by more in depth."""

LIFTED_CHI2: Final = 1000.0
"""A chi2 up to which a lifted leaf is followed: where joints are off by centimetres, angles are off by tens of degrees,
many deviations of a limit beyond it, which the first steps mend."""

ANY_LENGTH: Final = Tolerance(rigid=10.0, tangent=10.0, placement=False)
"""At a scale that is given, segments may be too short for their image here: refinement weighs by how much."""


def photograph_noise(view: View, asked: RecoverSettings, lengths: LengthUncertainty) -> Noise:
    """Say how far photographs' image points may be off beside `joint_offsets`, and lengths beside the scale."""
    of_scale = SCALE_DEVIATIONS.get(way_of_scale(view, asked).how, lengths.common)
    own = {name: min(math.hypot(one, of_scale), MAX_LENGTH_DEVIATION) for name, one in lengths.own.items()}
    return Noise(
        deviation=asked.rooting.deviation or view.deviation or PIXEL_DEVIATION,
        lengths=LengthUncertainty(own=own),
        overlap=OVERLAP_METRES,
    )


def is_photograph(view: View, asked: RecoverSettings) -> bool:
    """Whether frames of a view without a calibrated camera may be other than exact: not at a scale that is said to be.

    Where somebody says that points or lengths are off, they may at any scale but one that exact bodies' loops fix.
    """
    how = way_of_scale(view, asked).how
    return how in SCALE_DEVIATIONS or (how == "value" and seen_with_noise(view, asked))


def seen_with_noise(view: View, asked: RecoverSettings) -> bool:
    """Whether somebody says that points or lengths are off: a detector saw them, or a deviation is given."""
    told = (asked.rooting.deviation, asked.length_deviation, view.deviation, view.length_deviation)
    return bool(asked.refine or view.derived or any(told))


def way_of_scale(view: View, asked: RecoverSettings) -> Scale:
    """Return how the scale of photographs is found: as was asked or as the view says, else as is likely."""
    scale, model = asked.scale_for(PER_METRE[view.unit]), view.camera
    if scale is None and isinstance(model, ScaledOrthographicModel) and model.scale is None:
        return Scale(how="likely")
    return way_of(getattr(model, "scale", None), scale)[1]


@dataclass(frozen=True, kw_only=True)
class PhotographRefiner(Refiner):
    """Grows and refines trees over the frames of a view without a calibrated camera.

    Parameters
    ----------
    loosened : float
        By how many times image points may be farther off than they are in most pictures.
    """

    loosened: float = 1.0

    @staticmethod
    def of(grower: Grower, noise: Noise) -> PhotographRefiner:
        """Make one; where the tree is of other points than the figure's joints, the figure's is refined."""
        if not isinstance(grower.body, FigureBody):
            body = FigureBody(figure=grower.body.figure, stature=grower.body.stature)
            grower = replace(grower, body=body)
        return PhotographRefiner(grower=grower, noise=noise)

    @cached_property
    def trunk(self) -> SeenTrunk:
        """What each frame shows, with a point for each joint of the trunk."""
        view = self.grower.view
        return with_trunk(view.image, self.grower.body.figure, joint_offsets(), view.derived)

    @cached_property
    def fit(self) -> CameraFit:
        """One scale a frame, and the neck at depth zero."""
        view = replace(self.grower.view, image=self.trunk.image)
        way = way_of_scale(view, self.grower.settings)
        return fit_scale(view, self.grower.body, way, ANY_LENGTH, reasons=self.trunk.reasons)

    def observe(self, chosen: NDArray[np.intp], camera: Camera) -> ObservedHypotheses:
        """Gather what some hypotheses saw, and how well."""
        if not isinstance(camera, ScaledOrthographicCamera):
            raise TypeError("a calibrated camera is no photograph's")
        frames = self.fit.frame[chosen]
        scale = np.broadcast_to(np.asarray(camera.scale), len(chosen))
        image = self.trunk.image[frames]
        deviation = self.deviation_of(image, self.trunk.offset[frames], frames, scale)
        lateral = LATERAL_DEVIATIONS * deviation[:, 0] / scale
        sight = ObservedFrames(
            figure=self.grower.body.figure,
            camera=camera,
            image=connected(image),
            deviation=deviation,
            root=RootPrior.along_ray(camera, self.fit.root[chosen], depth=LEAST_STEP_METRES, lateral=lateral),
            length_deviation=self.noise.lengths.own,
            limits=self._limits,
            walls=self._walls,
        )
        of_points = np.full((len(chosen), len(POINTS)), np.nan)
        of_points[:, : len(JOINTS)] = deviation
        return ObservedHypotheses(sight=sight, deviation=of_points, focal=scale, step=0.0)

    @property
    def hopeless(self) -> float:
        """The chi2 beyond which a leaf may be given up: a lifted one may be far beyond the limits."""
        return LIFTED_CHI2

    def _with_heads(self, lifted: Lifted) -> ObservedFrames:
        """Return what was seen without the head, whose points in a picture are not the figure's."""
        return lifted.seen.sight

    def untold(self, lifted: Lifted) -> NDArray[np.bool_] | None:
        """Return which joints of leaves (N, 14) are not told: those of a trunk that only their neighbours place."""
        told = self.trunk.told[lifted.frames[lifted.frame[lifted.hypothesis]]]
        return ~told & (np.arange(len(JOINTS)) < N_TRUNK_JOINTS)

    def to_complete(self, chosen: NDArray[np.intp]) -> Array:
        """Return image points (H, 14, 2): limbs are completed on trunks that are told, and else stay unknown."""
        frames = self.fit.frame[chosen]
        whole = np.asarray(self.trunk.told[frames, :N_TRUNK_JOINTS].all(axis=1))
        image = self.trunk.image[frames]
        return np.where(whole[:, None, None], image, np.nan_to_num(image))

    def spread(self, lifted: Lifted) -> float:
        """Say how far off survivors are, metres."""
        return float(np.median(lifted.seen.deviation[:, : len(JOINTS)] / lifted.seen.focal[:, None]))

    def deviation_of(self, image: Array, offset: Array, frames: NDArray[np.intp], scale: Array) -> Array:
        """Return the standard deviation of each coordinate of image points (H, 14), pixels."""
        confidence = np.clip(
            np.nan_to_num(self.grower.view.confidence[frames, : len(JOINTS)], nan=1.0), LEAST_CONFIDENCE, 1.0
        )
        middle = image[:, :N_TRUNK_JOINTS].mean(axis=1, keepdims=True)
        metres = (image - middle) / scale[:, None, None]
        aside = np.nan_to_num(np.linalg.norm(metres, axis=2))
        near = RELIEF_METRES / USUAL_DISTANCE_METRES * aside
        off = scale[:, None] * np.hypot(offset, near)
        return np.asarray(self.loosened * np.hypot(self.noise.deviation, off) / np.sqrt(confidence))
