"""One body for a clip: the lengths that all frames of a view explain together, before any of them is recovered."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from posekit.body import Figure, LengthUncertainty
from posekit.body.uncertainty import MEASURED_LENGTHS
from posekit.cameras import PinholeCamera
from posekit.geometry import Array
from posekit.ranking.posture_prior import Prior
from posekit.ranking.prior_file import load_prior
from posekit.ranking.upright import Up
from posekit.recovery.body import FigureBody
from posekit.recovery.fit_camera import CameraFit, fit_camera
from posekit.recovery.grower import Grower
from posekit.recovery.hypotheses import ObservedHypotheses
from posekit.recovery.noise import Noise
from posekit.recovery.observed import trunkless, with_reasons
from posekit.recovery.person import FEWEST_CLIP_FRAMES
from posekit.refinement import RootPrior
from posekit.refinement.limb_evidence import DirectionDensity
from posekit.refinement.one_body import BodyEstimate, PostureDirections, find_body
from posekit.skeleton import LIMB_JOINTS, SEGMENT_NAMES, segment_name

MOST_FRAMES: Final = 40
"""Frames that count: more of one clip tell little more."""

FRAMES_USED: Final = 20
"""Frames that are looked at, spread evenly: each stands for two where there are as many."""

UNSTATED_OWN: Final = 0.08
"""Deviation of each length beside the size from which a clip starts where nobody says how well lengths are known.

Starts that are 10 % off are then no surprise: what is evenly spread over 10 % either way has a standard deviation of
6 %, and the proportions of people have one of 5 % (`posekit.body.uncertainty.UNKNOWN_ADULT`).
"""

UNSTATED_COMMON: Final = 0.1
"""The same of the size, where the necks' depths tell it."""

PLACED_DEVIATION: Final = 0.1
"""Relative deviation of the depth of a neck that was placed by the lengths themselves."""

KNOWN_DEPTH_METRES: Final = 0.005
"""Deviation of the depth of a neck that was given."""

LATERAL_METRES: Final = 0.03
"""Deviation beside its ray: the image point says the rest."""

MAX_LENGTHS_NAMED: Final = 6
"""Lines in which lengths are named."""

FACTOR_NAMED: Final = 0.02
"""Relative change of a length that is named."""


@dataclass(frozen=True, kw_only=True, eq=False)
class ClipBody:
    """The body of a clip.

    Parameters
    ----------
    start : mapping
        The lengths that it started from, metres.
    estimate : BodyEstimate
        What was found.
    known : LengthUncertainty
        How far its lengths may be off.
    """

    start: Mapping[str, float]
    estimate: BodyEstimate
    known: LengthUncertainty

    @property
    def lengths(self) -> Mapping[str, float]:
        """The lengths, metres."""
        return self.estimate.lengths

    @property
    def varying(self) -> LengthUncertainty:
        """How far the lengths of one frame may be off: joints move in a body by as much as in a measured one."""
        own = {name: float(np.hypot(one, MEASURED_LENGTHS.own[name])) for name, one in self.known.own.items()}
        return replace(self.known, own=own)

    def document(self) -> dict[str, Any]:
        """Return what results say of it."""
        return {
            "frames": self.estimate.frames,
            "start": dict(self.start),
            "lengths": dict(self.lengths),
            "deviation": dict(self.known.own),
            "size_deviation": self.known.common,
            "sized": self.estimate.sized,
            "size": "told by the necks" if self.estimate.sized else "not told: depth and size look alike",
        }


def changed_lengths(
    stated: Mapping[str, float], found: Mapping[str, float], known: LengthUncertainty, *, sized: bool
) -> list[str]:
    """Name lengths that differ from stated ones by more than two deviations and `FACTOR_NAMED`: size first, then each.

    Parameters
    ----------
    stated, found : mapping
        Metres, by segment name.
    known : LengthUncertainty
        How far those that were found may be off.
    sized : bool
        Whether the size could be told.
    """
    logarithm = {name: float(np.log(found[name] / stated[name])) for name in SEGMENT_NAMES}
    size = float(np.average(list(logarithm.values()), weights=[1 / known.own[n] ** 2 for n in logarithm]))
    lines = []
    if not sized:
        lines.append(
            "the pictures do not tell how large the body is, as it looks the same larger and further away: size and "
            "depth are those of the lengths that it was recovered with"
        )
    elif abs(size) > max(2 * known.common, FACTOR_NAMED):
        lines.append(
            f"all lengths are stated {abs(np.expm1(-size)):.1%} too {'short' if size > 0 else 'long'} "
            f"(+- {known.common:.1%})"
        )
    beside = {name: value - (size if sized else 0.0) for name, value in logarithm.items()}
    for name, value in sorted(beside.items(), key=lambda one: -abs(one[1]) / known.own[one[0]]):
        if abs(value) > max(2 * known.own[name], FACTOR_NAMED):
            lines.append(
                f"{name} is stated as {stated[name]:.3f} m, {abs(np.expm1(-value)):.1%} too "
                f"{'short' if value > 0 else 'long'}{' beside that' if sized and lines else ''}: "
                f"{found[name]:.3f} m (+- {known.own[name]:.1%})"
            )
    return lines


