"""What is reported of survivors: their completions, the sets of their joints, and what is proven impossible."""

from __future__ import annotations

import numpy as np

from posekit.geometry import Array
from posekit.hidden.completion import CompletedSurvivors, CompletionOutcome, PositionKind
from posekit.hidden.grouped_rows import box, distinct, largest
from posekit.hidden.occlusion_pattern import HIP_JOINTS, TORSO_JOINTS, TRUNK_JOINTS, JointState
from posekit.hidden.pattern_batch import LimbSets, PatternBatch
from posekit.hidden.posture_rows import Index, Mask
from posekit.hidden.representatives import representatives
from posekit.hidden.set_extremes import N_WALK_GOALS, reaches, seek_extremes
from posekit.skeleton import PARENTS, segment_name

SAME_END_METRES = 1e-6
"""Metres between two ends that count as one."""

BOX_END_STEPS, BOX_END_STEPS_FOUR_ANGLES, BOX_END_STEPS_MANY_TRUNKS = 0.125, 0.02, 0.1
"""Of a step on the lattice: how near the ends of a box are found, with two angles free, with four, and on many trunks.

Measured against rejection sampling: see the documentation.
"""

PLACED_WITHIN_METRES = 0.01
"""Metres by which a joint that was measured is off, where nothing else is said."""

TRUNK_LOOSENESS = 2.0
"""By how much more than a limb's joints are those of a measured trunk off: spines and clavicles are no bones."""

SEEN_LOOSENESS = 3.0
"""The same of joints that were seen, beyond hidden ones: where a ray is nearly tangent, depth is off by more."""


def describe_sets(batch: PatternBatch, done: CompletedSurvivors, part: Index) -> None:
    """Complete the survivors and write them into rows `part` of a completion."""
    postures, found = representatives(batch)
    done.outcome[part] = np.where(found, CompletionOutcome.COMPLETED, CompletionOutcome.UNDECIDED)
    _blame(batch, done, part, found)
    for joint in batch.pattern.unknown:
        done.kind[part, joint] = batch.kind(joint)
        done.postures[part, joint] = np.where(found[:, None], postures[:, joint], np.nan)
    middle = np.where(found[:, None, None], postures, np.nan)
    for joint in batch.pattern.trunk_joints:
        _describe_trunk(batch, done, part, joint, middle[:, joint])
    for limb_set in batch.allowed_sets:
        ends = _ends(batch, limb_set, middle)
        for joint in batch.pattern.free(limb_set.limb):
            _describe_limb(batch, done, part, limb_set, joint, ends[int(joint == limb_set.limb.end)])
    if batch.measured:
        _widen(batch, done, part)
    lone = (done.kind[part] == PositionKind.DEPTH_INTERVAL) & (done.lower[part] == done.upper[part]).all(
        axis=-1
    )
    done.kind[part] = np.where(lone, PositionKind.POINT, done.kind[part])
    done.fraction[part] = np.where(lone, 1.0, done.fraction[part])


def _widen(batch: PatternBatch, done: CompletedSurvivors, part: Index) -> None:
    """Widen what samples reach by half their distance, and by what measured points may be off; to the reach at most."""
    for joint in batch.pattern.unknown:
        parent, reach = PARENTS[joint], batch.length(joint) + batch.tolerance
        seen = batch.pattern.states[joint] == JointState.SEEN
        loose = SEEN_LOOSENESS if seen else TRUNK_LOOSENESS if joint in TRUNK_JOINTS else 1.0
        margin = done.accuracy[part, joint] + loose * min(batch.tolerance, PLACED_WITHIN_METRES)
        lower, upper = done.lower[part, joint] - margin[:, None], done.upper[part, joint] + margin[:, None]
        done.lower[part, joint] = np.maximum(lower, done.lower[part, parent] - reach)
        done.upper[part, joint] = np.minimum(upper, done.upper[part, parent] + reach)
        middle = done.postures[part, joint]
        corner = np.maximum(middle - done.lower[part, joint], done.upper[part, joint] - middle)
        done.radius[part, joint] = np.fmin(done.radius[part, joint] + margin, np.linalg.norm(corner, axis=1))
        done.accuracy[part, joint] = 0.0


