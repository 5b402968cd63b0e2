r"""What the frames of a recording tell of the person in it: lengths, the side of the shoulders, measuring noise.

Bones keep their length, so what the length of a limb's segment scatters over time is the measuring, however fast the
person moves. Two ends that are measured with independent errors of standard deviation :math:`\sigma` in each coordinate
have, to first order in :math:`\sigma` over the length, a distance of standard deviation :math:`\sqrt 2\,\sigma`:

.. math:: \hat\sigma = \frac{1.4826}{\sqrt 2}\,\mathrm{mid}_i\,\mathrm{med}_t\,|l_i(t) - \mathrm{med}_t\,l_i|

over the eight segments i of arms and legs, of which the mean of the middle half is taken. The median absolute deviation
(Rousseeuw & Croux 1993, "Alternatives to the median absolute deviation", J Am Stat Assoc 88:1273) and the middle half
are those of most frames and most limbs: a span of swapped or broken frames, and limbs that drift, do not change them by
much. A recording that was fitted to a skeleton has bones of constant length and tells no noise this way.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Final

import numpy as np

from posekit.body.anthropometry.postures import DEVIATION_OF_MAD
from posekit.body.figure import Figure
from posekit.body.loading import load_figure
from posekit.errors import FigureError
from posekit.geometry import Array, cross
from posekit.robots.scaling import segment_lengths, shoulders_are_behind
from posekit.skeleton import JOINT, SEGMENT_NAMES, SEGMENTS, SIDES

LIMB_NAMES: Final = tuple(
    name for name in SEGMENT_NAMES if name.endswith(("elbow", "wrist", "knee", "ankle"))
)
LIMB_SEGMENTS: Final = tuple(SEGMENTS[SEGMENT_NAMES.index(name)] for name in LIMB_NAMES)

LEAST_FRAMES: Final = 10
"""Frames from which noise is estimated: of ten frames and eight limbs it is within a quarter of the true one."""

BENT_METRES: Final = 0.04
"""Metres that both knees together are before the middles between hip and ankle in a frame that tells the side."""

WORST_OF_USUAL: Final = 3.0
"""Times the usual noise that the worst limb's is believed to be."""

SIZE_BOUNDS: Final = (0.25, 1.6)
"""Sizes, in those of the figure (1.75 m), that people have: newborns 0.28, the tallest man known 1.55."""

LIMB_BOUNDS: Final = (0.6, 1.6)
"""Lengths of limbs, in those of the figure at the person's size, that are believed.

Adults differ by 5 % (`posekit.body.uncertainty.UNKNOWN_ADULT`), and a newborn's legs are two thirds of an adult's at
one size; what is beyond is another unit, or other joints.
"""


@dataclass(frozen=True, kw_only=True)
class MeasuredPerson:
    """A person as a recording has them.

    Parameters
    ----------
    lengths : mapping
        The median of each segment's length, metres, by segment name; segments that are never seen are left out.
    behind : bool or None
        Whether the shoulders lie behind the line from neck to pelvis in most frames.
    noise : float
        Standard deviation of measured coordinates, metres; NaN of fewer than `LEAST_FRAMES` frames.
    noise_by_limb : mapping
        The same by each limb's segment alone, as far as it was seen.
    hips_forward : float
        Degrees by which the hips lie before the line from neck to pelvis, seen from the pelvis, in the median
        frame; NaN of fewer than `LEAST_FRAMES` frames.
    """

    lengths: Mapping[str, float]
    behind: bool | None
    noise: float
    noise_by_limb: Mapping[str, float] = field(default_factory=dict)
    hips_forward: float = math.nan

    def noise_of(self, segment: str) -> float:
        """Return the deviation of the coordinates of a segment's ends, metres: wrists and ankles are measured worse.

        A limb has its own where that is more, up to `WORST_OF_USUAL` times the usual: what scatters beyond is broken.
        """
        own = self.noise_by_limb.get(segment, self.noise)
        return min(max(own, self.noise), WORST_OF_USUAL * self.noise)


def measured_person(joints: Array) -> MeasuredPerson:
    """Measure the person in the frames of a recording (T, 14, 3) or (T, 19, 3), metres; NaN is unknown."""
    by_limb = noise_by_limb(joints)
    return MeasuredPerson(
        lengths=segment_lengths(joints),
        behind=shoulders_are_behind(_unswapped(joints)),
        noise=usual_noise(by_limb),
        noise_by_limb=by_limb,
        hips_forward=hips_forward(joints),
    )


