r"""Tracking: find the detections in successive pictures that show the same person.

The similarity of two detections a and b is COCO's object keypoint similarity with an additional variance for motion:

.. math:: s(a, b) = \frac1n \sum_i \exp\left(-\frac{d_i^2}{2 A (k_i^2 + m^2 g^2)}\right)

The sum covers the n points that both detections have; d_i is the distance of point i between a and b in the picture. A
is the person's area, and k_i is twice COCO's standard deviation of the point (``cocoeval.Params.setKpParams`` of
pycocotools). The detections are g pictures apart, and m is the allowed motion per picture (`MOTION_SIGMA` if the
velocity is known). Xiao, Wu & Wei 2018 (Simple baselines for human pose estimation and tracking, §3) match the poses of
successive pictures by object keypoint similarity.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from posekit.errors import refusal
from posekit.geometry import Array, Ints
from posekit.skeleton import POINTS

#: COCO's standard deviation of each point, in units of the square root of the person's area. Necks and pelvises differ
#: among detectors and are not compared.
POINT_SIGMA: Final = {
    **{"nose": 0.026, "eye": 0.025, "ear": 0.035, "shoulder": 0.079, "elbow": 0.072, "wrist": 0.062},
    **{"hip": 0.107, "knee": 0.087, "ankle": 0.089},
}

COMPARED: Final = [k for k, name in enumerate(POINTS) if name.rpartition("_")[2] in POINT_SIGMA]
FALLOFF: Final = np.array([2 * POINT_SIGMA[POINTS[k].rpartition("_")[2]] for k in COMPARED])

#: Largest number of people in a picture: the number of comparisons grows with its square.
MAX_PEOPLE: Final = 1000

#: Standard deviation of a position predicted for the next picture, in units of the square root of the area.
MOTION_SIGMA: Final = 0.12

#: A person's area as a fraction of the box around the key points, as MMPose uses it without an outline.
AREA_OVER_BOX: Final = 0.53

#: Smallest ratio of a box's width to its height: the key points of a person seen from the side have hardly any width.
MIN_WIDTH_OVER_HEIGHT: Final = 0.25

#: Similarity of detections without a common point.
UNSEEN_SIMILARITY: Final = 1e-3

#: Smallest similarity of two detections of one person.
MIN_SIMILARITY: Final = 0.15

#: Number of pictures for which an unseen person is remembered: a second of video.
PATIENCE_PICTURES: Final = 30

#: Factor on the allowed motion of a person who was seen once and whose velocity is unknown.
FRESH_MOTION_FACTOR: Final = 3.0

#: Largest number of pictures over which a velocity is extrapolated.
TRUSTED_VELOCITY_PICTURES: Final = 8

#: Fraction of a video's steps in which people move less than `MOTION_SIGMA`; in the other steps another person may
#: enter.
VIDEO_SHARE: Final = 0.75

#: Pictures per second of usual video; a longer step counts as several pictures.
VIDEO_RATE: Final = 30.0


def track(points: Array, frame: Ints, source: str = "", times: Array | None = None) -> Ints:
    """Give each person in the pictures of a film one number for all pictures.

    Each detection is compared with the predicted points of each person: the last known points, moved by the last
    velocity. Detections are assigned to people so that the sum of similarities is largest. If every picture has one
    detection, but it moves too far between pictures for a video, all detections count as one person.

    Parameters
    ----------
    points : array (N, 19, 2)
        Joints and head points, pixels; NaN if unseen.
    frame : int array (N,)
        Number of the picture, ascending.
    source : str
        File of the detections, for error messages.
    times : array, optional
        Seconds of each picture, by number.

    Returns
    -------
    int array (N,)
        Number of the person in each row, from 0, in order of appearance.

    Raises
    ------
    InputError
        If a picture has more than `MAX_PEOPLE` people.
    """
    from scipy.optimize import linear_sum_assignment

    busiest = int(np.bincount(frame).max(initial=0))
    if busiest > MAX_PEOPLE:
        expected, remedy = f"at most {MAX_PEOPLE:,} people in a picture", "leave out uncertain detections"
        raise refusal(source, "people", f"{busiest:,}", expected, remedy)
    points = points[:, COMPARED]
    size = areas(points)
    if busiest == 1 and _moves_far(points, size):
        return np.asarray(np.cumsum(np.diff(frame, prepend=frame[:1]) > PATIENCE_PICTURES + 1))
    moments = np.arange(int(frame.max(initial=-1)) + 1, dtype=np.float64)
    if times is not None and np.isfinite(times).all():
        moments[1:] = np.cumsum(np.maximum(VIDEO_RATE * np.diff(times[: len(moments)]), 1.0))
    person = np.full(len(points), -1, dtype=np.intp)
    last = np.empty(0, dtype=np.intp)  # the last row of each person who may be seen again
    place, velocity = (
        points.copy(),
        np.full((len(points), 2), np.nan),
    )  # unseen points move with the seen points
    for number in np.unique(frame):
        rows = np.flatnonzero(frame == number)
        last = last[number - frame[last] <= PATIENCE_PICTURES + 1]
        gap = moments[number] - moments[frame[last]]
        ahead = np.minimum(gap, TRUSTED_VELOCITY_PICTURES)
        reach = np.where(np.isnan(velocity[last, 0]), FRESH_MOTION_FACTOR * ahead, ahead)
        expected = place[last] + (ahead[:, None] * np.nan_to_num(velocity[last]))[:, None]
        alike = _similarity(expected, points[rows], np.fmax(size[last][:, None], size[rows]), reach)
        old, new = linear_sum_assignment(np.where(alike < MIN_SIMILARITY, 0.0, alike), maximize=True)
        same = alike[old, new] >= MIN_SIMILARITY
        old, before, now = old[same], last[old[same]], rows[new[same]]
        step = _median(points[now] - place[before])
        velocity[now] = step / gap[old, None]
        place[now] = np.where(np.isnan(points[now]), place[before] + step[:, None], points[now])
        size[now] = np.where(np.isnan(size[now]), size[before], size[now])
        person[now] = person[before]
        started = np.setdiff1d(rows, now)
        person[started] = person.max() + 1 + np.arange(len(started))
        last = np.concatenate([np.delete(last, old), rows])
    return person


def areas(points: Array) -> Array:
    """Return the areas of people (N,), square pixels; NaN if fewer than two points are known."""
    known = ~np.isnan(points[..., :1])
    low, high = np.where(known, points, np.inf).min(axis=1), np.where(known, points, -np.inf).max(axis=1)
    spans = np.where(known.sum(axis=1) > 1, high - low, np.nan)
    spans = np.maximum(spans, MIN_WIDTH_OVER_HEIGHT * spans.max(axis=1, keepdims=True))
    found = AREA_OVER_BOX * spans.prod(axis=1)
    return np.where(found > 0, found, np.nan)


def _median(values: Array) -> Array:
    """Return the median (N, ...) of the known values (N, P, ...) of each row; zero if none is known."""
    return np.asarray(
        np.nanmedian(np.where(np.isnan(values).all(axis=1, keepdims=True), 0.0, values), axis=1)
    )


def _similarity(expected: Array, seen: Array, sizes: Array, reach: Array) -> Array:
    """Return the similarities (T, N) of expected people (T, P, 2) and seen people (N, P, 2)."""
    squared = ((expected[:, None] - seen[None]) ** 2).sum(axis=-1)
    falloff = FALLOFF**2 + (MOTION_SIGMA * reach[:, None, None]) ** 2
    alike = np.exp(-squared / (2 * np.nan_to_num(sizes, nan=1.0)[..., None] * falloff))
    count = (~np.isnan(squared)).sum(axis=-1)
    return np.where(count > 0, np.nansum(alike, axis=-1) / np.maximum(count, 1), UNSEEN_SIMILARITY)


def _moves_far(points: Array, size: Array) -> bool:
    """Return whether a person, seen at points (F, P, 2), moves farther between pictures than in a video."""
    moved = _median(np.linalg.norm(np.diff(points, axis=0), axis=2))
    far = moved / np.sqrt(np.fmax(np.fmax(size[1:], size[:-1]), 1.0))
    return bool(len(far)) and float(np.quantile(far, VIDEO_SHARE)) > MOTION_SIGMA
