"""Swings of limbs over strides: how fast, how far, and whether two are in step."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from posekit.geometry import Array, cross, dot, perpendicular, unit
from posekit.skeleton import JOINT
from posekit.validators.motion.timeline import norm

LEAST_PART = 0.5
"""Part of a stride of which frames must be known."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Strides:
    """A body's joints around each frame, half a stride before it and half after it.

    Parameters
    ----------
    joints : array (S, 14, 3)
        Metres, at even times; NaN where unknown.
    step : float
        Seconds from one to the next.
    half : int
        Frames of half a stride.
    """

    joints: Array
    step: float
    half: int

    def mean(self, values: Array) -> Array:
        """Return the mean over the stride around each frame (S, ...); NaN where too few are known."""
        known = np.isfinite(values)
        sums = [np.cumsum(part, axis=0) for part in (np.where(known, values, 0.0), known.astype(np.float64))]
        last = len(values) - 1
        ends = np.minimum(np.arange(len(values)) + self.half, last)
        starts = np.arange(len(values)) - self.half - 1
        total, count = (
            each[ends] - np.where(_column(starts >= 0, each), each[np.maximum(starts, 0)], 0.0)
            for each in sums
        )
        enough = count >= LEAST_PART * (2 * self.half + 1)
        return np.asarray(np.where(enough, total / np.where(enough, count, 1.0), np.nan))

    def rate(self, values: Array) -> Array:
        """Return how fast values (S, ...) change, a second."""
        if len(values) < 2:
            return np.full(values.shape, np.nan)
        return np.asarray(np.gradient(values, self.step, axis=0))

    def joint(self, name: str) -> Array:
        """Return the places of a joint (S, 3)."""
        return self.joints[:, JOINT[name]]

    @cached_property
    def velocity(self) -> Array:
        """How the middle of the hips goes (S, 3), metres a second."""
        return self.mean(self.rate((self.joint("right_hip") + self.joint("left_hip")) / 2))

    @cached_property
    def speed(self) -> Array:
        """How fast that is across the trunk's own axis (S,)."""
        return norm(perpendicular(self.velocity, self._down))

    @cached_property
    def _down(self) -> Array:
        return unit(self.mean(self.joint("pelvis") - self.joint("neck")))

    @cached_property
    def _forward(self) -> Array:
        return unit(perpendicular(self.velocity, self._down))

    def swing(self, name: str) -> Array:
        """Return how far a joint is out of the body plane (S,), metres, from where it swings about."""
        out = dot(self.joint(name) - self.joint("neck"), self._forward)
        return np.asarray(out - self.mean(out))

    def in_step(self, one: str, other: str, least: float) -> Array:
        """Return the correlation of the speeds of two swings (S,); NaN where either swings by less than so much."""
        a, b = self.swing(one), self.swing(other)
        swings = (self.mean(a * a) >= least**2) & (self.mean(b * b) >= least**2)
        a, b = self.rate(a), self.rate(b)
        both = np.sqrt(self.mean(a * a) * self.mean(b * b))
        return np.where(swings, self.mean(a * b) / np.where(swings, both, 1.0), np.nan)

    def across(self, girdle: str, end: str, least: float) -> Array:
        """Return the part of the speed of a limb's end that is across the moving direction (S,)."""
        limb = self.joint(end) - self.joint(girdle)
        along, over = (
            self.rate(dot(limb, axis)) for axis in (self._forward, cross(self._forward, self._down))
        )
        swings = self.mean(self.swing(end) ** 2) >= least**2
        square = self.mean(over * over)
        both = square + self.mean(along * along)
        return np.where(swings, np.sqrt(square / np.where(swings, both, 1.0)), np.nan)


def _column(flags: NDArray[np.bool_], like: Array) -> NDArray[np.bool_]:
    return flags.reshape(-1, *[1] * (like.ndim - 1))