def hips_forward(joints: Array) -> float:
    """Measure how far before the trunk's line the hips lie in the median frame (T, 14, 3), degrees at the pelvis."""
    neck, pelvis, right, left = (
        joints[:, JOINT[name]] for name in ("neck", "pelvis", "right_hip", "left_hip")
    )
    down, hips = pelvis - neck, (right + left) / 2 - pelvis
    with np.errstate(invalid="ignore", divide="ignore"):
        down = down / np.linalg.norm(down, axis=1, keepdims=True)
        forward = cross(down, left - right)
        before = np.einsum("ni,ni->n", hips, forward) / np.linalg.norm(forward, axis=1)
    angles = np.arctan2(before, np.einsum("ni,ni->n", hips, down))
    known = angles[np.isfinite(angles)]
    return math.degrees(float(np.median(known))) if len(known) >= LEAST_FRAMES else math.nan


def hips_outward(lengths: Mapping[str, float]) -> float:
    """Return by how many degrees straight thighs lean inward because a skeleton's hips are wider apart than people's.

    Hips that it has nearer together give a negative number. People's are taken as the built-in figure's, by the length
    of the thigh.

    Parameters
    ----------
    lengths : mapping
        Metres, by segment name.
    """
    usual = load_figure().lengths
    hips, thigh = "right_hip-left_hip", "right_hip-right_knee"
    if not lengths.get(thigh, 0.0) > 0 or hips not in lengths:
        return 0.0
    return math.degrees(math.atan((lengths[hips] / lengths[thigh] - usual[hips] / usual[thigh]) / 2))


def usual_noise(by_limb: Mapping[str, float]) -> float:
    """Return the mean of the middle half of some limbs' noise, metres; NaN where none was seen."""
    each = sorted(by_limb.values())
    outer = len(each) // 4
    return float(np.mean(each[outer : len(each) - outer])) if each else math.nan


def _unswapped(joints: Array) -> Array:
    """Leave out frames whose left and right are exchanged: their knees, where they bend, bend forward.

    Of few frames with bent knees, or none that bends that way, all are kept.
    """
    neck, pelvis, right, left = (
        joints[:, JOINT[name]] for name in ("neck", "pelvis", "right_shoulder", "left_shoulder")
    )
    forward = cross(pelvis - neck, left - right)
    bent = np.zeros(len(joints))
    for side in SIDES:
        hip, knee, ankle = (joints[:, JOINT[f"{side}_{name}"]] for name in ("hip", "knee", "ankle"))
        bent += np.einsum("ni,ni->n", knee - (hip + ankle) / 2, forward)
    with np.errstate(invalid="ignore", divide="ignore"):
        bent /= np.linalg.norm(forward, axis=1)
    return joints[bent > BENT_METRES] if np.sum(bent > BENT_METRES) >= LEAST_FRAMES else joints


def noise_by_limb(joints: Array) -> dict[str, float]:
    """Estimate the standard deviation of measured coordinates by each limb's segment, from frames (T, 14, 3), metres.

    Returns
    -------
    dict
        Metres, by segment name; segments that are seen in fewer than `LEAST_FRAMES` frames are left out.

    Examples
    --------
    >>> import numpy as np, posekit
    >>> still = np.tile(posekit.load_figure().neutral_points[:14], (500, 1, 1))
    >>> seen = still + np.random.default_rng(0).normal(0.0, 0.005, still.shape)
    >>> bool(0.0045 < measured_person(seen).noise < 0.0055)
    True
    """
    starts, ends = np.array(LIMB_SEGMENTS).T
    length = np.linalg.norm(joints[:, ends] - joints[:, starts], axis=-1)
    noise: dict[str, float] = {}
    for name, column in zip(LIMB_NAMES, length.T, strict=True):
        known = column[np.isfinite(column)]
        if len(known) >= LEAST_FRAMES:
            deviation = np.median(np.abs(known - np.median(known)))
            noise[name] = float(DEVIATION_OF_MAD * deviation / math.sqrt(2))
    return noise


def figure_of(figure: Figure, lengths: Mapping[str, float], behind: bool | None) -> Figure:
    """Return the figure with the lengths of a person, as far as they are a person's.

    Lengths that nobody has are left to the figure at the person's size, and so are all where no body is near them: the
    postures that have them are then found not to keep theirs, which judges them one by one and refuses none.

    Parameters
    ----------
    figure : Figure
        The figure.
    lengths : mapping
        Metres, by segment name.
    behind : bool or None
        Whether the person's shoulders lie behind the line from neck to pelvis.
    """
    ratios = {name: lengths[name] / figure.lengths[name] for name in LIMB_NAMES if name in lengths}
    size = float(np.median(list(ratios.values()))) if ratios else 1.0
    if not SIZE_BOUNDS[0] <= size <= SIZE_BOUNDS[1]:
        return figure
    low, high = LIMB_BOUNDS
    usual = {name: size * length for name, length in figure.lengths.items()}
    believed = {
        name: length
        for name, length in lengths.items()
        if length > 0 and (name not in ratios or low <= ratios[name] / size <= high)
    }
    try:
        return figure.scaled({**usual, **believed}, behind=behind)
    except FigureError:
        limbs = {name: length for name, length in believed.items() if name in ratios}
        return figure.scaled({**usual, **limbs}, behind=behind)
