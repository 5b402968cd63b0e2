"""The fit of a person's dimensions to what the pictures show."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from posekit.body.anthropometry.foreshortening import cosine_variance
from posekit.body.anthropometry.independent import independent_frames
from posekit.body.anthropometry.view_likelihood import ViewLikelihood
from posekit.geometry import Array

N_PASSES: Final = 2
MAX_STEPS: Final = 40
STEP_SHARE: Final = 0.5
"""Of a step that is taken: the information is that of a sample, and whole steps overshoot."""
CONVERGED_STEP: Final = 0.01
"""Squared length of a step, in standard deviations, at which it is no use to go on."""


@dataclass(frozen=True, kw_only=True, eq=False)
class DimensionFit:
    """The logarithms of the dimensions, the scales' middle and width (M + 2,); their covariance; independent frames."""

    y: Array
    covariance: Array
    independent: Array


def maximise(likelihood: ViewLikelihood, middle: Array, covariance: Array) -> DimensionFit:
    """Find where the slopes vanish, each dimension's weighted by how many independent frames it has shown.

    Newton's method with the sum of the slopes' squares for the information (Berndt, Hall, Hall & Hausman 1974).
    """
    count = len(middle)
    start = np.concatenate(
        [
            middle,
            [float(np.median(likelihood.first)), np.log(0.1)],
        ]
    )
    precision = np.zeros((count + 2, count + 2))
    precision[:count, :count] = np.linalg.inv(covariance)
    precision[-2, -2], precision[-1, -1] = 1e-6, 1.0
    frames = len(likelihood.seen)
    y = start
    independent = np.ones(count)
    information = precision
    usual_variance = np.array([cosine_variance(float(one)) for one in likelihood.concentration])
    for _ in range(N_PASSES):
        # What the frames are worth depends on their scales, which are better known afterwards.
        independent = independent_frames(*likelihood.squared_cosines(y), usual_variance)
        usual = float(np.median(independent[independent > 0]))
        weight = np.concatenate([independent, np.full(2, usual)]) / frames
        for _ in range(MAX_STEPS):
            slopes = likelihood.slopes(y)
            slope = weight * slopes.sum(axis=0) - precision @ (y - start)
            weighted = np.sqrt(weight) * slopes
            information = weighted.T @ weighted + precision
            step = np.linalg.solve(information, slope)
            left = float(slope @ step)
            if left < CONVERGED_STEP:
                break
            y = y + STEP_SHARE * np.clip(step, -0.2, 0.2)
    return DimensionFit(
        y=y,
        covariance=np.asarray(np.linalg.inv(information), dtype=np.float64),
        independent=independent,
    )
