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
from posekit.skeleton import PARENTS

SAME_CORE_METRES: Final = 0.01
"""Metres between joints that count as one where points were measured: less than those are known by."""


def complete_by_core(
    pattern: OcclusionPattern,
    points: Array,
    frame: Index,
    rows: Index,
    done: CompletedSurvivors,
    describe: Callable[[OcclusionPattern, Index], None],
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
        Completes some survivors as a pattern says.
    """
    leader = _leaders(frame[rows], points[rows][:, list(pattern.core)])
    first = np.flatnonzero(leader == np.arange(len(rows)))
    known = {joint for limb in LIMB_CHAINS if limb not in pattern.limbs for joint in limb.free}
    own = replace(pattern, checks=[check for check in pattern.checks if not known & set(check.points)])
    describe(own, rows[first])
    others = np.flatnonzero(leader != np.arange(len(rows)))
    _copy(pattern, points, done, rows[leader[others]], rows[others])
    completed = rows[done.outcome[rows] == CompletionOutcome.COMPLETED]
    whole = points[completed].copy()
    whole[:, list(pattern.unknown)] = done.postures[completed][:, list(pattern.unknown)]
    passed, _ = judge_rows(pattern.relevant_checks, PostureRows.of(whole))
    if not passed.all():
        describe(pattern, completed[~passed])


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


def _leaders(frame: Index, core: Array) -> Index:
    """Return of each survivor (N,) the first of its frame whose core (N, J, 3) is the same."""
    n = len(frame)
    leader = np.full(n, -1)
    for row in range(n):
        if leader[row] >= 0:
            continue
        near = np.flatnonzero((frame == frame[row]) & (leader < 0))
        apart = np.abs(core[near] - core[row]).max(axis=(1, 2), initial=0.0)
        leader[near[apart <= SAME_CORE_METRES]] = row
    return leader