def _blame(batch: PatternBatch, done: CompletedSurvivors, part: Index, found: Mask) -> None:
    """Name the joint without a position, and tell where that is proven."""
    without = ~batch.allowed.any(axis=1)
    certain = batch.trunks.sure[batch.core] & (not batch.measured)
    sure = without & certain
    blamed = np.where(
        without, batch.pattern.trunk_joints[0] if batch.pattern.trunk_joints else batch.pattern.unknown[0], -1
    )
    for limb_set in batch.limb_sets:
        first = batch.pattern.free(limb_set.limb)[0]
        none = np.bincount(limb_set.survivor, minlength=len(batch)) == 0
        if not batch.pattern.hidden(limb_set.limb):
            proven = none & certain
        else:
            reached = np.bincount(
                batch.trunks.core[limb_set.placer.too_short() <= 0.0], minlength=len(batch.core_frame)
            )
            proven = none & certain & (reached[batch.core] == 0)
        sure |= proven
        blamed = np.where(none & (blamed < 0), first, blamed)
    blamed = np.where(blamed < 0, batch.pattern.unknown[0], blamed)
    miss = batch.trunks.miss[batch.core]
    done.miss[part] = np.where(without, np.where(miss > 0.0, miss, np.nan), 0.0)
    done.blamed[part] = np.where(found, -1, blamed)
    done.outcome[part[sure & ~found]] = CompletionOutcome.IMPOSSIBLE


def _describe_trunk(
    batch: PatternBatch, done: CompletedSurvivors, part: Index, joint: int, middle: Array
) -> None:
    """Describe where a joint of the trunk can be."""
    who, trunk = np.nonzero(batch.allowed)
    position = batch.trunks.points[trunk, joint]
    done.lower[part, joint], done.upper[part, joint] = box(who, len(batch), position)
    apart = np.linalg.norm(position - middle[who], axis=1)
    _, radius = largest(who, len(batch), apart)
    done.radius[part, joint] = np.where(np.isfinite(radius), radius, np.nan)
    count = np.bincount(who, minlength=len(batch))
    even = np.bincount(who[batch.trunks.even[trunk]], minlength=len(batch))
    tried = np.maximum(batch.trunks.tried[batch.core], 1)
    pivot = TORSO_JOINTS[0] if joint in TORSO_JOINTS else HIP_JOINTS[0]
    length = batch.figure.lengths[segment_name((pivot, joint))]
    spacing = batch.trunks.spacing[batch.core]
    reach = done.upper[part, joint] - done.lower[part, joint]
    fraction = (
        np.linalg.norm(reach, axis=1) / _depths(batch, joint, length)
        if batch.pattern.states[joint] == JointState.SEEN
        else even / tried
    )
    lone = np.asarray((spacing == 0.0) | (batch.kind(joint) == PositionKind.POINT))
    done.samples[part, joint] = count
    done.fraction[part, joint] = np.where(lone, 1.0, np.minimum(fraction, 1.0))
    done.spacing[part, joint] = np.where(lone, 0.0, spacing)
    unsettled = spacing / 2.0 if batch.measured else _unsettled(batch)
    done.accuracy[part, joint] = np.where(lone, 0.0, unsettled * length)


def _ends(batch: PatternBatch, limb_set: LimbSets, middle: Array) -> Array:
    """Return the ends of the boxes and the radii (2, N, 7) of a limb's joints; NaN where a set is empty."""
    representatives = np.stack([middle[:, joint] for joint in limb_set.limb.free])
    table = reaches(limb_set.placer, limb_set.rows, limb_set.survivor, representatives)
    reach = np.full((2, len(batch), N_WALK_GOALS), -np.inf)
    for joint, goal in np.ndindex(2, N_WALK_GOALS):
        reach[joint, :, goal] = largest(
            limb_set.survivor, len(batch), np.nan_to_num(table[joint, goal], nan=-np.inf)
        )[1]
    if batch.pattern.hidden(limb_set.limb) and not batch.measured:
        # Where an end of the core's set is not among them, a known limb or the trunk cut it off: it is sought anew.
        wanted = reach < limb_set.reach[:, batch.core] - SAME_END_METRES
        wanted[:, :, -1] = True
        wanted &= np.array([joint in batch.pattern.free(limb_set.limb) for joint in limb_set.limb.free])[
            :, None, None
        ]
        ends = seek_extremes(
            limb_set.placer,
            limb_set.survivor,
            limb_set.rows,
            representatives,
            lambda survivor, rows: batch.passes(limb_set.placer, survivor, rows),
            wanted,
        )
        reach = np.maximum(reach, ends.reach)
    return np.where(np.isfinite(reach), reach, np.nan)


