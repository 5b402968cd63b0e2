r"""Joint ranges under noise: every angle is allowed what the noise of its own segments may have done to it.

A segment of length l that looks d long stands at :math:`\varphi = \arccos(d / l)` to the image plane. With d off by
no more than :math:`\delta`, it stands between :math:`\arccos((d + \delta) / l)` and
:math:`\arccos((d - \delta) / l)`: off by :math:`\delta / (l \sin\varphi)` where it points well away from the plane,
:math:`\sqrt{2 \delta / l}` and no more where it lies in it. A length that is off by a share of itself is as a d that
is off by the same share. One tolerance for all segments would have to be the
latter.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from posekit.compiled import screen_kinds as kernels
from posekit.compiled.noise_kernels import LEAST_DEGREES, MIN_COSINE
from posekit.errors import InputError
from posekit.geometry import Array
from posekit.skeleton import JOINTS, N_TRUNK_JOINTS, PARENTS
from posekit.tree import Check, Findings, Loosening, Place, Rule

LOOSENED_KINDS = (kernels.OF_ANATOMICAL_LIMB, kernels.OF_LIMB, kernels.OF_NECK, kernels.OF_PELVIS)
"""Screens that know what noise allows."""


@dataclass(frozen=True, kw_only=True)
class NoisyRange(Check):
    """A check of joint ranges that allows for the noise of the points that it reads.

    Parameters
    ----------
    inner : Check
        The same check with a tolerance of one degree.
    bound : float
        How far a point may be off beside its ray, times one metre over its depth (its standard deviations' multiple
        over the focal length, pixels); absolute, metres, where the camera is orthographic.
    stretch : float
        By what share of itself a segment may be longer or shorter.
    perspective : bool
        Whether the camera is one with a perspective: directions then depend on depths.
    """

    inner: Check
    bound: float
    stretch: float = 0.0
    perspective: bool = True

    def __post_init__(self) -> None:
        for name, value in (("bound", self.bound), ("stretch", self.stretch)):
            if not 0 <= value < np.inf:
                raise InputError(
                    f"the noise's {name} is {value!r}; expected zero or a positive, finite number"
                )

    @property
    def name(self) -> str:
        """The check's name."""
        return self.inner.name

    @cached_property
    def places(self) -> tuple[Place, ...]:
        """Its places."""
        return self.inner.places

    @property
    def slow(self) -> bool:
        """Whether it is."""
        return self.inner.slow

    @property
    def needs_head(self) -> bool:
        """Whether it does."""
        return self.inner.needs_head

    @property
    def unit(self) -> str:
        """Its unit."""
        return self.inner.unit

    @cached_property
    def points(self) -> tuple[int, ...]:
        """The points that it reads."""
        return self.inner.points

    @cached_property
    def rule(self) -> Rule | None:
        """The screen as numbers: what noise may do (`posekit.compiled.noise_kernels`), then those of the same check."""
        inner = self.inner.rule
        if inner is None or inner.kind not in LOOSENED_KINDS:
            return None
        pairs = [(*pair, 0) for pair in self._trunk] + [(*pair, 1) for pair in self._limb]
        said = [inner.kind, self.bound, self.stretch, self.perspective, self._beside_abduction, len(pairs)]
        return Rule(kind=kernels.OF_NOISY, numbers=np.concatenate([said, np.ravel(pairs), inner.numbers]))

    @property
    def _beside_abduction(self) -> bool:
        """Whether the second place is an abduction, beside which the check itself allows no more."""
        return len(self.places) > 1 and self.places[1].angle == "abduction" and not self.inner.scaled

    def judge(self, points: Array) -> Findings:
        """Judge postures; see `posekit.tree.Check`."""
        findings = self.inner.judge(points)
        tolerance = np.broadcast_to(findings.tolerance, findings.value.shape).copy()
        if self._beside_abduction:
            # Beside the abduction axis the first angle turns faster than the direction, and the rotation with it.
            abduction = np.radians(findings.value[:, 1])
            level = np.maximum(np.abs(np.cos(abduction)), MIN_COSINE)
            tolerance[:, 0] /= level
            if len(self.places) > 2:
                tolerance[:, 2] += np.abs(np.sin(abduction)) / level
        allowed = np.maximum(np.degrees(self.allowance(points)), LEAST_DEGREES)[:, None]
        return replace(findings, tolerance=tolerance * allowed)

    def allowance(self, points: Array) -> Array:
        """Return by what angle the noise may turn the segments of postures (N, len(points), 3): (N,), radians."""
        square = np.zeros(len(points))
        for segments, share in ((self._trunk, 1.0), (self._limb, np.sqrt(2.0))):
            worst = np.zeros(len(points))
            for start, end in segments:
                worst = np.fmax(worst, self._off(points[:, start], points[:, end], share))
            square += worst * worst
        return np.sqrt(square)

    def _off(self, start: Array, end: Array, share: float) -> Array:
        along = end - start
        length = np.sqrt(np.einsum("ni,ni->n", along, along))
        if self.perspective:
            depth = np.sqrt(np.einsum("ni,ni->n", end, end))
            away = np.einsum("ni,ni->n", along, end) / depth
            delta = share * self.bound * depth
        else:
            away, delta = along[:, 2], np.full(len(along), share * self.bound)
        seen = np.sqrt(np.maximum(length * length - away * away, 0.0))
        delta = np.hypot(delta, self.stretch * seen)
        angle = np.arctan2(np.abs(away), seen)
        least = np.arccos(np.minimum((seen + delta) / length, 1.0))
        most = np.arccos(np.maximum((seen - delta) / length, -1.0))
        return np.asarray(np.maximum(angle - least, most - angle))

    @cached_property
    def _limb(self) -> list[tuple[int, int]]:
        return [pair for pair in self._segments if self.points[pair[1]] >= N_TRUNK_JOINTS]

    @cached_property
    def _trunk(self) -> list[tuple[int, int]]:
        return [pair for pair in self._segments if self.points[pair[1]] < N_TRUNK_JOINTS]

    @cached_property
    def _segments(self) -> list[tuple[int, int]]:
        """Pairs of the check's own points that are ends of a segment."""
        place = {point: index for index, point in enumerate(self.points)}
        return [
            (place[PARENTS[joint]], place[joint])
            for joint in range(1, len(JOINTS))
            if joint in place and PARENTS[joint] in place
        ]


def under_noise(
    checks: Sequence[Check], bound: float, *, stretch: float = 0.0, perspective: bool = True
) -> list[Check]:
    """Loosen checks as they say, for postures that are not refined yet.

    Those of `Loosening.DIRECTIONS` must have a tolerance of a degree; those of `Loosening.REFINED` are left out.
    """
    return [
        NoisyRange(inner=check, bound=bound, stretch=stretch, perspective=perspective)
        if check.noise is Loosening.DIRECTIONS
        else check
        for check in checks
        if check.noise is not Loosening.REFINED
    ]
