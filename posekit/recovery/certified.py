"""The checks that every refined posture passes: those that are asked of any posture, with what the noise allows."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from posekit.body import Figure
from posekit.compiled.compiling import is_fast
from posekit.compiled.verdicts import NO_VIOLATION
from posekit.geometry import Array
from posekit.recovery.body import ranges_of
from posekit.recovery.noise import Noise
from posekit.refinement.observed_frames import LIMIT_DEVIATION
from posekit.settings import ALLOWED_DEVIATIONS, RIGID_TOLERANCE, RecoverSettings, Tolerance
from posekit.tree import Check, Scope, screened
from posekit.validators import CheckOptions, Judgement, judge, make_checks
from posekit.validators.options import LEVEL_CAMERA_UP


def certified_within(noise: Noise, figure: Figure) -> Tolerance:
    """Return how far refined postures may be off.

    Angles: limits pull at what is beyond them, so an angle that feels one is known at least as well as that,
    whatever the noise: three of those deviations do not contradict it. Distances: what is allowed of any measured body,
    and more where lengths are known worse than such bodies'; how well a body fits its lengths, chi-square has judged.
    """
    off = max(noise.lengths.total(name) * length for name, length in figure.lengths.items())
    rigid = max(RIGID_TOLERANCE, ALLOWED_DEVIATIONS * off)
    return Tolerance(rigid=rigid, tangent=rigid, placement=False, angle=ALLOWED_DEVIATIONS * LIMIT_DEVIATION)


def certifying_checks(figure: Figure, settings: RecoverSettings, tolerance: Tolerance) -> list[Check]:
    """Make those of the checks that judge a posture by itself, as `posekit.Validator` makes them."""
    options = CheckOptions(
        ranges=ranges_of(settings),
        rigid_tolerance=tolerance.distances,
        rigid_mode="side",
        limbs=True,
        angle_tolerance=tolerance.angle,
        directions=True,
        contact_margin=settings.contact_margin,
        up=LEVEL_CAMERA_UP,
    )
    made = make_checks(figure, settings.checks, options)
    return [check for check in made if check.scope is not Scope.MOTION]


@dataclass(frozen=True, kw_only=True, eq=False)
class Contradiction:
    """Postures that a check contradicts.

    Parameters
    ----------
    check : str
        The name of the check.
    where, unit : tuple of str (K,)
        Its places.
    row : int array (M,)
        The postures.
    place : int8 array (M,)
        Where each is off most.
    value, lower, upper : array (M,)
        What was found there, and its bounds.
    """

    check: str
    where: tuple[str, ...]
    unit: tuple[str, ...]
    row: NDArray[np.intp]
    place: NDArray[np.int8]
    value: Array
    lower: Array
    upper: Array


def contradictions(checks: Sequence[Check], points: Array, asked: NDArray[np.intp]) -> list[Contradiction]:
    """Judge some postures (N, 19, 3); `asked` (N,) are their numbers. Each is contradicted once at most."""
    found = []
    quick = [check for check in checks if not check.slow]
    slow = [check for check in checks if check.slow]
    for part in (quick, slow):
        # To judge what is slow only to judge it again is slower still, unless compiled screens clear most of it.
        every = part is slow and not is_fast(0)
        doubtful = np.ones((len(points), len(part)), dtype=np.bool_) if every else _doubtful(part, points)
        rows = np.flatnonzero(doubtful.any(axis=1))
        if not (part and len(rows)):
            continue
        open_ = np.ones(len(asked), dtype=np.bool_)
        for judgement in judge(_with_same_places(part, doubtful), points[rows]):
            bad = np.flatnonzero(judgement.violated.any(axis=1) & open_[rows])
            open_[rows[bad]] = False
            if bad.size:
                found.append(_contradiction(judgement, bad, asked[rows[bad]]))
        points, asked = points[open_], asked[open_]
    return found


def _doubtful(checks: Sequence[Check], points: Array) -> NDArray[np.bool_]:
    """Return which postures are not clearly valid by which of C checks (N, C); compiled loops ask their screens."""
    doubtful = np.zeros((len(points), len(checks)), dtype=np.bool_)
    fast = {c: one for c, check in enumerate(checks) if is_fast(0) and (one := check.passing) is not None}
    if fast:
        places, _ = screened([*fast.values()], [checks[c].points for c in fast], points)
        doubtful[:, [*fast]] = places != NO_VIOLATION
    for column, check in enumerate(checks):
        if column not in fast:
            doubtful[:, column] = check.judge(points[:, list(check.points)]).violated.any(axis=1)
    return doubtful


def _with_same_places(checks: Sequence[Check], doubtful: NDArray[np.bool_]) -> list[Check]:
    """Return those of C checks that are doubtful anywhere (N, C), and those that judge a place of theirs too.

    Of two that judge one place the later holds where it can.
    """
    places = {
        where for check, found in zip(checks, doubtful.T, strict=True) if found.any() for where in check.where
    }
    return [check for check in checks if not places.isdisjoint(check.where)]


def _contradiction(judgement: Judgement, bad: NDArray[np.intp], row: NDArray[np.intp]) -> Contradiction:
    off = np.where(judgement.violated[bad], judgement.margin[bad], np.inf)
    off = np.where(np.isnan(off), -np.inf, off)
    place = off.argmin(axis=1)
    value, lower, upper = (table[bad, place] for table in (judgement.value, judgement.lower, judgement.upper))
    return Contradiction(
        check=judgement.check,
        where=judgement.where,
        unit=judgement.unit,
        row=row,
        place=place.astype(np.int8),
        value=value,
        lower=lower,
        upper=upper,
    )
