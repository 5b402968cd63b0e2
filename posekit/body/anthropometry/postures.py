"""A person's lengths from recordings in space."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np

from posekit.body.anthropometry.body import (
    BODY_DIMENSIONS,
    TRUNK_LENGTH,
    SegmentLengths,
    completed,
    dimensions_of,
    reference_lengths,
)
from posekit.body.anthropometry.independent import unlike_neighbours
from posekit.body.anthropometry.proportions import lengths_from_proportions, spread
from posekit.body.closing import closed_lengths, closing_line
from posekit.errors import FigureError, InputError
from posekit.geometry import Array
from posekit.skeleton import JOINT, JOINTS, SEGMENT_NAMES, SEGMENTS, SIDES

DEVIATION_OF_MAD: Final = 1.4826
"""Standard deviation of a normal distribution over its median absolute deviation."""
DEVIATION_OF_MEDIAN: Final = float(np.sqrt(np.pi / 2))
"""Standard deviation of a median over that of a mean."""
USUAL_STATURE: Final = 1.70
SHORTEST_SEGMENT, LONGEST_SEGMENT = 0.01, 2.0
"""Metres: beyond them a recording is more likely in another unit."""


@dataclass(frozen=True, kw_only=True)
class PostureLengths:
    """What a recording says.

    Parameters
    ----------
    lengths : SegmentLengths
        All 17; deviations are of the estimates.
    spread : mapping
        Standard deviation of each segment's length over the frames, metres: noise, and parts that are not rigid; by
        segment name, those that were seen.
    frames : mapping
        In how many frames each was seen.
    """

    lengths: SegmentLengths
    spread: Mapping[str, float]
    frames: Mapping[str, int]


def lengths_from_postures(
    joints: Array,
    *,
    stature: float | None = None,
    proportions: str = "de-leva",
    reference: Mapping[str, float] | None = None,
) -> PostureLengths:
    r"""Estimate a person's lengths from joints in space; left and right are separate.

    A segment's length is the median of its distances m, less what noise adds: with noise of variance
    :math:`\tau^2` along each axis of their difference, distances have their mean at :math:`l + \tau^2 / l` to first
    order, so the likeliest length is :math:`l = (m + \sqrt{m^2 - 4 \tau^2}) / 2`. The spread of the distances, by
    their median absolute deviation, gives :math:`\tau`, so single frames that are off do not count.

    What was never seen follows from proportions: neck and pelvis joint, which triangulated key points do not have, from
    the shape of the reference's torso (`posekit.body.anthropometry.body.lengths_of`); a missing limb from the
    stature, or else from the size of the limbs that were seen.

    Parameters
    ----------
    joints : array (T, 14, 3)
        Metres, in the order of `posekit.skeleton.JOINTS`, any frame; NaN is missing.
    stature : float, optional
        Standing height, metres.
    proportions : str
        One of `posekit.body.anthropometry.proportion_names`.
    reference : mapping, optional
        The 17 lengths of the body whose torso gives the shape, metres.

    Returns
    -------
    PostureLengths

    Raises
    ------
    InputError
        Where the shape is another, no segment was ever seen, or lengths are no person's in metres.
    FigureError
        Where no body has such lengths.
    """
    points = np.asarray(joints, dtype=np.float64)
    if points.ndim != 3 or points.shape[1:] != (len(JOINTS), 3):
        raise InputError(f"joints have shape {points.shape}; expected (T, {len(JOINTS)}, 3)")
    if np.isinf(points).any():
        raise InputError("joints: got an infinite coordinate; expected finite numbers, NaN where missing")
    starts, ends = np.array(SEGMENTS).T
    distance = np.linalg.norm(points[:, starts] - points[:, ends], axis=-1)
    names = (*SEGMENT_NAMES, TRUNK_LENGTH)
    shoulders, hips = (
        points[:, [JOINT[f"{side}_{joint}"] for side in SIDES]].mean(axis=1) for joint in ("shoulder", "hip")
    )
    distance = np.concatenate([distance, np.linalg.norm(shoulders - hips, axis=-1)[:, None]], axis=1)
    found, deviation, scatter = _robust(distance)
    seen = {name: k for k, name in enumerate(names) if np.isfinite(found[k])}
    if not seen:
        raise InputError("no frame has both ends of a segment; give frames with shoulders, hips, knees, …")
    for name, k in seen.items():
        if not SHORTEST_SEGMENT <= found[k] <= LONGEST_SEGMENT:
            raise InputError(
                f"{name} is {found[k]:g} m; expected {SHORTEST_SEGMENT} to {LONGEST_SEGMENT} m; is the recording in "
                "another unit, or are two joints one?"
            )
    lengths = _completed(seen, found, deviation, stature, proportions, reference)
    count = np.isfinite(distance).sum(axis=0)
    segments = {name: k for name, k in seen.items() if name != TRUNK_LENGTH}
    return PostureLengths(
        lengths=lengths,
        spread={name: float(scatter[k]) for name, k in segments.items()},
        frames={name: int(count[k]) for name, k in segments.items()},
    )


def _robust(distance: Array) -> tuple[Array, Array, Array]:
    """Return length, its deviation, and the spread of each segment (M,); NaN where it was never seen."""
    found, deviation, scatter = (np.full(distance.shape[1], np.nan) for _ in range(3))
    count, _ = unlike_neighbours(distance, np.zeros(distance.shape[1]))
    for k, column in enumerate(distance.T):
        values = column[np.isfinite(column)]
        if len(values) == 0:
            continue
        middle = float(np.median(values))
        tau = DEVIATION_OF_MAD * float(np.median(np.abs(values - middle)))
        found[k] = (middle + np.sqrt(max(middle**2 - 4 * tau**2, 0.0))) / 2
        scatter[k] = tau
        deviation[k] = DEVIATION_OF_MEDIAN * tau / np.sqrt(max(count[k], 1.0))
    return found, deviation, scatter


def _completed(
    seen: dict[str, int],
    found: Array,
    deviation: Array,
    stature: float | None,
    proportions: str,
    reference: Mapping[str, float] | None,
) -> SegmentLengths:
    """Take what was seen, and the rest from proportions."""
    base = reference_lengths(reference)
    prior = lengths_from_proportions(
        proportions, USUAL_STATURE if stature is None else stature, reference=base
    )
    dimensions = dimensions_of(prior.lengths)
    relative = spread(proportions)
    inside = [name for name in BODY_DIMENSIONS if name in seen]
    if stature is None and inside:
        size = float(np.median([found[seen[name]] / dimensions[name] for name in inside]))
        dimensions = {name: size * length for name, length in dimensions.items()}
    for k, name in enumerate(BODY_DIMENSIONS):
        if name in seen:
            dimensions[name] = float(found[seen[name]])
            relative[k] = deviation[seen[name]] / dimensions[name]
    whole = completed(dimensions, np.diag(relative**2), base, "", (), stature)
    lengths, off = dict(whole.lengths), dict(whole.deviation)
    measured = tuple(name for name in SEGMENT_NAMES if name in seen)
    changed = ""
    exact = lengths | {name: float(found[seen[name]]) for name in measured}
    try:
        closed = closed_lengths(exact)  # medians of noisy distances need not close
        lengths, changed = dict(closed.lengths), closing_line(closed.moved)
        off |= {name: float(deviation[seen[name]]) for name in measured}
    except FigureError:
        measured = tuple(name for name in measured if name in BODY_DIMENSIONS)
    missing = [name for name in SEGMENT_NAMES if name not in measured]
    says = "a recording in space" + (
        f"; {len(missing)} of 17 from proportions ({prior.source})" if missing else ""
    )
    says += f"; {changed}" if changed else ""
    return SegmentLengths(lengths=lengths, deviation=off, source=says, measured=measured, stature=stature)
