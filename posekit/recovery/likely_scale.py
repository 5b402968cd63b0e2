r"""The likely scale of an uncalibrated picture: which makes a normal body's segments look as long as they are seen.

Taylor's bound (2000, eq. 3) is the least scale at which no segment is too short for its image: right where lengths and
image points are exact. Elsewhere one segment, that which is longest for its kind or nearest to the camera, would set
the scale of all. Here each has its say: a scale is as likely as the foreshortenings that it asks for
(`posekit.body.anthropometry.view_likelihood`), with lengths and image points as uncertain as they are, and no scale
preferred before.
"""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np

from posekit.body import Figure
from posekit.body.anthropometry.body import BODY_DIMENSIONS, TRUNK_LENGTH, dimensions_of
from posekit.body.anthropometry.view_likelihood import LikelihoodParameters, ViewLikelihood
from posekit.body.anthropometry.views import depth_reliefs, length_looseness, seen_dimensions
from posekit.geometry import Array
from posekit.recovery.key_point_offsets import LENGTH_DEVIATION, PIXEL_DEVIATION, joint_offsets
from posekit.skeleton import JOINT, SIDES

FIRST_SHARE: Final = 0.9
"""Of what the second longest image asks for, where the search begins: the longest may be an outlier, and both are
usually some longer than their segments."""


class LikelyScales(NamedTuple):
    """Scales of F pictures.

    Attributes
    ----------
    scale : array (F,)
        Pixels a metre, by the mean of the logarithm; NaN where no segment is seen.
    deviation : array (F,)
        Standard deviation of the logarithm.
    """

    scale: Array
    deviation: Array


def likely_scales(image: Array, figure: Figure) -> LikelyScales:
    """Find the likely scale of each picture.

    Parameters
    ----------
    image : array (F, 14, 2)
        Image points, pixels that are square; NaN where not seen. Neck and pelvis are not used.
    figure : Figure
        The person's, or that of a normal body.
    """
    seen = seen_dimensions(image)
    usable = np.flatnonzero(np.nan_to_num(seen).max(axis=1) > 0)
    scale, deviation = np.full((2, len(image)), np.nan)
    dimensions = dimensions_of(figure.lengths)
    full = np.array([dimensions[name] for name in BODY_DIMENSIONS])
    ratios = np.sort(np.nan_to_num(seen[usable] / full), axis=1)
    likelihood = ViewLikelihood(
        seen=seen[usable],
        first=np.log(FIRST_SHARE * np.where(ratios[:, -2] > 0, ratios[:, -2], ratios[:, -1])),
        scale_known=False,
        relief=depth_reliefs(),
        loose=np.sqrt(length_looseness() ** 2 + LENGTH_DEVIATION**2 + (_off(joint_offsets()) / full) ** 2),
        shorter=np.zeros(len(full)),
        focal=None,
        noise=PIXEL_DEVIATION,
        concentration=np.zeros(len(full)),
    )
    density = likelihood.terms(LikelihoodParameters(dimensions=np.log(full), middle=0.0, width=0.0)).sum(
        axis=0
    )
    weight = np.exp(density - density.max(axis=1, keepdims=True))
    weight /= weight.sum(axis=1, keepdims=True)
    mean = (weight * likelihood.scales).sum(axis=1)
    scale[usable] = np.exp(mean)
    deviation[usable] = np.sqrt((weight * (likelihood.scales - mean[:, None]) ** 2).sum(axis=1))
    return LikelyScales(scale, deviation)


def _off(offset: Array) -> Array:
    """Return how far the ends of `BODY_DIMENSIONS` are off against each other (11,), metres."""
    ends = [[JOINT[end] for end in name.split("-")] for name in BODY_DIMENSIONS if name != TRUNK_LENGTH]
    girdles = [[JOINT[f"{side}_{part}"] for side in SIDES] for part in ("shoulder", "hip")]
    trunk = np.sqrt(np.square(offset[np.array(girdles)]).sum() / 4)
    return np.append(np.sqrt(np.square(offset[np.array(ends)]).sum(axis=1)), trunk)
