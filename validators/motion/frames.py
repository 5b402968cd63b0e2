"""Checks of frames as such: missing, repeated, shuffled, exchanged sides, jumps, trembling, drifting lengths.

A jump also exceeds bounds of speed, acceleration and jerk; so do exchanged labels and shuffled frames. So defects are
found in an order (`explained`), each named once: times, then repeated frames, then the order of the motion itself, then
right and left, then jumps. Each step sees what those before it left. The checks of motion see the rest: joints with
right and left corrected, in slots of even time, NaN where another check has named the frame.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from posekit.body.lengths import lengths_in_frames
from posekit.geometry import Array, dot, groups, known_median, norm, runs
from posekit.skeleton import JOINT, JOINTS, LIMB_SEGMENTS, segment_name
from posekit.validators.body import LIMB_ROWS, Body, once
from posekit.validators.check import Judgement, NotAskedError, check
from posekit.validators.motion.jumps import LEAST_JUMP, jumps_of
from posekit.validators.motion.sides import (
    LEFT_JOINTS,
    RIGHT_JOINTS,
    SIDE_PAIRS,
    exchanged_pairs,
    put_right,
)
from posekit.validators.motion.timeline import Timeline, median_of_five, timeline_of
from posekit.validators.motion.trembling import trembling_frames, trembling_of, usual_trembling

#: Part of a step by which a time stamp is early that belongs to the frame before: a quarter of one is its own slot.
TWICE_FRAMES: Final = 0.75

#: Copies of a frame in a row, at most, that are single duplicates: longer runs are a held posture (`frozen`).
LONGEST_REPEAT: Final = 4.0

#: Frames per second below which thrown limbs jump.
JUMPING_RATE: Final = 15.0

#: Frames per second below which fast motion is not smooth from frame to frame.
TREMBLING_RATE: Final = 25.0

#: Standard deviations of measuring noise that are allowed.
TELEPORT_DEVIATIONS, JITTER_DEVIATIONS, DRIFT_DEVIATIONS = 5.0, 2.0, 4.0

#: Percentage of the frames that are calm, and their trembling as a share of the median frame's, at most: noise of
#: measuring is in all frames alike (0.5 to 0.8), a local defect is not.
CALM_PERCENT, CALM_SHARE = 2.0, 0.3

#: Share of the frames with another length from which either may be the usual one.
LEAST_OTHER: Final = 0.2

#: Trembling of a joint from which lengths tremble too, metres: `jitter` names that.
SHAKEN_METRES: Final = 0.0025


#: Distance below which two positions are one, metres: one number written with 32 and with 64 bits.
SAME_METRES: Final = 1e-6

#: Step of the fastest joint in a frame from which a body moves, metres: coarse rounding alone makes no duplicate.
MOVED_METRES: Final = 1e-3

#: Frames before and after a run of duplicates in which the body must move.
MOVING_FRAMES: Final = 3


#: Joints that have no side.
MIDDLE_JOINTS: Final = (JOINT["neck"], JOINT["pelvis"])

#: Frames that are ordered at once; longer stretches are ordered in parts.
LONGEST_STRETCH: Final = 600

#: Length of the way through a stretch in the right order, at most, as a share of the way in the given order.
SHORTER_SHARE: Final = 0.6

#: Least number of frames out of place in a stretch.
LEAST_FRAMES: Final = 3

#: Least motion of a joint between frames that shows their order, metres.
LEAST_METRES: Final = 0.005

#: Least number of moving joints: one or two that turn back tremble.
LEAST_JOINTS: Final = 3

#: Frames per second from which motion shows the order: at fewer, people turn back between two frames.
ORDERED_RATE: Final = 20.0

#: Frames between two turns back of one stretch, at most.
TURNS_APART: Final = 6

#: Frames before and after a stretch that are ordered with it, so that its ends find their places.
AROUND_FRAMES: Final = 4


def needs_rate(body: Body, least: float) -> None:
    """Refuse a body with fewer than `least` frames per second."""
    if body.rate < least:
        raise NotAskedError(f"it needs {least:g} frames per second")


@check("timing", unit="frames", reads=("joints",), over_time=True)
def timing(body: Body, *, missing: float = 0.5, displaced: float = 0.5) -> Judgement:
    """Frames are missing, come twice, or are out of order.

    Parameters
    ----------
    missing : float
        Frames that may be missing before a frame; a part of one is time that stamps are off.
    displaced : float
        Frames by which one may be out of its place, by its time or, without times, by the motion.
    """
    found = explained(body)
    by_time = found.timeline.place
    place = np.where(by_time != 0, by_time, found.displaced).astype(np.float64)
    return Judgement(
        ("missing", "order"),
        np.column_stack([found.timeline.missing, place]),
        np.array([-TWICE_FRAMES, -displaced]),
        np.array([missing, displaced]),
    )


@check("frozen", unit="frames", reads=("joints",), over_time=True)
def frozen(body: Body, *, longest: float = LONGEST_REPEAT) -> Judgement:
    """Postures are held, to rounding, while the body moves before and after.

    Parameters
    ----------
    longest : float
        Copies of a frame in a row.
    """
    return Judgement(("body",), explained(body).repeats.astype(np.float64), upper=longest)


@check("repeated", unit="frames", reads=("joints",), over_time=True)
def repeated(body: Body, *, most: float = 0.0) -> Judgement:
    """Frames come again while the body moves.

    Parameters
    ----------
    most : float
        Copies of a frame in a row.
    """
    repeats = explained(body).repeats.astype(np.float64)
    short = np.where(repeats > LONGEST_REPEAT, 0.0, repeats)
    return Judgement(("body",), short, upper=most + 0.5, scale=0.5)


@check("swap", unit="1", reads=("joints",), over_time=True)
def swap(body: Body, *, most: float = 0.0) -> Judgement:
    """Right and left are exchanged.

    Parameters
    ----------
    most : float
        0 allows no exchange, 1 all; see `posekit.validators.motion.sides`.
    """
    if len(body) < 2 or body.q is not None:
        raise NotAskedError(
            "it needs two frames" if body.q is None else "the names of q tell right from left"
        )
    exchanged = explained(body).exchanged.astype(np.float64)
    return Judgement(SIDE_PAIRS, exchanged, upper=most + 0.5, scale=0.5)


@check("teleport", unit="m", reads=("joints",), over_time=True)
def teleport(clip: Body, /, *, joint: float = 0.07, body: float = 0.06) -> Judgement:
    """Joints, or the body, are not where the frames before and after predict them.

    Parameters
    ----------
    joint : float
        Jump of a single joint, metres; see `posekit.validators.motion.jumps`.
    body : float
        Jump of the body, for one frame or for good, metres.
    """
    needs_rate(clip, JUMPING_RATE)
    found = explained(clip)
    return Judgement(
        (*JOINTS, "body"),
        found.timeline.of_frames(found.jumps),
        upper=np.array([joint] * len(JOINTS) + [body]),
        tolerance=TELEPORT_DEVIATIONS * clip.noise,
    )


@check("jitter", unit="m", reads=("joints", "time"), over_time=True)
def jitter(body: Body, *, deviation: float = 0.006) -> Judgement:
    """Joints tremble from frame to frame by more than the noise of the clip explains.

    Parameters
    ----------
    deviation : float
        Standard deviation of a coordinate, metres.
    """
    needs_rate(body, TREMBLING_RATE)
    found, noise = explained(body), body.noise
    if body.settings.noise is None and noise > 0:
        calm, usual = usual_trembling(found.joints, (CALM_PERCENT, 50.0))
        noise = noise if calm > CALM_SHARE * usual else min(noise, calm)
    value, allowed = found.trembling, JITTER_DEVIATIONS * noise
    hot = np.nan_to_num(value) > deviation + allowed
    if hot.any():
        exact = trembling_frames(found.joints, hot)
        most = np.where(hot, value, 0.0).max(axis=0)
        value = np.where(exact, np.where(hot, value, most), np.minimum(value, deviation))
    return Judgement(JOINTS, found.timeline.of_frames(value), upper=deviation, tolerance=allowed)


@check("drift", unit="1", reads=("joints",), over_time=True)
def drift(body: Body, *, share: float = 0.025) -> Judgement:
    """Limb segments are longer or shorter than they mostly are in the clip.

    Parameters
    ----------
    share : float
        Difference as a share of its median length, either way.
    """
    found = explained(body)
    starts, ends = (list(one) for one in zip(*LIMB_SEGMENTS, strict=True))
    lengths = lengths_in_frames(found.joints)[LIMB_ROWS].T
    usual = _usual(lengths, share)
    shaken = np.maximum(found.trembling[:, starts], found.trembling[:, ends])
    shaken = np.where(shaken > SHAKEN_METRES, shaken, 0.0)
    # A length has the noise of its two ends, the median of five frames about half of it.
    allowed = DRIFT_DEVIATIONS * np.fmax(shaken, body.noise) / usual
    return Judgement(
        tuple(map(segment_name, LIMB_SEGMENTS)),
        found.timeline.of_frames(_smooth(lengths) / usual - 1.0),
        -share,
        share,
        found.timeline.of_frames(allowed),
    )


def _usual(lengths: Array, share: float) -> Array:
    """Return the usual length of each segment of `LIMB_SEGMENTS` (K,): the median, or that of the other lengths.

    Where many frames differ from the median, that length of the two is the usual one which the other side has.
    """
    usual = np.array([known_median(column) or np.nan for column in lengths.T])
    for k, column in enumerate(lengths.T):
        twin = usual[k + 2 if k % 4 < 2 else k - 2]
        others = column[np.abs(column / usual[k] - 1.0) > share]
        if len(others) > LEAST_OTHER * np.isfinite(column).sum():
            usual[k] = min((usual[k], float(np.median(others))), key=lambda length: abs(length - twin))
    return usual


def _smooth(lengths: Array) -> Array:
    """Return medians over five slots (S, K): an unknown length is the last known one beside others."""
    known = np.isfinite(lengths)
    last = np.maximum.accumulate(np.where(known, np.arange(len(lengths))[:, None], 0), axis=0)
    return np.where(known, median_of_five(np.take_along_axis(lengths, last, axis=0)), np.nan)


@dataclass(frozen=True, kw_only=True, eq=False)
class Explained:
    """What was found in T frames, and the motion that is left in S slots of even time.

    Parameters
    ----------
    timeline : Timeline
        Slot of each frame.
    repeats : int array (T,)
        Length of the run of duplicates that each frame is in; 0 for others.
    displaced : int array (T,)
        Frames by which each is out of its place, by the motion.
    exchanged : bool array (T, 6)
        Pairs whose right and left are exchanged.
    jumps : array (S, 15)
        Jumps of the joints and of the body, metres; see `posekit.validators.motion.jumps.jumps_of`.
    joints : array (S, 14, 3)
        The motion that is left.
    trembling : array (S, 14)
        Standard deviation of trembling, metres.
    """

    timeline: Timeline
    repeats: NDArray[np.intp]
    displaced: NDArray[np.intp]
    exchanged: NDArray[np.bool_]
    jumps: Array
    joints: Array
    trembling: Array


@once
def explained(body: Body) -> Explained:
    """Find the defects of a body's frames."""
    timeline = timeline_of(body)
    # Frames without a place in time come last, and are not judged.
    order = np.argsort(np.where(timeline.slots < 0, timeline.count, timeline.slots), kind="stable")
    back = np.argsort(order)
    joints = body.joints[order]
    repeats = duplicates(joints)
    known = repeats == 0
    places = np.zeros(len(joints), dtype=np.intp)
    if not body.rate < ORDERED_RATE:
        places[known] = displaced(joints[known])
    kept = known & ~stretches_of(places)
    joints = np.where(kept[:, None, None], joints, np.nan)
    exchanged = np.zeros((len(joints), 6), dtype=np.bool_)
    noise = max(body.noise, *usual_trembling(joints[kept]))
    follows = np.diff(timeline.slots[order][kept]) == 1
    # Joint ranges judge which way a knee of one posture bends; the sides of a robot follow from its names.
    if len(joints) > 1 and body.q is None:
        exchanged[kept] = exchanged_pairs(
            joints[kept], body.feet[order][kept], body.head[order][kept], follows, noise
        )
    for edge, beside in ((0, 1), (-1, -2)):
        # One frame at an end that is another posture faces elsewhere: that is a jump, no exchange of labels.
        if len(joints) > 2 and exchanged[edge].all() and not exchanged[beside].any():
            exchanged[edge] = False
    joints = timeline.spread(put_right(joints, exchanged)[back])
    jumps = jumps_of(joints, body.dt)
    jumped = (jumps[:, :-1] > LEAST_JUMP) | (jumps[:, -1:] > LEAST_JUMP)
    joints = np.where(jumped[..., None], np.nan, joints)
    return Explained(
        timeline=timeline,
        repeats=repeats[back],
        displaced=places[back],
        exchanged=exchanged[back],
        jumps=jumps,
        joints=joints,
        trembling=trembling_of(joints, body.noise),
    )