def body_of_clip(grower: Grower, noise: Noise, prior: Prior | None = None) -> ClipBody | None:
    """Find one body for the frames of a view; None where they are too few.

    Parameters
    ----------
    grower : Grower
        Of a view of one person by an `opencv` camera; its figure's lengths are the start.
    noise : Noise
        How far image points may be off, and those lengths. Where neither the view nor the settings say how well the
        lengths are known, they are only a start if the frames say so.
    prior : Prior, optional
        What is known of postures; the built-in one if not given.
    """
    view, fit, figure = grower.view, grower.fit, grower.body.figure
    stated = grower.settings.length_deviation is not None or view.length_deviation is not None
    rows, sized = _rows(fit)
    if len(rows) < FEWEST_CLIP_FRAMES:
        return None
    count = min(len(rows), FRAMES_USED)
    stands_for = min(len(rows), MOST_FRAMES) / count
    rows = rows[np.linspace(0, len(rows) - 1, count).round().astype(np.intp)]
    camera = fit.cameras(rows)
    if not isinstance(camera, PinholeCamera):
        return None
    observed = ObservedHypotheses.of(view, fit, rows, camera, figure, noise).sight
    root: Array = fit.root[rows]
    depth = KNOWN_DEPTH_METRES if sized else PLACED_DEVIATION * root[:, 2]
    observed = replace(
        observed, root=RootPrior.along_ray(camera, root, depth=depth, lateral=LATERAL_METRES), walls=None
    )
    directions = _directions(prior or load_prior("cmu"))
    find = partial(find_body, observed, directions=directions, sized=sized, stands_for=stands_for)
    estimate = find(known=noise.lengths)
    if not stated and _surprise(estimate, figure, noise.lengths) > 1:
        estimate = find(known=_widened(noise.lengths))
    if estimate.frames * stands_for < FEWEST_CLIP_FRAMES:
        return None
    found = estimate.uncertainty
    return ClipBody(
        start=figure.lengths,
        estimate=estimate,
        known=found if sized else replace(found, common=noise.lengths.common),
    )


def with_body(grower: Grower, clip: ClipBody) -> Grower:
    """Return the grower of the same view with the body of the clip; necks that were placed are placed anew."""
    if not isinstance(grower.body, FigureBody):
        return grower
    body = replace(grower.body, figure=grower.body.figure.scaled(dict(clip.lengths)))
    fit = grower.fit
    if fit.placements is not None:
        fit = fit_camera(grower.view, body.figure, grower.settings.rooting, None, clip.varying)
        fit = replace(fit, reasons=with_reasons(fit.reasons, body, trunkless(grower.view, body)))
    return replace(grower, body=body, fit=fit)


def _surprise(estimate: BodyEstimate, figure: Figure, known: LengthUncertainty) -> float:
    """Return the mean square of limbs' changes beside the size, in the deviations that were known."""
    names = [segment_name((limb[k], limb[k + 1])) for limb in LIMB_JOINTS for k in range(2)]
    moved = np.array([np.log(estimate.lengths[name] / figure.lengths[name]) for name in names])
    return float(np.mean(((moved - np.median(moved)) / [known.own[name] for name in names]) ** 2))


def _widened(known: LengthUncertainty) -> LengthUncertainty:
    """Return what is known of lengths that are only a start."""
    own = {name: max(one, UNSTATED_OWN) for name, one in known.own.items()}
    return LengthUncertainty(common=max(known.common, UNSTATED_COMMON), own=own)


def _rows(fit: CameraFit) -> tuple[NDArray[np.intp], bool]:
    """Choose one hypothesis a frame, its likeliest; all of necks that were given, if most were."""
    usable = np.flatnonzero(np.isfinite(fit.root).all(axis=1))
    placements = fit.placements or [None] * len(fit.reasons)
    if fit.pose is not None and not fit.placements:
        given = np.zeros(len(usable), dtype=np.bool_)
    else:
        given = np.array([placements[k] is None for k in fit.frame[usable].tolist()], dtype=np.bool_)
    sized = bool(given.sum() >= max(FEWEST_CLIP_FRAMES, given.size / 2))
    usable = usable[given] if sized else usable
    chosen = []
    for k in dict.fromkeys(fit.frame[usable].tolist()):
        rows = usable[fit.frame[usable] == k]
        placement = placements[k]
        best = 0
        if placement is not None and len(placement.misfit) == len(rows):
            misfit = np.nan_to_num(placement.misfit, nan=np.inf)
            best = int(np.argmin(misfit))
        chosen.append(int(rows[best]))
    return np.array(chosen, dtype=np.intp), sized


def _directions(prior: Prior) -> PostureDirections:
    """Take what is known of limbs and trunks from a prior of postures."""
    limbs = tuple(
        _density(prior, [segment_name((limb[k], limb[k + 1])) for k in range(2)]) for limb in LIMB_JOINTS
    )
    return PostureDirections(
        limbs=limbs, trunk=_density(prior, ["hips.left", "hips.down", "up"], sine=Up.level().sine)
    )


def _density(prior: Prior, names: list[str], sine: float = 0.0) -> DirectionDensity:
    """Return the density of some directions of one block; the variance of `up` is as much more as it may be off."""
    block = next(block for block in prior.blocks if set(names) <= set(block.names))
    rows = [3 * block.names.index(name) + axis for name in names for axis in range(3)]
    student = block.student.moments
    scale = student.scale[np.ix_(rows, rows)].copy()
    if "up" in names:
        at = 3 * names.index("up") + np.arange(3)
        scale[at, at] += sine**2
    return DirectionDensity(
        mean=student.means[0, rows],
        whitening=np.linalg.inv(np.linalg.cholesky(scale)),
        dof=student.dof,
    )
