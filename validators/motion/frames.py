"""Checks of frames as such: missing, repeated, shuffled, exchanged sides, jumps, trembling, drifting lengths."""

from __future__ import annotations

from typing import Final

import numpy as np

from posekit.geometry import Array
from posekit.skeleton import JOINTS, LIMB_SEGMENTS, segment_name
from posekit.validators.body import Body
from posekit.validators.check import Judgement, NotAskedError, check
from posekit.validators.motion.explained import explained
from posekit.validators.motion.sides import SIDE_PAIRS
from posekit.validators.motion.timeline import known_median, median_of_five, norm
from posekit.validators.motion.trembling import trembling_frames

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

#: Share of the frames with another length from which either may be the usual one.
LEAST_OTHER: Final = 0.2

#: Trembling of a joint from which lengths tremble too, metres: `jitter` names that.
SHAKEN_METRES: Final = 0.0025


def needs_rate(body: Body, least: float) -> None:
    """Refuse a body with fewer frames per second."""
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
    found = explained(body)
    value, bound = found.trembling, deviation + JITTER_DEVIATIONS * body.noise
    hot = np.nan_to_num(value) > bound
    if hot.any():
        exact = trembling_frames(found.joints, hot)
        most = np.where(hot, value, 0.0).max(axis=0)
        value = np.where(exact, np.where(hot, value, most), np.minimum(value, deviation))
    return Judgement(
        JOINTS, found.timeline.of_frames(value), upper=deviation, tolerance=JITTER_DEVIATIONS * body.noise
    )


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
    lengths = norm(found.joints[:, ends] - found.joints[:, starts])
    usual = _usual(lengths, share)
    shaken = np.maximum(found.trembling[:, starts], found.trembling[:, ends])
    shaken = np.where(shaken > SHAKEN_METRES, shaken, 0.0)
    # A length has the noise of its two ends, the median of five frames about half of it.
    allowed = DRIFT_DEVIATIONS * np.fmax(shaken, body.noise) / np.where(usual > 0, usual, 1.0)
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
    usual = np.array([known_median(column) for column in lengths.T])
    for k, column in enumerate(lengths.T):
        twin = usual[k + 2 if k % 4 < 2 else k - 2]
        others = column[np.abs(column / usual[k] - 1.0) > share]
        if len(others) > LEAST_OTHER * np.isfinite(column).sum():
            other = float(np.median(others))
            if abs(other - twin) < abs(usual[k] - twin):
                usual[k] = other
    return usual


def _smooth(lengths: Array) -> Array:
    """Return medians over five slots (S, K): an unknown length is the last known one beside others."""
    known = np.isfinite(lengths)
    last = np.maximum.accumulate(np.where(known, np.arange(len(lengths))[:, None], 0), axis=0)
    return np.where(known, median_of_five(np.take_along_axis(lengths, last, axis=0)), np.nan)
