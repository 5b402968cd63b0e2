"""What is written of survivors: their completions, the sets of their joints, and what is proven impossible."""

from __future__ import annotations

import numpy as np

from posekit.geometry import Array
from posekit.hidden.asking import Index, Mask
from posekit.hidden.choosing import representatives
from posekit.hidden.completion import CompletedSurvivors, CompletionOutcome, PositionKind
from posekit.hidden.groups import box, distinct, largest
from posekit.hidden.party import Party, Way
from posekit.hidden.plan import HIP_JOINTS, TORSO_JOINTS, JointState
from posekit.hidden.refine import N_WALK_GOALS, reaches, seek_ends
from posekit.skeleton import PARENTS, segment_name

SAME_END_METRES = 1e-6
"""Metres between two ends that count as one."""

BOX_END_STEPS, ATTAINED_IN_FOUR, ATTAINED_IN_CROWD = 0.125, 0.02, 0.1
"""Of a step on the lattice: how near the ends of a box are found, with two angles free, with four, and on many hosts.

Measured against rejection sampling: see the documentation.
"""


def write(party: Party, done: CompletedSurvivors, part: Index) -> None:
    """Complete the survivors and write them into rows `part` of a completion."""
    postures, found = representatives(party)
    done.outcome[part] = np.where(found, CompletionOutcome.COMPLETED, CompletionOutcome.UNDECIDED)
    _blame(party, done, part, found)
    for joint in party.plan.unknown:
        done.kind[part, joint] = party.kind(joint)
        done.postures[part, joint] = np.where(found[:, None], postures[:, joint], np.nan)
    middle = np.where(found[:, None, None], postures, np.nan)
    for joint in party.plan.trunk:
        _describe_trunk(party, done, part, joint, middle[:, joint])
    for way in party.sets:
        ends = _ends(party, way, middle)
        for joint in party.plan.free(way.limb):
            _describe_limb(party, done, part, way, joint, ends[int(joint == way.limb.end)])
    lone = (done.kind[part] == PositionKind.DEPTH_INTERVAL) & (done.lower[part] == done.upper[part]).all(
        axis=-1
    )
    done.kind[part] = np.where(lone, PositionKind.POINT, done.kind[part])
    done.fraction[part] = np.where(lone, 1.0, done.fraction[part])


def _blame(party: Party, done: CompletedSurvivors, part: Index, found: Mask) -> None:
    """Name the joint without a position, and tell where that is proven."""
    without = ~party.allowed.any(axis=1)
    sure = without & party.hosts.sure[party.core]
    blamed = np.where(without, party.plan.trunk[0] if party.plan.trunk else party.plan.unknown[0], -1)
    for way in party.ways:
        first = party.plan.free(way.limb)[0]
        none = np.bincount(way.survivor, minlength=len(party)) == 0
        if not party.plan.hidden(way.limb):
            proven = none & party.hosts.sure[party.core]
        else:
            reached = np.bincount(
                party.hosts.core[way.placer.too_short() <= 0.0], minlength=len(party.core_frame)
            )
            proven = none & party.hosts.sure[party.core] & (reached[party.core] == 0)
        sure |= proven
        blamed = np.where(none & (blamed < 0), first, blamed)
    blamed = np.where(blamed < 0, party.plan.unknown[0], blamed)
    miss = party.hosts.miss[party.core]
    done.miss[part] = np.where(without, np.where(miss > 0.0, miss, np.nan), 0.0)
    done.blamed[part] = np.where(found, -1, blamed)
    done.outcome[part[sure & ~found]] = CompletionOutcome.IMPOSSIBLE


def _describe_trunk(party: Party, done: CompletedSurvivors, part: Index, joint: int, middle: Array) -> None:
    """Describe where a joint of the trunk can be."""
    who, host = np.nonzero(party.allowed)
    position = party.hosts.points[host, joint]
    done.lower[part, joint], done.upper[part, joint] = box(who, len(party), position)
    apart = np.linalg.norm(position - middle[who], axis=1)
    _, radius = largest(who, len(party), apart)
    done.radius[part, joint] = np.where(np.isfinite(radius), radius, np.nan)
    count = np.bincount(who, minlength=len(party))
    even = np.bincount(who[party.hosts.even[host]], minlength=len(party))
    tried = np.maximum(party.hosts.tried[party.core], 1)
    pivot = TORSO_JOINTS[0] if joint in TORSO_JOINTS else HIP_JOINTS[0]
    length = party.figure.lengths[segment_name((pivot, joint))]
    spacing = party.hosts.spacing[party.core]
    reach = done.upper[part, joint] - done.lower[part, joint]
    fraction = (
        np.linalg.norm(reach, axis=1) / _depths(party, joint, length)
        if party.plan.states[joint] == JointState.SEEN
        else even / tried
    )
    lone = np.asarray((spacing == 0.0) | (party.kind(joint) == PositionKind.POINT))
    done.samples[part, joint] = count
    done.fraction[part, joint] = np.where(lone, 1.0, np.minimum(fraction, 1.0))
    done.spacing[part, joint] = np.where(lone, 0.0, spacing)
    done.accuracy[part, joint] = np.where(lone, 0.0, _unsettled(party) * length)


