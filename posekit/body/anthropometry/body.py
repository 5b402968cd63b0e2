"""From the dimensions that can be measured to the figure's 17 lengths, and how far each may be off."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Final

import numpy as np

from posekit.body import load_figure
from posekit.body.lengths import check_lengths, hips_points, torso_points
from posekit.body.stature import MAX_STATURE_METRES, MIN_STATURE_METRES
from posekit.errors import FigureError, InputError
from posekit.geometry import Array
from posekit.skeleton import SEGMENT_NAMES, SEGMENTS, SIDES, segment_name

LIMB_PARTS: Final = {
    "upper_arm": ("shoulder", "elbow"),
    "forearm": ("elbow", "wrist"),
    "thigh": ("hip", "knee"),
    "shank": ("knee", "ankle"),
}
"""The joints at the ends of each part of a limb."""
SHOULDER_WIDTH: Final = "right_shoulder-left_shoulder"
HIP_WIDTH: Final = "right_hip-left_hip"
TRUNK_LENGTH: Final = "trunk"
"""From the middle of the shoulders to the middle of the hips; the figure has no such segment."""


def limb(side: str, part: str) -> str:
    """Name the segment of a part of a limb: ``limb("right", "forearm")`` is ``right_elbow-right_wrist``."""
    upper, lower = LIMB_PARTS[part]
    return f"{side}_{upper}-{side}_{lower}"


BODY_DIMENSIONS: Final = (
    *(limb(side, part) for part in LIMB_PARTS for side in SIDES),
    SHOULDER_WIDTH,
    HIP_WIDTH,
    TRUNK_LENGTH,
)
"""What is enough for the 17 lengths: eight limbs, two widths and the trunk."""


@dataclass(frozen=True, kw_only=True)
class SegmentLengths:
    """A person's lengths.

    Parameters
    ----------
    lengths : mapping
        Metres, by segment name; all 17, or those that are known.
    deviation : mapping
        Standard deviation of each, metres: 0 where it was given.
    source : str
        Where they come from, in words, with the citation where it is a table.
    measured : tuple of str
        Those that were seen; the others follow from proportions.
    stature : float, optional
        Metres, where it was given.

    Raises
    ------
    FigureError
        Where a length is unknown, not finite or not positive, or a deviation is negative.
    """

    lengths: Mapping[str, float]
    deviation: Mapping[str, float]
    source: str
    measured: tuple[str, ...] = ()
    stature: float | None = None

    def __post_init__(self) -> None:
        lengths = {name: float(length) for name, length in self.lengths.items()}
        check_lengths(lengths)
        deviation = {name: float(self.deviation.get(name, 0.0)) for name in lengths}
        for name, value in deviation.items():
            if not (np.isfinite(value) and value >= 0):
                raise FigureError(
                    f"figure.lengths: the deviation of {name} is {value:g} m; expected 0 or more"
                )
        object.__setattr__(self, "lengths", MappingProxyType(lengths))
        object.__setattr__(self, "deviation", MappingProxyType(deviation))


def check_stature(stature: float) -> None:
    """Refuse a stature that is no person's in metres."""
    if not (np.isfinite(stature) and MIN_STATURE_METRES <= stature <= MAX_STATURE_METRES):
        raise FigureError(
            f"stature is {stature:g} m; expected {MIN_STATURE_METRES} to {MAX_STATURE_METRES} m; is it in another unit?"
        )


def reference_lengths(reference: Mapping[str, float] | None = None) -> dict[str, float]:
    """Return the lengths whose torso gives the shape: the built-in figure's unless told otherwise."""
    lengths = dict(load_figure().lengths if reference is None else reference)
    missing = [name for name in SEGMENT_NAMES if name not in lengths]
    if missing:
        raise InputError(f"reference lengths: {missing[0]} is missing; expected all {len(SEGMENT_NAMES)}")
    return lengths


def dimensions_of(lengths: Mapping[str, float]) -> dict[str, float]:
    """Return the dimensions of a body of 17 lengths; the trunk as it is at the neutral posture."""
    torso, hips = torso_points(lengths), hips_points(lengths)
    middle = (torso[1] + torso[2]) / 2 - (torso[3] + (hips[1] + hips[2]) / 2)
    return {name: lengths[name] for name in BODY_DIMENSIONS[:-1]} | {
        TRUNK_LENGTH: float(np.linalg.norm(middle))
    }


def lengths_of(dimensions: Mapping[str, float], reference: Mapping[str, float]) -> dict[str, float]:
    r"""Complete the 17 lengths from the dimensions.

    The torso inside is the reference's, scaled across by the two widths and along by the trunk, as
    `posekit.body.stature` does it: with the shoulders f in front, the trunk's height is :math:`\sqrt{d^2 - f^2}`.

    Parameters
    ----------
    dimensions : mapping
        Metres, by `BODY_DIMENSIONS`.
    reference : mapping
        The 17 lengths of the body whose torso gives the shape, metres.

    Returns
    -------
    dict
        Metres, by segment name.
    """
    torso, hips = torso_points(reference), hips_points(reference)
    across = dimensions[SHOULDER_WIDTH] / (torso[2, 1] - torso[1, 1])
    torso *= [across, across, 1.0]
    hips *= [1.0, dimensions[HIP_WIDTH] / (hips[2, 1] - hips[1, 1]), 1.0]
    middle = (torso[1] + torso[2]) / 2 - (torso[3] + (hips[1] + hips[2]) / 2)
    height = np.sqrt(max(dimensions[TRUNK_LENGTH] ** 2 - middle[0] ** 2 - middle[1] ** 2, 0.0))
    along = height / middle[2]
    torso[:, 2] *= along
    hips[:, 2] *= along
    place = dict(zip((0, 1, 2, 3), torso, strict=True)) | {4: hips[1] + torso[3], 5: hips[2] + torso[3]}
    lengths = {
        segment_name((a, b)): float(np.linalg.norm(place[a] - place[b]))
        for a, b in SEGMENTS
        if a in place and b in place
    }
    return {name: dimensions.get(name, lengths.get(name, np.nan)) for name in SEGMENT_NAMES}


def completed(
    dimensions: Mapping[str, float],
    covariance: Array,
    reference: Mapping[str, float],
    source: str,
    measured: tuple[str, ...] = (),
    stature: float | None = None,
) -> SegmentLengths:
    """Complete the 17 lengths, and carry the dimensions' uncertainty over to them.

    Parameters
    ----------
    dimensions : mapping
        Metres, by `BODY_DIMENSIONS`.
    covariance : array (11, 11)
        Of the logarithms of the dimensions.
    reference : mapping
        See `lengths_of`.
    source, measured, stature
        See `SegmentLengths`.

    Raises
    ------
    FigureError
        Where no body has such dimensions.
    """
    lengths = lengths_of(dimensions, reference)
    step = 1e-5
    values = np.array([lengths[name] for name in SEGMENT_NAMES])
    slopes = np.empty((len(SEGMENT_NAMES), len(BODY_DIMENSIONS)))
    for column, name in enumerate(BODY_DIMENSIONS):
        moved = lengths_of({**dimensions, name: dimensions[name] * (1 + step)}, reference)
        slopes[:, column] = (np.array([moved[one] for one in SEGMENT_NAMES]) - values) / step
    variance = np.einsum("ij,jk,ik->i", slopes, covariance, slopes)
    deviation = np.sqrt(np.maximum(variance, 0.0))
    return SegmentLengths(
        lengths=lengths,
        deviation=dict(zip(SEGMENT_NAMES, deviation.tolist(), strict=True)),
        source=source,
        measured=measured,
        stature=stature,
    )
