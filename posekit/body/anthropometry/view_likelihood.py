r"""The likelihood of a person's dimensions given how long they are seen in pictures of unknown scale.

The scale of each picture is integrated out, not maximised: with one more unknown in each picture, maximising over all
of them is biased however many pictures there are (Neyman & Scott 1948).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Final

import numpy as np

from posekit.body.anthropometry.foreshortening import log_density
from posekit.geometry import Array

SCALE_GRID: Final = np.arange(-0.4, 0.6, 0.02)
"""Logarithms of a picture's scale about its first guess, over which it is integrated."""
USUAL_DISTANCE_METRES: Final = 4.5
"""Metres to the camera, where the focal length does not say."""
JOINT_NOISE: Final = 0.015
"""Metres by which detectors are off a joint, a coordinate: their errors grow with a person's size in the picture."""
MAX_COSINE: Final = 0.95
DIFFERENCE_STEP: Final = 0.01
"""Step of the differences that give slopes: the tables are exact to less, and the likelihood is wider."""


@dataclass(frozen=True, kw_only=True, eq=False)
class LikelihoodParameters:
    """What is estimated: everything in logarithms.

    Parameters
    ----------
    dimensions : array (M,)
        Metres.
    middle, width : float
        Mean and standard deviation of the logarithm of the pictures' scale, pixels a metre.
    """

    dimensions: Array
    middle: float
    width: float

    @classmethod
    def from_vector(cls, y: Array) -> LikelihoodParameters:
        """Take a vector (M + 2,) apart."""
        return cls(dimensions=y[:-2], middle=float(y[-2]), width=float(y[-1]))

    @property
    def vector(self) -> Array:
        """All of them (M + 2,)."""
        return np.concatenate([self.dimensions, [self.middle, self.width]])