def _describe_limb(
    batch: PatternBatch, done: CompletedSurvivors, part: Index, limb_set: LimbSets, joint: int, ends: Array
) -> None:
    """Describe where a joint of a limb can be."""
    n, placer, rows, who = len(batch), limb_set.placer, limb_set.rows, limb_set.survivor
    done.lower[part, joint], done.upper[part, joint] = -ends[:, :3], ends[:, 3:6]
    done.radius[part, joint] = ends[:, 6]
    lattice = placer.spacing()[rows.trunk]
    done.samples[part, joint] = np.bincount(who, minlength=n)
    done.fraction[part, joint] = _fraction(batch, done, part, limb_set, joint)
    # A box misses its extremes by a share of the limb's own spacing; where the trunk turns, the whole limb goes along.
    of_trunk = batch.trunks.spacing[batch.core]
    spacing = np.zeros(n)
    spacing[who] = lattice
    done.spacing[part, joint] = spacing + of_trunk
    lever = _reach_of(batch, limb_set, joint)
    if batch.measured:
        # Half a step of its own, and half a step of what it hangs on.
        own = lever if limb_set.placer.both_hidden else batch.length(joint)
        done.accuracy[part, joint] = spacing / 2.0 * own + of_trunk / 2.0 * batch.length(limb_set.limb.base)
        return
    crowd = np.bincount(batch.trunks.core, minlength=len(batch.core_frame))[batch.core] > 1
    attained = np.where(
        crowd,
        BOX_END_STEPS_MANY_TRUNKS,
        BOX_END_STEPS_FOUR_ANGLES if limb_set.placer.both_hidden else BOX_END_STEPS,
    )
    done.accuracy[part, joint] = spacing * attained * lever + _unsettled(batch) * (
        lever + batch.length(limb_set.limb.base)
    )


def _unsettled(batch: PatternBatch) -> Array:
    """Return how far the trunk may turn on beyond what was found (N,), radians: rotations have corners."""
    turn = batch.trunks.turn
    return batch.trunks.spacing[batch.core] * (2.0 if turn is None or turn.about is None else 1.0)


def _fraction(
    batch: PatternBatch, done: CompletedSurvivors, part: Index, limb_set: LimbSets, joint: int
) -> Array:
    """Return which part (N,) of a joint's circle, sphere or interval of depth is feasible."""
    n, who, rows = len(batch), limb_set.survivor, limb_set.rows
    if batch.pattern.states[joint] == JointState.SEEN:
        length = np.linalg.norm(done.upper[part, joint] - done.lower[part, joint], axis=1)
        reach = _reach_of(batch, limb_set, joint)
        base = limb_set.limb.base
        return np.asarray(np.minimum(length / _depths(batch, joint, reach, base), 1.0))
    n_middle, n_end = limb_set.placer.per_trunk()
    trunks = np.maximum((batch.allowed & batch.even).sum(axis=1), 1)
    even = (rows.seed >= 0) & batch.even[rows.trunk]
    label = np.where(even, rows.trunk * (n_middle * max(n_end, 1) * 2) + rows.seed, -1)
    if joint == limb_set.limb.middle or batch.pattern.states[limb_set.limb.middle] != JointState.HIDDEN:
        tried = n_middle if joint == limb_set.limb.middle else n_end
        lattices = 1 if batch.pattern.states[limb_set.limb.middle] != JointState.SEEN else 2
        part_of = np.zeros(n)
        part_of[who] = limb_set.placer.part()[rows.trunk]
        return np.asarray(distinct(who, n, label) / (tried * trunks * lattices) * part_of)
    return np.asarray(np.bincount(who[even], minlength=n) / (n_middle * n_end * trunks))


def _reach_of(batch: PatternBatch, limb_set: LimbSets, joint: int) -> float:
    """Return how far a joint of a limb can be from the limb's base, metres: the sum of the lengths between."""
    limb = limb_set.limb
    return batch.length(limb.middle) + (batch.length(limb.end) if joint == limb.end else 0.0)


def _depths(batch: PatternBatch, joint: int, reach: float, base: int | None = None) -> Array:
    """Return how long the part of a seen joint's ray is (N,) that lengths alone allow, metres."""
    base = PARENTS[joint] if base is None else base
    frame = batch.core_frame[batch.trunks.core]
    foot, height = batch.rays.foot(joint, frame, batch.trunks.points[:, base])
    half = np.sqrt(np.maximum(reach**2 - height**2, 0.0))
    along = np.einsum("hi,hi->h", foot - batch.rays.origin[frame, joint], batch.rays.direction[frame, joint])
    cores = len(batch.core_frame)
    low, high = np.full(cores, np.inf), np.full(cores, -np.inf)
    np.minimum.at(low, batch.trunks.core, along - half)
    np.maximum.at(high, batch.trunks.core, along + half)
    length = (high - low)[batch.core]
    return np.asarray(np.where(length > 0.0, length, 1.0))
