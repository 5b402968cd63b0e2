"""Certification: postures are judged by the checks, with tolerances that allow for the noise of the view."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Final

import numpy as np
from numpy.typing import NDArray

from posekit.body import Figure, LengthUncertainty
from posekit.geometry import Array
from posekit.recovery.person import sided
from posekit.settings import MEASURED, RecoverSettings, Tolerance
from posekit.solver import Limits
from posekit.validators.check import Check
from posekit.validators.judge import PostureJudge, judge_postures
from posekit.validators.ranges import limits_of, load_ranges

#: Number of standard deviations by which a certified posture may violate lengths and joint limits.
ALLOWED_DEVIATIONS: Final = 3.0

#: Standard deviation of the solver's soft joint limits, degrees.
LIMIT_DEGREES: Final = 2.0

#: Overlap of bodies (metres) that depth errors explain; length (metres) of a forearm, whose length error adds to the
#: overlap, because forearms overlap other parts most often; and overlap (metres) with an uncalibrated camera, where
#: joints have errors of 3 to 5 cm.
CONTACT_METRES, FOREARM_METRES, PHOTOGRAPH_CONTACT_METRES = 0.03, 0.24, 0.06


def certified(
    judge: PostureJudge, checks: Iterable[Check], points: Array
) -> tuple[NDArray[np.str_], dict[str, Array]]:
    """Judge postures (N, 19, 3); unknown head points are NaN.

    Returns
    -------
    reason : str array (N,)
        ``check/place`` of the worst violation of each posture; empty if the posture passes.
    margins : dict of str to array (N,)
        Worst margin of each posture by check, in the check's unit; NaN if the check is undecided.
    """
    rows, worst, reason = np.arange(len(points)), np.zeros(len(points)), [""] * len(points)
    margins: dict[str, Array] = {}
    found = judge_postures(
        points, checks, judge.figure, judge.settings, tolerance=judge.tolerance, up=judge.up
    )
    for name, one in found.items():
        share = np.where(np.isnan(one.margin), np.inf, one.share)
        place = share.argmin(axis=1)
        margin = one.margin[rows, place]
        margins[name] = np.where(np.isfinite(margin), margin, np.nan)
        least = np.where(one.violated.any(axis=1), share[rows, place], 0.0)
        for k in np.flatnonzero(least < worst).tolist():
            reason[k] = f"{name}/{one.places[place[k]]}"
        worst = np.minimum(worst, least)
    return np.array(reason, dtype=np.str_), margins


def noisy_judge(
    figure: Figure, settings: RecoverSettings, lengths: LengthUncertainty, up: Array, *, photograph: bool
) -> PostureJudge:
    """Return a judge of postures whose tolerances allow for noise.

    The solver treats joint limits as soft, so a posture may exceed a limit by three standard deviations. A segment
    length may also have an error of three standard deviations. The standard deviation includes the uncertainty of the
    body's size, except in a photograph, where the solver estimates the size. Bodies may overlap by the amount that
    depth errors explain. If lengths are too uncertain, it is undecided whether the shoulders lie in front of the neck
    or behind it.
    """
    deviation = {name: lengths.own[name] if photograph else lengths.total(name) for name in figure.lengths}
    off = max(deviation[name] * length for name, length in figure.lengths.items())
    rigid = max(MEASURED.rigid, ALLOWED_DEVIATIONS * off)
    tolerance = Tolerance(rigid=rigid, tangent=rigid, angle=ALLOWED_DEVIATIONS * LIMIT_DEGREES)
    contact = CONTACT_METRES + ALLOWED_DEVIATIONS * max(lengths.own.values()) * FOREARM_METRES
    overlap = PHOTOGRAPH_CONTACT_METRES if photograph else contact
    asked = settings.changed(contact_margin=settings.contact_margin - overlap)
    return PostureJudge(sided(figure, lengths), asked, tolerance, up)


def solver_limits(figure: Figure, checks: Iterable[Check], ranges: str) -> Limits | None:
    """Return the joint limits that the solver applies as soft limits; None if joint limits are not checked."""
    table = load_ranges(ranges)
    asked = "joint-range" in [check.name for check in checks]
    return limits_of(figure, table) if asked and (table is None or table["kind"] == "anatomical") else None
