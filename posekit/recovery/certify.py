"""Certification: every survivor passes the checks of postures, with the tolerance that its noise leaves."""

from __future__ import annotations

from functools import cached_property
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from posekit.body import Figure, LengthUncertainty
from posekit.geometry import Array, perpendicular, unit
from posekit.settings import MEASURED, RecoverSettings, Tolerance
from posekit.skeleton import HIPS, JOINT
from posekit.solver import Limits
from posekit.validators.check import Check
from posekit.validators.judge import PostureJudge, chosen_checks, early_checks, judge_postures
from posekit.validators.ranges import load_ranges

#: Standard deviations of lengths and of joint limits that do not contradict a posture.
ALLOWED_DEVIATIONS: Final = 3.0

#: Standard deviation with which joint limits pull under noise, degrees.
LIMIT_DEGREES: Final = 2.0

#: Overlap of bodies that depths under noise explain, with ALLOWED_DEVIATIONS of a forearm's length beside it, as it is
#: before other parts most often; overlap before an uncalibrated camera, whose joints are off by 3 to 5 cm; metres.
CONTACT_METRES, FOREARM_METRES, PHOTOGRAPH_CONTACT_METRES = 0.03, 0.24, 0.06


class Certificate(NamedTuple):
    """Verdicts on N postures.

    Attributes
    ----------
    valid : bool array (N,)
    reason : list of str
        ``check/place`` of the worst violation of each; empty if there is none.
    margins : dict of str to array (N,)
        Worst margin of each check, in its unit; NaN where it decided nothing.
    """

    valid: NDArray[np.bool_]
    reason: list[str]
    margins: dict[str, Array]


class Certifier:
    """The checks that a recovery asks about one figure.

    Parameters
    ----------
    figure : Figure
        The person's.
    settings : RecoverSettings
    tolerance : Tolerance
        Allowed differences.
    up : array (3,)
        Unit vector against gravity, camera frame.
    """

    def __init__(self, figure: Figure, settings: RecoverSettings, tolerance: Tolerance, up: Array) -> None:
        self.figure, self.settings, self.tolerance, self.up = figure, settings, tolerance, up
        self.checks = [
            check
            for check in chosen_checks(settings, of_robot=False, in_time=False)
            if not getattr(check, "over_time", False)
        ]

    @cached_property
    def early(self) -> list[Check]:
        """The checks as a tree asks them."""
        return early_checks(self.settings)

    @cached_property
    def judge(self) -> PostureJudge:
        """What asks them."""
        return PostureJudge(self.figure, self.settings, self.tolerance, self.up)

    def certify(self, joints: Array, head: Array) -> Certificate:
        """Judge postures (N, 14, 3) with head points (N, 5, 3), NaN where not known."""
        points = np.concatenate([joints, head], axis=1)
        rows, worst, reason = np.arange(len(points)), np.zeros(len(points)), [""] * len(points)
        margins: dict[str, Array] = {}
        found = judge_postures(
            points, self.checks, self.figure, self.settings, tolerance=self.tolerance, up=self.up
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
        return Certificate(worst >= 0, reason, margins)


def noisy_tolerance(figure: Figure, lengths: LengthUncertainty, *, sized: bool) -> Tolerance:
    """Return the tolerance of postures under noise.

    The solver only pulls at limits: a posture may be beyond them by three of their deviations. Lengths may be off by
    three of their own deviations, and by the common size unless the solver fits it (`sized`).
    """
    deviation = {name: lengths.own[name] if sized else lengths.total(name) for name in figure.lengths}
    off = max(deviation[name] * length for name, length in figure.lengths.items())
    rigid = max(MEASURED.rigid, ALLOWED_DEVIATIONS * off)
    return Tolerance(rigid=rigid, tangent=rigid, angle=ALLOWED_DEVIATIONS * LIMIT_DEGREES)


def noisy_contact(settings: float, lengths: LengthUncertainty, *, photograph: bool) -> float:
    """Return the distance that bodies must keep under noise, metres: negative allows overlap."""
    if photograph:
        return settings - PHOTOGRAPH_CONTACT_METRES
    return settings - CONTACT_METRES - ALLOWED_DEVIATIONS * max(lengths.own.values()) * FOREARM_METRES


def solver_limits(figure: Figure, certifier: Certifier) -> Limits | None:
    """Return the joint ranges that pull at the solver's postures; None if no check asks for them."""
    table = load_ranges(certifier.settings.ranges)
    if "joint-range" not in [check.name for check in certifier.checks] or (
        table is not None and table["kind"] not in ("anatomical", "configuration")
    ):
        return None
    pelvis, right, left = (figure.neutral_points[JOINT[name]] for name in HIPS)
    if table is not None and table["kind"] == "configuration":
        joints = {name: one for name, one in table.items() if isinstance(one, dict)}
        angles = {f"{joint}.{angle}": ends for joint, one in joints.items() for angle, ends in one.items()}
        table = {"kind": "configuration", "joints": angles}
    return Limits.of(
        table,
        np.degrees(np.stack([figure.limits.lower, figure.limits.upper], axis=1)),
        above_hips=float(np.linalg.norm(perpendicular(right - pelvis, unit(left - right)))),
        pelvis_between_hips=figure.pelvis_between_hips,
    )


def group_of(joints: Array, within: float) -> NDArray[np.intp]:
    """Group postures (N, 14, 3), the likeliest first: each joins the first leader no joint of which is farther away."""
    group, leaders = np.empty(len(joints), dtype=np.intp), np.empty(0, dtype=np.intp)
    for k, one in enumerate(joints):
        apart = np.fmax.reduce(np.linalg.norm(joints[leaders] - one, axis=2), axis=1, initial=0.0)
        near = np.flatnonzero(apart <= within)
        if not len(near):
            leaders = np.append(leaders, k)
        group[k] = near[0] if len(near) else len(leaders) - 1
    return group