def duplicates(joints: Array) -> NDArray[np.intp]:
    """Return the length of the run of duplicates around each frame (T,); 0 if it does not copy the frame before.

    A run counts where the body moves by more than a millimetre a frame shortly before and shortly after it, at an end
    of the clip on one side. Otherwise rounding is enough to make two frames one.

    Parameters
    ----------
    joints : array (T, 14, 3)
        Metres, frame after frame; a joint that is unknown in both frames is the same.
    """
    count = len(joints)
    lengths = np.zeros(count, dtype=np.intp)
    if count < 2:
        return lengths
    steps = norm(np.diff(joints, axis=0))
    unknown = np.isnan(joints[..., 0])
    alike = (unknown[1:] == unknown[:-1]).all(axis=1) & ~unknown[1:].all(axis=1)
    fastest = np.nan_to_num(np.fmax.reduce(steps, axis=1))
    same = alike & (fastest < SAME_METRES)
    for first, last in runs(same):
        before, after = fastest[max(first - MOVING_FRAMES, 0) : first], fastest[last : last + MOVING_FRAMES]
        moving = [part.max() > MOVED_METRES for part in (before, after) if len(part)]
        if moving and all(moving):
            lengths[first + 1 : last + 1] = last - first
    return lengths


def displaced(joints: Array) -> NDArray[np.intp]:
    """Return the frames by which each frame is out of its place (T,); 0 where the motion is even.

    Parameters
    ----------
    joints : array (T, 14, 3)
        Metres, frame after frame.

    Notes
    -----
    Frames in a wrong order make most joints turn back from step to step. A stretch of such frames is put into the
    order that goes from its first neighbour to its last by a short way (each frame is inserted where it costs least:
    Rosenkrantz et al. 1977, SIAM J. Comput. 6:563); where that way is less than six tenths of the given one, the frames
    were out of order. Noise makes joints turn back, too, but no order of noisy frames is much shorter than another.
    """
    count = len(joints)
    places = np.zeros(count, dtype=np.intp)
    joints = _without_sides(joints)
    if count < LEAST_FRAMES + 2:
        return places
    steps = np.diff(joints, axis=0)
    moving = (norm(steps[1:]) > LEAST_METRES) & (norm(steps[:-1]) > LEAST_METRES)
    backward = (dot(steps[1:], steps[:-1]) < 0) & moving
    turning = np.zeros(count, dtype=np.bool_)
    turning[1:-1] = (2 * backward.sum(axis=1) > moving.sum(axis=1)) & (moving.sum(axis=1) >= LEAST_JOINTS)
    for first, last in _stretches(turning):
        rows = np.arange(max(first - AROUND_FRAMES, 0), min(last + AROUND_FRAMES + 1, count))
        rows = rows[np.isfinite(joints[rows]).all(axis=(1, 2))]
        if len(rows) >= LEAST_FRAMES + 2:
            order = _shortest(joints[rows].reshape(len(rows), -1))
            found = np.zeros(count, dtype=np.intp)
            found[rows[order]] = rows - rows[order]
            # Frames around it that go on evenly are in their places, though there may be a shorter way through them.
            near = slice(max(first - 2, 0), last + 3)
            places[near] = found[near]
    return places


