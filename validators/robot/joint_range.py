"""Limits of every joint, by name: degrees for those that turn, metres for those that slide."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from posekit.geometry import Array
from posekit.validators.robot.subject import CENTIMETRES_A_DEGREE, Subject
from posekit.validators.suite import Judgement

Bools = NDArray[np.bool_]

ROWS_AT_ONCE: Final = 1024
"""Configurations that are compared at once: they and the comparisons stay in the processor's cache."""


def outside_limits(subject: Subject, q: Array, *, tolerance: float) -> Bools:
    """Tell which configurations (N, nq) `judge_joint_range` calls violated, without their margins.

    A number between its bounds has no negative margin in any unit, because multiplying by a positive number keeps
    the order; only configurations with a number outside are asked again, by the formula of the margins themselves.
    """
    lower, upper = (np.full(q.shape[1], bound) for bound in (-np.inf, np.inf))
    lower[subject.index], upper[subject.index] = subject.lower[subject.index], subject.upper[subject.index]
    outside = np.zeros(len(q), dtype=np.bool_)
    for start in range(0, len(q), ROWS_AT_ONCE):
        part = q[start : start + ROWS_AT_ONCE]
        some = np.flatnonzero(((part < lower) | (part > upper)).any(axis=1))
        if len(some):
            judged = judge_joint_range(subject, part[some], tolerance=tolerance)
            outside[start + some] = judged.violated.any(axis=1)
    return outside


def beyond_limits(subject: Subject, q: Array) -> Array:
    """Return how far each limited joint is outside its limits (N, K), degrees and metres; 0 inside."""
    values = q[:, subject.index]
    outside = np.maximum(subject.lower[subject.index] - values, values - subject.upper[subject.index])
    return np.asarray(np.maximum(outside, 0.0) * subject.to_unit)


def judge_joint_range(
    subject: Subject,
    q: Array,
    *,
    tolerance: float,
    seen: Bools | None = None,
    undecided: Bools | None = None,
    slack: Array | None = None,
) -> Judgement:
    """Judge configurations by the limits of their joints.

    Parameters
    ----------
    subject : Subject
        Of K joints with limits.
    q : array (N, nq)
        Configurations in Pinocchio's order, quaternions x, y, z, w.
    tolerance : float
        Degrees outside a limit that are no violation; a hundredth as many metres for joints that slide.
    seen : bool array (N, K), optional
        Which joints the posture determines; the others are undecided.
    undecided : bool array (N,), optional
        Postures about which nothing is said.
    slack : array (N,), optional
        Degrees beyond the tolerance that a solver's answer must be outside to be a violation: nearer than that
        the posture is undecided.
    """
    index, scale = subject.index, subject.to_unit
    lower, upper = subject.lower[index] * scale, subject.upper[index] * scale
    value = q[:, index]
    value *= scale
    margin = value - lower
    np.minimum(margin, upper - value, out=margin)
    each = np.where(subject.slides, CENTIMETRES_A_DEGREE, 1.0)
    violated = margin < -tolerance * each
    if seen is not None:
        value = np.where(seen, value, np.nan)
        margin = np.where(seen, margin, np.nan)
        violated &= seen
    if slack is not None:
        clear = violated & (margin < -(tolerance + slack)[:, None] * each)
        margin[violated.any(axis=1) & ~clear.any(axis=1)] = np.nan
        violated = clear
    if undecided is not None:
        margin[undecided], violated[undecided] = np.nan, False
    return Judgement(
        check="joint_range",
        where=subject.joint_names,
        unit=subject.units,
        value=value,
        lower=np.broadcast_to(lower, value.shape),
        upper=np.broadcast_to(upper, value.shape),
        margin=margin,
        violated=violated,
    )
