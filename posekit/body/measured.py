r"""A person measured in a recording: segment lengths, side of the shoulders, and measurement noise.

Bones keep their length, so the variation of a limb segment's length over time is measurement noise. If the coordinates
of both ends have independent errors of standard deviation :math:`\sigma`, the length has standard deviation
:math:`\sqrt 2\,\sigma`. The estimate of :math:`\sigma` is

.. math:: \hat\sigma = \frac{1.4826}{\sqrt 2}\,\mathrm{mid}_i\,\mathrm{med}_t\,|l_i(t) - \mathrm{med}_t\,l_i|

Here i are the eight segments of arms and legs, t are the frames, med is the median, and mid is the mean of the middle
half of the sorted values. The median absolute deviation (Rousseeuw & Croux 1993, J Am Stat Assoc 88:1273) and the
middle half are robust against wrong frames and drifting limbs.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Final

import numpy as np

from posekit.body.figure import Figure, load_figure
from posekit.body.lengths import segment_lengths, shoulders_are_behind
from posekit.errors import FigureError
from posekit.geometry import Array, Record, cross, dot
from posekit.skeleton import JOINT, LIMB_JOINTS, LIMB_SEGMENTS, SEGMENT_NAMES, segment_name

LIMB_NAMES: Final = tuple(map(segment_name, LIMB_SEGMENTS))

#: Ratio of the standard deviation to the median absolute deviation of a normal distribution.
DEVIATION_OF_MAD: Final = 1.4826

#: Minimum number of frames for an estimate of noise: with ten frames and eight segments its relative error is below 25
#: %.
LEAST_FRAMES: Final = 10

#: Sum over both knees of the distance in front of the midpoint of hip and ankle, metres. In frames above it the knees
#: bend forward, so left and right are not exchanged.
BENT_METRES: Final = 0.04

#: Largest plausible noise of one limb segment, in multiples of the overall noise; a larger value is a defect.
WORST_OF_USUAL: Final = 3.0

#: Sizes of people, in multiples of the figure (1.75 m): newborns 0.28, the tallest man known 1.55.
SIZE_BOUNDS: Final = (0.25, 1.6)

#: Plausible lengths of limbs, in multiples of the figure's at the person's size: adults vary by 5 %, and a newborn's
#: legs are two thirds of an adult's.
LIMB_BOUNDS: Final = (0.6, 1.6)


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Person(Record):
    """A person, measured in the frames of a recording.

    Parameters
    ----------
    lengths : mapping
        Median length of each segment, metres, by segment name; segments that are never known are omitted.
    behind : bool or None
        Whether the shoulders lie behind the line from neck to pelvis in most frames.
    noise : float
        Standard deviation of measured coordinates, metres; NaN if fewer than ten frames are known.
    limb_noise : mapping
        Standard deviation of measured coordinates, estimated from each limb segment alone, metres, by segment name.
    hips_forward : float
        Median angle at the pelvis by which the middle of the hips lies in front of the extended line from neck to
        pelvis, degrees; NaN if fewer than ten frames are known.
    """

    lengths: Mapping[str, float]
    behind: bool | None
    noise: float
    limb_noise: Mapping[str, float]
    hips_forward: float

    def noise_of(self, segment: str) -> float:
        """Return the standard deviation of the measured coordinates of a segment's ends, metres.

        It is 0 if the recording has too few frames for an estimate.
        """
        if math.isnan(self.noise):
            return 0.0
        own = self.limb_noise.get(segment, self.noise)
        return min(max(own, self.noise), WORST_OF_USUAL * self.noise)


def person_of(joints: Array, lengths_of: Array) -> Person:
    """Measure a person from joints (T, 14, 3) and segment lengths (17, T) of a recording, metres; NaN is unknown.

    Lengths are rounded to 0.01 mm and angles to whole degrees, so that clips of one skeleton share one figure.
    """
    lengths = dict(zip(SEGMENT_NAMES, lengths_of, strict=True))
    known = {name: one[np.isfinite(one)] for name, one in lengths.items()}
    medians = {name: float(np.median(one)) for name, one in known.items() if len(one)}
    limbs = {}
    for name in LIMB_NAMES:
        if len(known[name]) >= LEAST_FRAMES:
            deviation = np.median(np.abs(known[name] - medians[name]))
            limbs[name] = round(float(DEVIATION_OF_MAD * deviation / math.sqrt(2)), 5)
    forward = _hips_forward(joints)
    return Person(
        lengths={name: round(length, 5) for name, length in medians.items()},
        behind=_shoulders_behind(joints),
        noise=round(_middle_half(limbs), 5),
        limb_noise=limbs,
        hips_forward=round(forward) if math.isfinite(forward) else forward,
    )


def _middle_half(noise: Mapping[str, float]) -> float:
    each = sorted(noise.values())
    outer = len(each) // 4
    return float(np.mean(each[outer : len(each) - outer])) if each else math.nan


def _hips_forward(joints: Array) -> float:
    neck, pelvis, right, left = (
        joints[:, JOINT[name]] for name in ("neck", "pelvis", "right_hip", "left_hip")
    )
    down, hips = pelvis - neck, (right + left) / 2 - pelvis
    with np.errstate(invalid="ignore", divide="ignore"):
        down = down / np.linalg.norm(down, axis=1, keepdims=True)
        forward = cross(down, left - right)
        angles = np.arctan2(dot(hips, forward) / np.linalg.norm(forward, axis=1), dot(hips, down))
    known = angles[np.isfinite(angles)]
    return math.degrees(float(np.median(known))) if len(known) >= LEAST_FRAMES else math.nan


def _shoulders_behind(joints: Array) -> bool | None:
    """Return `Person.behind` from frames whose knees bend forward: in other frames left and right may be exchanged."""
    neck, pelvis, right, left = (
        joints[:, JOINT[name]] for name in ("neck", "pelvis", "right_shoulder", "left_shoulder")
    )
    forward = cross(pelvis - neck, left - right)
    bent = np.zeros(len(joints))
    for hip, knee, ankle in LIMB_JOINTS[2:]:
        bent += dot(joints[:, knee] - (joints[:, hip] + joints[:, ankle]) / 2, forward)
    with np.errstate(invalid="ignore", divide="ignore"):
        bent /= np.linalg.norm(forward, axis=1)
    rows = bent > BENT_METRES
    if np.sum(rows) < LEAST_FRAMES:
        rows = np.ones(len(joints), dtype=np.bool_)
    return shoulders_are_behind(joints[rows])


@lru_cache(maxsize=8)
def figure_of(base: Figure, lengths: Sequence[tuple[str, float]], behind: bool | None) -> Figure:
    """Return a figure with the plausible lengths of a person.

    Implausible lengths are replaced by the lengths of `base`, scaled to the person's size. If no possible torso
    and hips are near these lengths, all lengths except those of limbs are replaced. Results are cached, so that clips
    of one skeleton share a figure.

    Parameters
    ----------
    base : Figure
        The figure that is scaled.
    lengths : sequence of (str, float)
        The items of `Person.lengths`.
    behind : bool or None
        See `Person.behind`.
    """
    ratios = {name: length / base.lengths[name] for name, length in lengths if name in LIMB_NAMES}
    size = float(np.median(list(ratios.values()))) if ratios else 1.0
    if not SIZE_BOUNDS[0] <= size <= SIZE_BOUNDS[1]:
        return base
    low, high = LIMB_BOUNDS
    usual = {name: size * length for name, length in base.lengths.items()}
    believed = {
        name: length
        for name, length in lengths
        if length > 0 and low <= ratios.get(name, size) / size <= high
    }
    try:
        return base.scaled(usual | believed, behind=behind)
    except FigureError:
        limbs = {name: length for name, length in believed.items() if name in ratios}
        return base.scaled(usual | limbs, behind=behind)


def scaled_to(joints: Array) -> Figure:
    """Scale the built-in figure to the median segment lengths of postures (N, 14, 3) or (N, 19, 3), metres.

    Unknown segments keep the built-in lengths. Lengths do not distinguish a torso from its mirror image, so the side of
    the shoulders is computed from the points.
    """
    return load_figure().scaled(segment_lengths(joints), behind=shoulders_are_behind(joints))