def _without_sides(joints: Array) -> Array:
    """Return a posture without sides (T, 20, 3), metres, so that flickering labels are not treated as a wrong order.

    Neck, pelvis and the middles of pairs; and the vector d between a pair as its outer product with itself over its
    length, which is that of -d.
    """
    right, left = joints[:, RIGHT_JOINTS], joints[:, LEFT_JOINTS]
    across = (right - left) / 2.0
    lengths = np.maximum(norm(across), 1e-9)[..., None]
    squares, products = across**2 / lengths, across * np.roll(across, 1, axis=-1) / lengths
    return np.concatenate([joints[:, MIDDLE_JOINTS], (right + left) / 2.0, squares, products], axis=1)


def stretches_of(places: NDArray[np.intp]) -> NDArray[np.bool_]:
    """Return the frames (T,) of every stretch that holds frames out of place."""
    inside = np.zeros(len(places), dtype=np.bool_)
    for part in groups(np.flatnonzero(places), TURNS_APART):
        inside[part[0] : part[-1] + 1] = True
    return inside


def _stretches(turning: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """Return first and last of the stretches in which frames turn back, three of them or more."""
    found = []
    for part in groups(np.flatnonzero(turning), TURNS_APART):
        for first in range(int(part[0]), int(part[-1]) + 1, LONGEST_STRETCH):
            last = min(first + LONGEST_STRETCH - 1, int(part[-1]))
            if np.count_nonzero((part >= first) & (part <= last)) >= LEAST_FRAMES - 1:
                found.append((first, last))
    return found


def _shortest(points: Array) -> NDArray[np.intp]:
    """Return an order (N,) of points (N, K) with a short way from first to last; the given one where none is."""
    squares = (points**2).sum(axis=1)
    ways = np.sqrt(np.maximum(squares[:, None] + squares - 2 * points @ points.T, 0.0))
    given = np.arange(len(points))
    order = np.array([0, len(points) - 1])
    for point in given[1:-1]:
        costs = ways[order[:-1], point] + ways[point, order[1:]] - ways[order[:-1], order[1:]]
        order = np.insert(order, int(costs.argmin()) + 1, point)
    out_of_place = np.count_nonzero(order != given) >= LEAST_FRAMES
    return order if out_of_place and _length(order, ways) < SHORTER_SHARE * _length(given, ways) else given


def _length(order: NDArray[np.intp], ways: Array) -> float:
    return float(ways[order[:-1], order[1:]].sum())
