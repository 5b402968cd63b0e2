"""Checks of recording defects: missing, repeated and shuffled frames, exchanged sides, jumps, jitter, drifting lengths.

Jumps, exchanged labels and shuffled frames also exceed bounds of speed, acceleration and jerk. To report each defect
once, `explained` searches for defects in a fixed order: time stamps, repeated frames, frames out of order, exchanged
sides, jumps. Each search skips the frames with defects found earlier. The other checks of motion judge corrected
joints: sides are exchanged back, frames are assigned to slots of equal duration, and frames with a defect are NaN.
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
from posekit.validators.motion.sides import LEFT_JOINTS, RIGHT_JOINTS, SIDE_PAIRS, exchanged_pairs, put_right
from posekit.validators.motion.timeline import Timeline, median_of_five, timeline_of
from posekit.validators.motion.trembling import trembling_frames, trembling_of, usual_trembling

#: Largest share of a time step by which a time stamp may be early; a frame with an earlier stamp counts as repeated.
TWICE_FRAMES: Final = 0.75

#: Longest run of copies of a frame that `repeated` reports; longer runs are a frozen posture (`frozen`).
LONGEST_REPEAT: Final = 4.0

#: Minimum frame rate of `teleport`, frames per second; at lower rates fast limbs look like jumps.
JUMPING_RATE: Final = 15.0

#: Minimum frame rate of `jitter`, frames per second; at lower rates fast motion is not smooth from frame to frame.
TREMBLING_RATE: Final = 25.0

#: Tolerances of `teleport`, `jitter` and `drift` for measurement noise, in standard deviations.
TELEPORT_DEVIATIONS, JITTER_DEVIATIONS, DRIFT_DEVIATIONS = 5.0, 2.0, 4.0

#: Measurement noise is similar in all frames: the 2nd percentile of jitter is 0.4 to 0.9 times the median. If the ratio
#: is smaller than this share, jitter is a local defect, and the percentile estimates the noise.
CALM_PERCENT, CALM_SHARE = 2.0, 0.3

#: Minimum share of frames with another length, above which this length is a candidate for the usual length.
LEAST_OTHER: Final = 0.2

#: Jitter of a joint above which `drift` tolerates the jitter of lengths, metres; `jitter` reports such joints.
SHAKEN_METRES: Final = 0.0025


#: Largest distance between positions that count as equal, metres: it covers rounding to 32 bits.
SAME_METRES: Final = 1e-6

#: Minimum displacement of the fastest joint per frame of a moving body, metres. In slower motion rounding may make
#: frames equal.
MOVED_METRES: Final = 1e-3

#: Number of frames before, and after, a run of duplicates among which the body must move in at least one.
MOVING_FRAMES: Final = 3


#: Joints on the midline of the body.
MIDDLE_JOINTS: Final = (JOINT["neck"], JOINT["pelvis"])

#: Largest number of frames to sort at once; longer intervals are sorted in parts.
LONGEST_STRETCH: Final = 600

#: Largest path length of a better order, as a share of the path length in the given order.
SHORTER_SHARE: Final = 0.6

#: Minimum number of frames out of order in an interval.
LEAST_FRAMES: Final = 3

#: Minimum displacement per frame of a moving joint, metres.
LEAST_METRES: Final = 0.005

#: Minimum number of moving joints in a frame out of order; one or two reversing joints are jitter.
LEAST_JOINTS: Final = 3

#: Minimum rate at which motion shows the order of frames, frames per second; at lower rates people reverse their motion
#: within a frame.
ORDERED_RATE: Final = 20.0

#: Largest distance, in frames, between frames with reversing joints in one interval.
TURNS_APART: Final = 6

#: Number of frames before and after an interval that are sorted together with it.
AROUND_FRAMES: Final = 4


def needs_rate(body: Body, least: float) -> None:
    """Raise `NotAskedError` if the frame rate of a body is below `least` frames per second."""
    if body.rate < least:
        raise NotAskedError(f"it needs {least:g} frames per second")


@check("timing", unit="frames", reads=("joints",), over_time=True)
def timing(body: Body, *, missing: float = 0.5, displaced: float = 0.5) -> Judgement:
    """Frames are missing, come twice, or are out of order.

    Parameters
    ----------
    missing : float
        Allowed number of missing frames between a frame and its predecessor. The number is computed from time stamps,
        so that it may be a fraction.
    displaced : float
        Allowed difference between a frame's index and its index in the order of time stamps or of motion, frames.
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
    """Postures stay exactly the same while the body moves before and after.

    Parameters
    ----------
    longest : float
        Largest allowed number of successive copies of a frame.
    """
    return Judgement(("body",), explained(body).repeats.astype(np.float64), upper=longest)