@dataclass(frozen=True, kw_only=True, eq=False)
class ViewLikelihood:
    """What was seen.

    Parameters
    ----------
    seen : array (T, M)
        Lengths of the M dimensions in T pictures, pixels; NaN where an end is missing.
    first : array (T,)
        First guess of the logarithm of each picture's scale, or the scale itself.
    scale_known : bool
        Whether the scales were given.
    relief : array (M,)
        Metres in depth by which a segment is off the body's middle: so much nearer it is, and seen larger.
    loose : array (M,)
        How much a length changes with posture, as a fraction of it; 0 for a bone.
    shorter : array (M,)
        How much shorter than the dimension a length is on average, in logarithms: the trunk of a bent back.
    focal : float, optional
        Focal length, pixels, which gives the distance; without it `USUAL_DISTANCE_METRES` is assumed.
    noise : float, optional
        Standard deviation of a key point's coordinate, pixels; without it `JOINT_NOISE` at the body's scale.
    concentration : array (M,)
        See `posekit.body.anthropometry.foreshortening.log_density`.
    """

    seen: Array
    first: Array
    scale_known: bool
    relief: Array
    loose: Array
    shorter: Array
    focal: float | None
    noise: float | None
    concentration: Array

    @cached_property
    def scales(self) -> Array:
        """Logarithms of the scales to integrate over (T, S)."""
        return self.first[:, None] + (np.zeros(1) if self.scale_known else SCALE_GRID)

    # Noise and distance come of the first guess of the scale, not of the scale that is integrated over: what is known
    # of them in metres would otherwise say something of the size.

    @cached_property
    def _nearness(self) -> Array:
        """One over the distance (T, 1), 1/m."""
        if self.focal is None:
            return np.full((len(self.first), 1), 1 / USUAL_DISTANCE_METRES)
        return np.asarray(np.exp(self.first[:, None]) / self.focal)

    @cached_property
    def _blur(self) -> Array:
        """Standard deviation of a key point's coordinate (T, 1), pixels."""
        if self.noise is None:
            return np.asarray(JOINT_NOISE * np.exp(self.first[:, None]))
        return np.full((len(self.first), 1), self.noise)

    def of_length(self, m: int, dimension: float) -> Array:
        """Return the logarithm of the density of the m-th length (T, S), 0 where it was not seen."""
        full = np.exp(self.scales + dimension - self.shorter[m])
        seen = self.seen[:, m, None]
        apart = 2 * self._blur**2 / full**2  # both ends are off
        density = log_density(
            seen / full,
            np.sqrt(apart + (self.relief[m] * self._nearness) ** 2 + self.loose[m] ** 2),
            float(self.concentration[m]),
        ) - np.log(full)
        return np.where(np.isnan(seen), 0.0, density)

    def of_scale(self, middle: float, width: float) -> Array:
        """Return the logarithm of the density of the scales (T, S)."""
        if self.scale_known:
            return np.zeros_like(self.scales)
        return np.asarray(-0.5 * ((self.scales - middle) / np.exp(width)) ** 2 - width)

    def terms(self, p: LikelihoodParameters) -> Array:
        """Return the logarithms of all lengths' densities (M, T, S)."""
        return np.stack([self.of_length(m, float(p.dimensions[m])) for m in range(self.seen.shape[1])])

    def pictures(self, y: Array) -> Array:
        """Return the logarithm of the likelihood of each picture (T,)."""
        p = LikelihoodParameters.from_vector(y)
        return _integrated(self.terms(p).sum(axis=0) + self.of_scale(p.middle, p.width))

    def slopes(self, y: Array) -> Array:
        """Return the slope of each picture's logarithm (T, M + 2), by central differences."""
        p = LikelihoodParameters.from_vector(y)
        terms, scale = self.terms(p), self.of_scale(p.middle, p.width)
        lengths = terms.sum(axis=0)
        slopes = np.zeros((len(self.seen), len(y)))
        for k in range(len(p.dimensions)):
            if not np.isfinite(self.seen[:, k]).any():
                continue
            rest = lengths - terms[k] + scale
            sides = [
                _integrated(rest + self.of_length(k, float(p.dimensions[k]) + step))
                for step in (DIFFERENCE_STEP, -DIFFERENCE_STEP)
            ]
            slopes[:, k] = (sides[0] - sides[1]) / (2 * DIFFERENCE_STEP)
        for column, (middle, width) in ((-2, (DIFFERENCE_STEP, 0.0)), (-1, (0.0, DIFFERENCE_STEP))):
            sides = [
                _integrated(lengths + self.of_scale(p.middle + sign * middle, p.width + sign * width))
                for sign in (1, -1)
            ]
            slopes[:, column] = (sides[0] - sides[1]) / (2 * DIFFERENCE_STEP)
        return slopes

    def squared_cosines(self, y: Array) -> tuple[Array, Array]:
        """Return the squared cosine of each segment to the line of sight (T, M), and its variance by noise (T, M).

        As if each had its full length in the frame that shows it longest but for a twentieth of the frames: a length
        that is not known yet cannot say how much a segment turned.
        """
        scale = self.posterior_scales(y)
        metres = self.seen / np.exp(scale)[:, None]
        known = np.isfinite(metres)
        full = np.array(
            [
                np.quantile(one[k], MAX_COSINE) if k.any() else 1.0
                for one, k in zip(metres.T, known.T, strict=True)
            ]
        )
        full = np.maximum(full, 1e-6)
        x = np.minimum(metres / full, 1.0)
        return 1 - x * x, (2 * x) ** 2 * 2 * (self._blur / np.exp(scale)[:, None]) ** 2 / full**2

    def posterior_scales(self, y: Array) -> Array:
        """Return the mean of the logarithm of each picture's scale (T,)."""
        p = LikelihoodParameters.from_vector(y)
        density = self.terms(p).sum(axis=0) + self.of_scale(p.middle, p.width)
        weight = np.exp(density - density.max(axis=1, keepdims=True))
        return np.asarray((weight * self.scales).sum(axis=1) / weight.sum(axis=1))


def _integrated(logarithm: Array) -> Array:
    largest = logarithm.max(axis=1)
    return np.asarray(largest + np.log(np.exp(logarithm - largest[:, None]).sum(axis=1)))
