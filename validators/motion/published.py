"""Published rules for selecting motion data, computed as by their authors, for profiles such as ``phuma``.

PHUMA (Lee et al. 2025, arXiv:2510.26236, section 3.1 and code) judges windows of four seconds that overlap by half a
second. It uses vertices of the feet of SMPL-X; here toes, heels and ankles replace them. ProtoMotions (Tessler et al.
2024, data filters) and HoloMotion (2025, data curation) judge single frames. `skating` is the measure of Guided Motion
Diffusion (Karunratanakul et al. 2023, ICCV). Unlike `sliding` it rejects many steps of real walks.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from posekit.geometry import Array, beyond_hull, mean_known, norm, perpendicular, runs
from posekit.skeleton import FEET_POINTS, JOINT, JOINTS, SIDES, both
from posekit.validators.body import Body
from posekit.validators.check import Judgement, NotAskedError, check
from posekit.validators.motion.ground import ground_of, soles, up_of
from posekit.validators.motion.timeline import timeline_of

#: Duration, overlap and minimum duration of the windows that PHUMA judges, seconds.
CHUNK_SECONDS, OVERLAP_SECONDS, LEAST_SECONDS = 4.0, 0.5, 1.0

#: Order of the low-pass filter; it runs forward and backward.
BUTTERWORTH_ORDER: Final = 4

#: Duration of the mirrored padding at both ends of the root's path before the filter, seconds.
PADDED_SECONDS: Final = 2.0


@check("skating", unit="m", reads=("joints", "up", "time", "ground"), over_time=True)
def skating(
    body: Body, *, height: float = 0.05, way: float = 0.025, rate: float = 20.0, smoothed: int = 5
) -> Judgement:
    """Feet near the ground move along it too far in a frame.

    Parameters
    ----------
    height : float
        Height above the ground below which a foot counts as touching it, in this frame and the previous frame, metres.
    way : float
        Largest allowed displacement along the ground per frame at `rate`, metres.
    rate : float
        Frames per second for which `way` holds.
    smoothed : int
        Number of frames over which displacements are averaged; odd.
    """
    points, height_along = soles(body)
    known = np.asarray(np.isfinite(points).any(axis=(0, 2)))
    which = [side if known[side] else side + len(FEET_POINTS) for side in range(len(SIDES))]
    line, up = timeline_of(body), up_of(body)
    placed = line.spread(points[:, which])
    ways = norm(perpendicular(np.diff(placed, axis=0), up)) / (rate * body.dt)
    padded = np.pad(ways, ((smoothed // 2, smoothed // 2), (0, 0)))
    mean = sliding_window_view(padded, smoothed, axis=0).mean(axis=-1)
    over_ground = line.spread(height_along[:, which]) - body.ground
    value = np.full(over_ground.shape, np.nan)
    value[1:] = np.where(np.maximum(over_ground[1:], over_ground[:-1]) < height, mean, 0.0)
    return Judgement([f"{side}_foot" for side in SIDES], line.of_frames(value), upper=way)


@check("contact-share", unit="1", reads=("joints", "up", "time", "ground"), over_time=True)
def contact_share(body: Body, *, least: float = 0.6, window: float = 0.05) -> Judgement:
    """Feet touch the ground in too few frames of a four-second window.

    Parameters
    ----------
    least : float
        Minimum share of the frames in which a foot touches the ground.
    window : float
        Size of the interval of heights in which soles count as on the ground, metres. The interval is placed where it
        contains the lowest sole in as many frames as possible.
    """
    level = _voted(body, window)
    touches = np.asarray((np.abs(_soles(body) - level) <= window / 2).any(axis=1), dtype=np.float64)
    return Judgement(("feet",), _of_parts(body, touches[:, None], worst=np.fmin), lower=least)


@check("root-height", unit="m", reads=("joints", "up", "time", "ground"), over_time=True)
def root_height(body: Body, *, least: float = 0.6, most: float = 1.5, window: float = 0.05) -> Judgement:
    """Hips are too low or too high above the ground.

    Parameters
    ----------
    least, most : float
        Bounds of the height, metres.
    window : float
        As in `contact_share`.
    """
    value = body.height[:, both("hip")].mean(axis=1) - _voted(body, window)
    return Judgement(("root",), value, least, most)


@check("support-distance", unit="m", reads=("joints", "up", "time", "ground"), over_time=True)
def support_distance(body: Body, *, root: float = 0.06, pelvis: float = 0.11) -> Judgement:
    """Hips and pelvis are not over the feet, on average over a four-second window.

    Parameters
    ----------
    root : float
        Largest horizontal distance from the midpoint of the hips (SMPL's pelvis) to the hull of ankles and toes,
        metres.
    pelvis : float
        Largest horizontal distance from the pelvis joint (SMPL's first spine joint, about 10 cm higher) to this hull,
        metres.
    """
    feet, _ = soles(body)
    points = _hips(body), body.joints[:, JOINT["pelvis"]]
    away = np.stack([np.maximum(beyond_hull(one, feet, up_of(body)), 0.0) for one in points], axis=1)
    value = _of_parts(body, away, worst=np.fmax)
    return Judgement(("root", "pelvis"), value, upper=np.array([root, pelvis]))


@check("root-jerk", unit="m/s³", reads=("joints", "time"), over_time=True)
def root_jerk(body: Body, *, most: float = 50.0, cutoff: float = 3.0) -> Judgement:
    """Hips jerk by more than a humanoid can follow, on average over a four-second window.

    Parameters
    ----------
    most : float
        Largest mean jerk of the root, from third differences, metres per second cubed.
    cutoff : float
        Cutoff frequency of the low-pass filter of the root's path, hertz.
    """
    if body.rate <= 2.0 * cutoff:
        raise NotAskedError(f"it needs more than {2.0 * cutoff:g} frames per second")
    from scipy.signal import butter, sosfiltfilt

    line = timeline_of(body)
    root = line.spread(_hips(body))
    jerk = np.full((len(root), 1), np.nan)
    slots, known = np.arange(len(root)), np.isfinite(root[:, 0])
    if len(root) > 3 and known.any():
        filled = np.stack([np.interp(slots, slots[known], column[known]) for column in root.T], axis=1)
        sections = butter(BUTTERWORTH_ORDER, cutoff, fs=body.rate, output="sos")
        pad = min(round(PADDED_SECONDS / body.dt), len(root) - 1)
        smooth = sosfiltfilt(sections, filled, axis=0, padlen=pad)
        jerk[:-3, 0] = norm(np.diff(smooth, n=3, axis=0)) / body.dt**3
    value = _of_parts(body, line.of_frames(jerk), worst=np.fmax, inside=3)
    return Judgement(("root",), value, upper=most)


@check("above-ground", unit="m", reads=("joints", "up", "time", "ground"), over_time=True)
def above_ground(
    body: Body, *, lowest: float = -0.05, highest: float = 0.2, lasting: float = 1.0
) -> Judgement:
    """Bodies are below the ground, or away from it for too long (ProtoMotions).

    Parameters
    ----------
    lowest : float
        Minimum allowed height of the lowest point above the ground, metres (negative).
    highest : float
        Height of the lowest point above the ground that the body may exceed for at most `lasting` seconds, metres.
    lasting : float
        Longest allowed time above `highest`, seconds.
    """
    height = ground_of(body).height - body.ground
    upper = np.full(len(body), np.inf)
    for start, stop in runs(height > highest):
        if (stop - start) * body.dt > lasting:
            upper[start:stop] = highest
    return Judgement(("lowest",), height, lowest, upper[:, None], scale=0.1)


@check("root-speed", unit="m/s", reads=("joints", "time"), over_time=True)
def root_speed(body: Body, *, most: float = 10.0) -> Judgement:
    """Hips move too fast (HoloMotion).

    Parameters
    ----------
    most : float
        Largest allowed speed of the midpoint of the hips, metres per second.
    """
    return Judgement(("root",), _speeds(body, _hips(body)[:, None]), upper=most)


@check("body-speed", unit="m/s", reads=("joints", "time"), over_time=True)
def body_speed(body: Body, *, most: float = 15.0) -> Judgement:
    """Joints move too fast (ProtoMotions).

    Parameters
    ----------
    most : float
        Largest allowed speed of any joint, metres per second.
    """
    return Judgement(JOINTS, _speeds(body, body.joints), upper=most)


def _hips(body: Body) -> Array:
    """Return the midpoint of the hips (T, 3), metres."""
    return np.asarray(body.joints[:, both("hip")].mean(axis=1))


def _speeds(body: Body, points: Array) -> Array:
    """Return the speeds (T, P) of points (T, P, 3) since the previous frame, metres per second."""
    line = timeline_of(body)
    placed = line.spread(points)
    return line.of_frames(norm(np.diff(placed, axis=0, prepend=np.nan)) / body.dt)


def _of_parts(body: Body, values: Array, *, worst: np.ufunc, inside: int = 0) -> Array:
    """Return for each frame the worst mean (T, K) of values (T, K) over the windows that contain the frame.

    The mean excludes the last `inside` slots of a window, because finite differences that start in them extend beyond
    the window.
    """
    if len(body) * body.dt < LEAST_SECONDS:
        raise NotAskedError(f"it needs {LEAST_SECONDS:g} s of motion")
    line = timeline_of(body)
    placed = line.spread(values)
    found = np.full(placed.shape, np.nan)
    size, overlap, least = (
        round(seconds / body.dt) for seconds in (CHUNK_SECONDS, OVERLAP_SECONDS, LEAST_SECONDS)
    )
    start = 0
    while len(placed) - start >= max(least, 4):
        stop = start + size if start + size + least - overlap <= len(placed) else len(placed)
        found[start:stop] = worst(found[start:stop], mean_known(placed[start : stop - inside].T))
        start += size - overlap
    return line.of_frames(found)


def _soles(body: Body) -> Array:
    """Return heights of the soles below toes and heels (T, P), metres; below ankles if toes and heels are unknown."""
    height = soles(body)[1]
    toes = height[:, : len(FEET_POINTS)]
    return np.asarray(toes if np.isfinite(toes).any() else height[:, len(FEET_POINTS) :])


def _voted(body: Body, window: float) -> float:
    """Return the height of the ground, metres: as stated, or the height near which the lowest sole is most often."""
    if body.settings.ground is not None:
        return body.settings.ground
    lowest = np.sort(np.fmin.reduce(_soles(body), axis=1))
    lowest = lowest[np.isfinite(lowest)]
    if not len(lowest):
        return np.nan
    votes = np.searchsorted(lowest, lowest + window, side="right") - np.arange(len(lowest))
    return float(np.median(lowest[votes == votes.max()]) + window / 2)
