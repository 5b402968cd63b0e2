"""A person's lengths from pictures: one camera, unknown scale, maximum a posteriori over the frames."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Final

import numpy as np

from posekit.body.anthropometry.body import (
    BODY_DIMENSIONS,
    HIP_WIDTH,
    LIMB_PARTS,
    SHOULDER_WIDTH,
    TRUNK_LENGTH,
    SegmentLengths,
    completed,
    dimensions_of,
    limb,
    reference_lengths,
)
from posekit.body.anthropometry.proportions import Sex, lengths_from_proportions, spread
from posekit.body.anthropometry.view_fit import maximise
from posekit.body.anthropometry.view_likelihood import ViewLikelihood
from posekit.body.anthropometry.view_prior import conditioned, positive, prior_covariance, sides_averaged
from posekit.errors import InputError
from posekit.geometry import Array
from posekit.safe_io import refusal
from posekit.skeleton import JOINT, JOINTS, SIDES

MOST_FRAMES: Final = 400
"""Frames that are used, evenly chosen: more of one recording tell little more."""
FEWEST_PIXELS: Final = 2.0
"""Median length seen, pixels, below which it is no person."""
UNKNOWN_STATURE: Final = 1.70
DEPTH_RELIEF_METRES: Final = {
    "upper_arm": 0.15,
    "forearm": 0.22,
    "thigh": 0.15,
    "shank": 0.25,
    SHOULDER_WIDTH: 0.12,
    HIP_WIDTH: 0.1,
    TRUNK_LENGTH: 0.05,
}
"""Metres in depth by which the middle of each is off the body's, standard deviation: a little less than among random
legal postures."""
UPRIGHT_CONCENTRATION: Final = {
    "upper_arm": 2.5,
    "forearm": 0.2,
    "thigh": 6.0,
    "shank": 4.0,
    SHOULDER_WIDTH: -1.5,
    HIP_WIDTH: -1.5,
    TRUNK_LENGTH: 12.0,
}
"""Concentration of each about the picture's plane, where upright people are seen by level cameras from all around.