def _ends(party: Party, way: Way, middle: Array) -> Array:
    """Return the ends of the boxes and the radii (2, N, 7) of a limb's joints; NaN where a set is empty."""
    representatives = np.stack([middle[:, joint] for joint in way.limb.free])
    table = reaches(way.placer, way.rows, way.survivor, representatives)
    reach = np.full((2, len(party), N_WALK_GOALS), -np.inf)
    for joint, goal in np.ndindex(2, N_WALK_GOALS):
        reach[joint, :, goal] = largest(
            way.survivor, len(party), np.nan_to_num(table[joint, goal], nan=-np.inf)
        )[1]
    if party.plan.hidden(way.limb):
        # Where an end of the core's set is not among them, a known limb or the trunk cut it off: it is sought anew.
        wanted = reach < way.reach[:, party.core] - SAME_END_METRES
        wanted[:, :, -1] = True
        wanted &= np.array([joint in party.plan.free(way.limb) for joint in way.limb.free])[:, None, None]
        ends = seek_ends(
            way.placer,
            way.survivor,
            way.rows,
            representatives,
            lambda survivor, rows: party.passes(way.placer, survivor, rows),
            wanted,
        )
        reach = np.maximum(reach, ends.reach)
    return np.where(np.isfinite(reach), reach, np.nan)


def _describe_limb(
    party: Party, done: CompletedSurvivors, part: Index, way: Way, joint: int, ends: Array
) -> None:
    """Describe where a joint of a limb can be."""
    n, placer, rows, who = len(party), way.placer, way.rows, way.survivor
    done.lower[part, joint], done.upper[part, joint] = -ends[:, :3], ends[:, 3:6]
    done.radius[part, joint] = ends[:, 6]
    lattice = placer.spacing()[rows.host]
    done.samples[part, joint] = np.bincount(who, minlength=n)
    done.fraction[part, joint] = _fraction(party, done, part, way, joint)
    trunk = party.hosts.spacing[party.core]
    spacing = np.zeros(n)
    spacing[who] = lattice
    done.spacing[part, joint] = spacing + trunk
    lever = party.length(way.limb.middle) + (party.length(way.limb.end) if joint == way.limb.end else 0.0)
    crowd = np.bincount(party.hosts.core, minlength=len(party.core_frame))[party.core] > 1
    attained = np.where(
        crowd, ATTAINED_IN_CROWD, ATTAINED_IN_FOUR if way.placer.both_hidden else BOX_END_STEPS
    )
    done.accuracy[part, joint] = spacing * attained * lever + _unsettled(party) * (
        lever + party.length(way.limb.base)
    )


def _unsettled(party: Party) -> Array:
    """Return how far the trunk may turn on beyond what was found (N,), radians: rotations have corners."""
    turn = party.hosts.turn
    return party.hosts.spacing[party.core] * (2.0 if turn is None or turn.about is None else 1.0)


def _fraction(party: Party, done: CompletedSurvivors, part: Index, way: Way, joint: int) -> Array:
    n, who, rows = len(party), way.survivor, way.rows
    if party.plan.states[joint] == JointState.SEEN:
        length = np.linalg.norm(done.upper[part, joint] - done.lower[part, joint], axis=1)
        reach = party.length(way.limb.middle) + (party.length(way.limb.end) if joint == way.limb.end else 0.0)
        base = way.limb.base
        return np.asarray(np.minimum(length / _depths(party, joint, reach, base), 1.0))
    n_middle, n_end = way.placer.per_host()
    hosts = np.maximum((party.allowed & party.even).sum(axis=1), 1)
    even = (rows.seed >= 0) & party.even[rows.host]
    label = np.where(even, rows.host * (n_middle * max(n_end, 1) * 2) + rows.seed, -1)
    if joint == way.limb.middle or party.plan.states[way.limb.middle] != JointState.HIDDEN:
        tried = n_middle if joint == way.limb.middle else n_end
        lattices = 1 if party.plan.states[way.limb.middle] != JointState.SEEN else 2
        part_of = np.zeros(n)
        part_of[who] = way.placer.part()[rows.host]
        return np.asarray(distinct(who, n, label) / (tried * hosts * lattices) * part_of)
    return np.asarray(np.bincount(who[even], minlength=n) / (n_middle * n_end * hosts))


def _depths(party: Party, joint: int, reach: float, base: int | None = None) -> Array:
    """Return how long the part of a seen joint's ray is (N,) that lengths alone allow, metres."""
    base = PARENTS[joint] if base is None else base
    frame = party.core_frame[party.hosts.core]
    foot, height = party.rays.foot(joint, frame, party.hosts.points[:, base])
    half = np.sqrt(np.maximum(reach**2 - height**2, 0.0))
    along = np.einsum("hi,hi->h", foot - party.rays.origin[frame, joint], party.rays.direction[frame, joint])
    cores = len(party.core_frame)
    low, high = np.full(cores, np.inf), np.full(cores, -np.inf)
    np.minimum.at(low, party.hosts.core, along - half)
    np.maximum.at(high, party.hosts.core, along + half)
    length = (high - low)[party.core]
    return np.asarray(np.where(length > 0.0, length, 1.0))
