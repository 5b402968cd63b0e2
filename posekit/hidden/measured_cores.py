"""Completing survivors of measured points: trunks and limbs that are the same, as near as was measured, once."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import fields, replace
from typing import Final

import numpy as np

from posekit.geometry import Array
from posekit.hidden.completion import CompletedSurvivors, CompletionOutcome
from posekit.hidden.occlusion_pattern import LIMB_CHAINS, JointState, OcclusionPattern
from posekit.hidden.posture_rows import Index, PostureRows, judge_rows
from posekit.hidden.sampling import OcclusionSampling
from posekit.skeleton import PARENTS

FEW_SAMPLES: Final = OcclusionSampling(measured_sphere=120, trunk_sphere=500, hip_depths=60, trunks=12)
"""Enough to find a posture whose limbs do not meet, of which the set is known."""


def complete_by_core(
    pattern: OcclusionPattern,
    points: Array,
    frame: Index,
    rows: Index,
    done: CompletedSurvivors,
    describe: Callable[[OcclusionPattern, Index, OcclusionSampling | None], None],
    *,
    within: float,
) -> None:
    """Complete survivors with one pattern: one of each core, then the others as that one.

    A set is what the checks leave that read nothing of the limbs that are known. A completed posture passes them all:
    where that of the core does not, because another limb is in the way, the survivor is completed by itself.

    Parameters
    ----------
    pattern : OcclusionPattern
        Which joints are seen and hidden, and all checks.
    points : array (N, P, 3)
        Of all survivors, metres.
    frame : int array (N,)
        Their frames.
    rows : int array
        The survivors that have the pattern.
    done : CompletedSurvivors
        What is written to.
    describe : callable
        Completes some survivors as a pattern says, if not told otherwise with the sampling that was asked for.
    within : float
        Metres between joints that count as one.
    """
    leader = _leaders(frame[rows], points[rows][:, list(pattern.core)], within)
    first = np.flatnonzero(leader == np.arange(len(rows)))
    known = {joint for limb in LIMB_CHAINS if limb not in pattern.limbs for joint in limb.free}
    own = replace(pattern, checks=[check for check in pattern.checks if not known & set(check.points)])
    describe(own, rows[first], None)
    others = np.flatnonzero(leader != np.arange(len(rows)))
    _copy(pattern, points, done, rows[leader[others]], rows[others])
    completed = rows[done.outcome[rows] == CompletionOutcome.COMPLETED]
    whole = points[completed].copy()
    whole[:, list(pattern.unknown)] = done.postures[completed][:, list(pattern.unknown)]
    passed, _ = judge_rows(pattern.relevant_checks, PostureRows.of(whole))
    left = completed[~passed]
    for sampling in (FEW_SAMPLES, None):
        if len(left):
            joints = np.ix_(left, pattern.unknown)
            lower, upper = done.lower[joints], done.upper[joints]
            describe(pattern, left, sampling)
            done.lower[joints] = np.fmin(lower, done.lower[joints])
            done.upper[joints] = np.fmax(upper, done.upper[joints])
            middle = done.postures[joints]
            done.radius[joints] = np.linalg.norm(
                np.maximum(middle - done.lower[joints], done.upper[joints] - middle), axis=-1
            )
            left = left[done.outcome[left] != CompletionOutcome.COMPLETED]


def _copy(
    pattern: OcclusionPattern, points: Array, done: CompletedSurvivors, source: Index, target: Index
) -> None:
    """Complete survivors as others, each hidden joint moved with what it hangs on."""
    if not len(target):
        return
    for name in (field.name for field in fields(done)):
        values = getattr(done, name)
        if values.ndim == 1:
            values[target] = values[source]
        else:
            for joint in pattern.unknown:
                values[target, joint] = values[source, joint]
    for joint in pattern.unknown:
        above = PARENTS[joint]
        while pattern.states[above] != JointState.EXACT:
            above = PARENTS[above]
        shift = points[target, above] - points[source, above]
        for places in (done.postures, done.lower, done.upper):
            places[target, joint] += shift


def _leaders(frame: Index, core: Array, within: float) -> Index:
    """Return of each survivor (N,) the first of its frame whose core (N, J, 3) is the same."""
    n = len(frame)
    leader = np.full(n, -1)
    for row in range(n):
        if leader[row] >= 0:
            continue
        near = np.flatnonzero((frame == frame[row]) & (leader < 0))
        apart = np.abs(core[near] - core[row]).max(axis=(1, 2), initial=0.0)
        leader[near[apart <= within]] = row
    return leader