@check("repeated", unit="frames", reads=("joints",), over_time=True)
def repeated(body: Body, *, most: float = 0.0) -> Judgement:
    """Frames are repeated while the body moves.

    Parameters
    ----------
    most : float
        Largest allowed number of successive copies of a frame.
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
        Any value below 0.5 reports every exchange; 1 reports no exchange. `posekit.validators.motion.sides` detects the
        exchanges.
    """
    if len(body) < 2 or body.q is not None:
        raise NotAskedError(
            "it needs two frames" if body.q is None else "the names of q determine right and left"
        )
    exchanged = explained(body).exchanged.astype(np.float64)
    return Judgement(SIDE_PAIRS, exchanged, upper=most + 0.5, scale=0.5)


@check("teleport", unit="m", reads=("joints",), over_time=True)
def teleport(clip: Body, /, *, joint: float = 0.07, body: float = 0.06) -> Judgement:
    """Joints, or the body, are not where the frames before and after predict them.

    Parameters
    ----------
    joint : float
        Largest allowed jump of a single joint, metres; `posekit.validators.motion.jumps` measures it.
    body : float
        Largest allowed jump of the whole body, for one frame or permanently, metres.
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
        Largest allowed standard deviation of a coordinate, metres.
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
    """Limb segments are longer or shorter than usual in the clip.

    Parameters
    ----------
    share : float
        Largest allowed difference from the usual length, as a share of the usual length.
    """
    found = explained(body)
    starts, ends = (list(one) for one in zip(*LIMB_SEGMENTS, strict=True))
    lengths = lengths_in_frames(found.joints)[LIMB_ROWS].T
    usual = _usual(lengths, share)
    shaken = np.maximum(found.trembling[:, starts], found.trembling[:, ends])
    shaken = np.where(shaken > SHAKEN_METRES, shaken, 0.0)
    # A length has the noise of both ends; the median of five frames has about half of it.
    allowed = DRIFT_DEVIATIONS * np.fmax(shaken, body.noise) / usual
    return Judgement(
        tuple(map(segment_name, LIMB_SEGMENTS)),
        found.timeline.of_frames(_smooth(lengths) / usual - 1.0),
        -share,
        share,
        found.timeline.of_frames(allowed),
    )


def _usual(lengths: Array, share: float) -> Array:
    """Return the usual lengths (K,) of the segments of `LIMB_SEGMENTS`, metres: the median in most clips.

    If many frames differ from the median, the median of these frames is a second candidate. The usual length is then
    the candidate nearer to the length of the same segment on the other side of the body.
    """
    usual = np.array([known_median(column) or np.nan for column in lengths.T])
    for k, column in enumerate(lengths.T):
        twin = usual[k + 2 if k % 4 < 2 else k - 2]
        others = column[np.abs(column / usual[k] - 1.0) > share]
        if len(others) > LEAST_OTHER * np.isfinite(column).sum():
            usual[k] = min((usual[k], float(np.median(others))), key=lambda length: abs(length - twin))
    return usual


def _smooth(lengths: Array) -> Array:
    """Return running medians of lengths over five slots (S, K); NaN if the length in the middle slot is unknown."""
    known = np.isfinite(lengths)
    last = np.maximum.accumulate(np.where(known, np.arange(len(lengths))[:, None], 0), axis=0)
    return np.where(known, median_of_five(np.take_along_axis(lengths, last, axis=0)), np.nan)


@dataclass(frozen=True, kw_only=True, eq=False)
class Explained:
    """Defects of T frames, and the motion without these defects in S time slots of equal duration.

    Parameters
    ----------
    timeline : Timeline
        Time slots of the frames.
    repeats : int array (T,)
        Length of the run of duplicates that contains each frame; 0 for frames that are not duplicates.
    displaced : int array (T,)
        Index of each frame in the order that the motion suggests, minus its index in the clip.
    exchanged : bool array (T, 6)
        Whether right and left of each pair of joints are exchanged.
    jumps : array (S, 15)
        Jumps of the joints and of the body, metres, from `posekit.validators.motion.jumps.jumps_of`.
    joints : array (S, 14, 3)
        Joint positions with corrected sides, metres; NaN in frames with a defect.
    trembling : array (S, 14)
        Standard deviation of the jitter of a coordinate, metres.
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
    """Detect the defects in the frames of a recording."""
    timeline = timeline_of(body)
    # Frames without a slot come last; no check judges them.
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
    # The names of a robot's joints determine their sides.
    if len(joints) > 1 and body.q is None:
        exchanged[kept] = exchanged_pairs(
            joints[kept], body.feet[order][kept], body.head[order][kept], follows, noise
        )
    for edge, beside in ((0, 1), (-1, -2)):
        # If all pairs seem exchanged in the first or last frame only, that frame is another posture.
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
    """Return for each frame (T,) the length of its run of duplicates; 0 if it does not copy the previous frame.

    A run counts only if the body moves by more than `MOVED_METRES` per frame shortly before and shortly after the run.
    A run at the start or end of the clip requires motion on one side only. In slower motion rounding alone may make two
    frames equal.

    Parameters
    ----------
    joints : array (T, 14, 3)
        Joint positions, metres, in the order of time. A joint that is unknown in both of two frames counts as equal.
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
    """Return each frame's index in the order that the motion suggests, minus its index in `joints` (T,).

    Parameters
    ----------
    joints : array (T, 14, 3)
        Joint positions, metres, in the given order.

    Notes
    -----
    If frames are out of order, most joints reverse their direction from frame to frame. Each interval of such frames is
    reordered to shorten the path of the joints through the interval. The algorithm inserts each frame at the position
    that lengthens the path least (Rosenkrantz et al. 1977, SIAM J. Comput. 6:563). If the new path is shorter than
    `SHORTER_SHARE` of the given path, the frames are out of order. Noise also makes joints reverse their direction, but
    no order of noisy frames has a much shorter path.
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
            # Frames around the interval are in order, even if another order has a shorter path.
            near = slice(max(first - 2, 0), last + 3)
            places[near] = found[near]
    return places