From the mean squared cosines of 4060 frames of walking, running, jumping and signalling (CMU Graphics Lab Motion
Capture Database): 0.17, 0.32, 0.06, 0.11, 0.50, 0.50, 0.02; somewhat less for thigh and trunk, as others bend more.
"""
TRUNK_LOOSENESS: Final = {SHOULDER_WIDTH: 0.03, HIP_WIDTH: 0.02, TRUNK_LENGTH: 0.05}
"""How much widths and trunk change with posture, as a fraction: the girdle moves, the back bends."""
BENT_TRUNK_SHARE: Final = 0.042
"""How much the trunk is shorter than when straight, among random legal postures; while people walk it is not."""
LIMB_JOINTS: Final = tuple(name for name in JOINTS if name not in ("neck", "pelvis"))
LEAST_NOISE: Final = 0.05
"""Pixels."""


@dataclass(frozen=True, kw_only=True, eq=False)
class ViewLengths:
    """What the pictures say.

    Parameters
    ----------
    lengths : SegmentLengths
        All 17.
    scale : array (T,)
        Pixels a metre at the body in each frame; NaN where nothing was seen.
    frames : int
        Frames that were used.
    independent : float
        As how many independent frames they count: neighbours in a film show nearly the same posture.
    learned : mapping
        For each dimension, the share of the prior's variance that the pictures took away: 0 where they said nothing.
    """

    lengths: SegmentLengths
    scale: Array
    frames: int
    independent: float
    learned: Mapping[str, float]


@dataclass(frozen=True, kw_only=True, eq=False)
class LengthEvidence:
    """What is known of a person and of the pictures, beside the key points.

    Parameters
    ----------
    stature : float, optional
        Standing height, metres.
    known : mapping, optional
        Lengths that are known, metres, by segment name: limbs, ``right_shoulder-left_shoulder``,
        ``right_hip-left_hip``.
    proportions : str
        The prior: one of `posekit.body.anthropometry.proportion_names`.
    sex : str, optional
        ``female`` or ``male``, for the prior.
    both_sides : bool
        Whether left and right are equal.
    scale : array (T,), optional
        Pixels a metre at the body, where it is known: the focal length over the depth.
    noise : float, optional
        Standard deviation of a key point's coordinate, pixels; 15 mm at the body if not given.
    focal : float, optional
        Focal length, pixels: says how much nearer parts of the body may be, which scatters their scale.
    upright : bool
        Whether the camera looks about level at somebody who is mostly upright: legs and trunk then lie rather in the
        picture than along the line of sight. False where every direction is as likely.
    reference : mapping, optional
        The 17 lengths of the body whose torso gives the shape, metres.
    """

    stature: float | None = None
    known: Mapping[str, float] = field(default_factory=dict)
    proportions: str = "de-leva"
    sex: Sex | None = None
    both_sides: bool = True
    scale: Array | None = None
    noise: float | None = None
    focal: float | None = None
    upright: bool = True
    reference: Mapping[str, float] | None = None


def lengths_from_views(image: Array, evidence: LengthEvidence | None = None, **changes: Any) -> ViewLengths:
    r"""Estimate a person's lengths from the key points of one camera over some frames.

    A segment of length l, seen in a frame of scale s (pixels a metre at the body, scaled orthographic), has the image
    :math:`r = s\,l \sin\theta` with noise; its direction is isotropic, or where `upright` rather in the picture. The
    frames' scales are unknown and integrated out over a normal distribution of their logarithm, whose mean and width
    are found too. Pictures alone tell ratios of lengths; the size of the whole comes from the stature or a given one.
    Proportions with their spread among people are the prior: a segment that never turns across the view stays near
    them. Frames that show the same posture again count once (`posekit.body.anthropometry.independent`).

    The neck and the pelvis joint are not used: no detector sees them. The torso inside is the reference's, scaled to
    the widths and the trunk (`posekit.body.anthropometry.body.lengths_of`).

    Parameters
    ----------
    image : array (T, 14, 2) or (T, 12, 2)
        Key points, pixels, in the order of `posekit.skeleton.JOINTS`, with or without neck and pelvis; NaN is missing.
    evidence : LengthEvidence, optional
        What is known beside these.
    changes
        Fields of the evidence that are to differ: ``lengths_from_views(image, stature=1.8)``.

    Returns
    -------
    ViewLengths

    Raises
    ------
    InputError
        Where shapes do not fit, nothing fixes the size, or no frame shows a segment.
    FigureError
        Where the stature is no person's.
    """
    asked = replace(evidence or LengthEvidence(), **changes)
    stature, scale, upright, noise, focal = (
        asked.stature,
        asked.scale,
        asked.upright,
        asked.noise,
        asked.focal,
    )
    points = _points(image)
    base = reference_lengths(asked.reference)
    prior = lengths_from_proportions(
        asked.proportions, UNKNOWN_STATURE if stature is None else stature, sex=asked.sex, reference=base
    )
    dimensions = dimensions_of(prior.lengths)
    middle = np.log([dimensions[name] for name in BODY_DIMENSIONS])
    covariance = prior_covariance(spread(asked.proportions), asked.both_sides)
    middle, covariance = conditioned(middle, covariance, asked.known, stature, scale is not None)
    chosen = np.unique(np.linspace(0, len(points) - 1, min(len(points), MOST_FRAMES)).round().astype(int))
    seen = seen_dimensions(points)
    given = _given_scale(scale, len(points))
    usable = chosen[np.isfinite(seen[chosen]).any(axis=1) & (np.isfinite(given[chosen]) | (scale is None))]
    if len(usable) == 0:
        raise InputError("no frame shows both ends of a segment; give frames with shoulders, hips, knees, …")
    if not np.nanmedian(seen[usable]) >= FEWEST_PIXELS:
        raise refusal(
            "",
            "image",
            f"segments of {np.nanmedian(seen[usable]):.3g} pixels",
            f"{FEWEST_PIXELS:g} or more",
            "give pixels, not fractions of the picture",
        )
    likelihood = ViewLikelihood(
        seen=seen[usable],
        first=np.log(given[usable]) if scale is not None else _first_scale(seen[usable], middle),
        scale_known=scale is not None,
        relief=depth_reliefs(),
        loose=length_looseness(),
        shorter=np.array(
            [0.0 if upright or name != TRUNK_LENGTH else BENT_TRUNK_SHARE for name in BODY_DIMENSIONS]
        ),
        focal=None if focal is None else positive("focal", focal),
        noise=None
        if noise is None
        else max(positive("noise", noise + LEAST_NOISE) - LEAST_NOISE, LEAST_NOISE),
        concentration=_concentrations(upright),
    )
    fit = maximise(likelihood, middle, covariance)
    independent = float(np.median(fit.independent[fit.independent > 0]))
    scales = np.full(len(points), np.nan)
    scales[usable] = np.exp(likelihood.posterior_scales(fit.y))
    count = len(BODY_DIMENSIONS)
    if asked.both_sides:
        fit.y[:count] = sides_averaged(fit.y[:count])
    learned = 1 - np.diag(fit.covariance)[:count] / np.diag(covariance)
    source = f"key points of {len(usable)} frames ({independent:.0f} independent), prior: {prior.source}"
    return ViewLengths(
        lengths=completed(
            dict(zip(BODY_DIMENSIONS, np.exp(fit.y[:count]).tolist(), strict=True)),
            fit.covariance[:count, :count],
            base,
            source,
            tuple(
                name
                for k, name in enumerate(BODY_DIMENSIONS)
                if name != TRUNK_LENGTH and np.isfinite(likelihood.seen[:, k]).any()
            ),
            stature,
        ),
        scale=scales,
        frames=len(usable),
        independent=independent,
        learned=dict(zip(BODY_DIMENSIONS, np.maximum(learned, 0.0).tolist(), strict=True)),
    )


def _points(image: Array) -> Array:
    """Return key points (T, 14, 2)."""
    given = np.asarray(image, dtype=np.float64)
    if given.ndim != 3 or given.shape[1:] not in ((len(JOINTS), 2), (len(LIMB_JOINTS), 2)) or not len(given):
        raise InputError(f"key points have shape {given.shape}; expected (T, 14, 2) or (T, 12, 2), T frames")
    if np.isinf(given).any():
        raise InputError("key points: got an infinite coordinate; expected finite numbers, NaN where missing")
    if given.shape[1] == len(JOINTS):
        return given
    points = np.full((len(given), len(JOINTS), 2), np.nan)
    points[:, [JOINT[name] for name in LIMB_JOINTS]] = given
    return points


def depth_reliefs() -> Array:
    """Return `DEPTH_RELIEF_METRES` of each of `BODY_DIMENSIONS` (11,)."""
    of_limbs = {limb(side, part): DEPTH_RELIEF_METRES[part] for part in LIMB_PARTS for side in SIDES}
    return np.array([(DEPTH_RELIEF_METRES | of_limbs)[name] for name in BODY_DIMENSIONS])


def length_looseness() -> Array:
    """Return `TRUNK_LOOSENESS` of each of `BODY_DIMENSIONS` (11,); none of a bone."""
    return np.array([TRUNK_LOOSENESS.get(name, 0.0) for name in BODY_DIMENSIONS])


def seen_dimensions(points: Array) -> Array:
    """Return the lengths of `BODY_DIMENSIONS` in pictures (T, 14, 2): (T, 11), pixels."""
    ends = [name.split("-") for name in BODY_DIMENSIONS if name != TRUNK_LENGTH]
    starts, stops = ([JOINT[pair[k]] for pair in ends] for k in (0, 1))
    apart = points[:, starts] - points[:, stops]
    shoulders = points[:, [JOINT[f"{side}_shoulder"] for side in SIDES]].mean(axis=1)
    hips = points[:, [JOINT[f"{side}_hip"] for side in SIDES]].mean(axis=1)
    return np.asarray(np.linalg.norm(np.concatenate([apart, (shoulders - hips)[:, None]], axis=1), axis=-1))


def _first_scale(seen: Array, middle: Array) -> Array:
    """Guess the logarithm of each scale: the second longest image against its length, as one may be an outlier."""
    with np.errstate(divide="ignore"):
        ratios = np.sort(np.where(np.isnan(seen), -np.inf, np.log(np.maximum(seen, 1e-3)) - middle), axis=1)
    second = ratios[:, -2]
    first = np.where(np.isfinite(second), second, ratios[:, -1])
    # Where all of a frame lies along the line of sight, the other frames say more about its scale.
    usual = float(np.median(first))
    return np.asarray(np.clip(first, usual - 1.5, usual + 1.5))


def _given_scale(scale: Array | None, count: int) -> Array:
    if scale is None:
        return np.full(count, np.nan)
    given = np.asarray(scale, dtype=np.float64)
    if given.shape != (count,):
        raise InputError(f"scale has shape {given.shape}; expected ({count},), one a frame")
    if np.isinf(given).any() or (given <= 0).any():
        raise InputError("scale: expected positive numbers, pixels a metre, NaN where unknown")
    return given


def _concentrations(upright: bool) -> Array:
    """Return the concentration (11,) of each of `BODY_DIMENSIONS`."""
    given = {limb(side, part): UPRIGHT_CONCENTRATION[part] for part in LIMB_PARTS for side in SIDES}
    values = [given.get(name, UPRIGHT_CONCENTRATION.get(name, 0.0)) for name in BODY_DIMENSIONS]
    return np.array(values) if upright else np.zeros(len(BODY_DIMENSIONS))