def _without_sides(joints: Array) -> Array:
    """Return coordinates of postures that are independent of right and left labels (T, 20, 3), metres.

    The coordinates are the positions of neck, pelvis and the midpoint of each pair, and entries of d dᵀ / |d|, where d
    is half the vector from left to right joint of a pair. These entries are equal for d and -d.
    """
    right, left = joints[:, RIGHT_JOINTS], joints[:, LEFT_JOINTS]
    across = (right - left) / 2.0
    lengths = np.maximum(norm(across), 1e-9)[..., None]
    squares, products = across**2 / lengths, across * np.roll(across, 1, axis=-1) / lengths
    return np.concatenate([joints[:, MIDDLE_JOINTS], (right + left) / 2.0, squares, products], axis=1)


def stretches_of(places: NDArray[np.intp]) -> NDArray[np.bool_]:
    """Return whether each frame (T,) is in an interval with frames out of order."""
    inside = np.zeros(len(places), dtype=np.bool_)
    for part in groups(np.flatnonzero(places), TURNS_APART):
        inside[part[0] : part[-1] + 1] = True
    return inside


def _stretches(turning: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """Return the first and last frames of intervals in which joints reverse their direction."""
    found = []
    for part in groups(np.flatnonzero(turning), TURNS_APART):
        for first in range(int(part[0]), int(part[-1]) + 1, LONGEST_STRETCH):
            last = min(first + LONGEST_STRETCH - 1, int(part[-1]))
            if np.count_nonzero((part >= first) & (part <= last)) >= LEAST_FRAMES - 1:
                found.append((first, last))
    return found


def _shortest(points: Array) -> NDArray[np.intp]:
    """Return an order (N,) of points (N, K) whose path is much shorter; else the given order."""
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
