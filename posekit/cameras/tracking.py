r"""Tracking: which detections of successive pictures are one person.

Detections are compared by COCO's object keypoint similarity, widened for motion:

.. math:: s(a, b) = \frac1n \sum_i \exp\left(-\frac{d_i^2}{2 A (k_i^2 + m^2 g^2)}\right)

over the n points that both have, with d_i their distance in the picture, A the person's area, k_i twice COCO's
standard deviation of the point (cocodataset.org, "Keypoint Evaluation", 1.2; numbers as in pycocotools,
``cocoeval.Params.setKpParams``), and m the allowed motion a picture, g pictures apart. Matching poses of successive
pictures by it is Xiao, Wu & Wei 2018 (Simple baselines for human pose estimation and tracking, §3).
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

MAX_PEOPLE: Final = 1000

#: Standard deviation of the predicted place a picture ahead, in units of the square root of the area.
MOTION_SIGMA: Final = 0.12

#: A person's area as a fraction of the box around the key points, as usual without an outline (MMPose).
AREA_OVER_BOX: Final = 0.53

#: Smallest width of a box over its height: a person seen from the side has hardly any.
MIN_WIDTH_OVER_HEIGHT: Final = 0.25

#: Similarity of detections without a common point.
UNSEEN_SIMILARITY: Final = 1e-3

#: Similarity below which two detections are not one person.
MIN_SIMILARITY: Final = 0.15

#: Pictures for which an unseen person is kept: a second of video.
PATIENCE_PICTURES: Final = 30

#: Factor of the allowed motion of a person seen once, whose velocity is unknown.
FRESH_MOTION_FACTOR: Final = 3.0

#: Pictures over which a velocity is extrapolated.
TRUSTED_VELOCITY_PICTURES: Final = 8

#: Share of a video's pictures between which people move less than `MOTION_SIGMA`: sometimes another person enters.
VIDEO_SHARE: Final = 0.75

#: Pictures per second of usual video: longer steps count as the number of pictures that it would have had.
VIDEO_RATE: Final = 30.0


def track(points: Array, frame: Ints, first: int = 0, source: str = "", times: Array | None = None) -> Ints:
    """Assign numbers to people along the pictures of a film.

    Each detection is compared with the predicted places of the people of earlier pictures (the last place, moved on at
    the last velocity), and the assignment with the largest sum of similarities is taken. One detection a picture is one
    person if people move farther between pictures than in a video.

    Parameters
    ----------
    points : array (N, 19, 2)
        Joints and head points, pixels; NaN if unseen.
    frame : int array (N,)
        Number of the picture, ascending.
    first : int
        Number of the first person.
    source : str
        File of the detections, for errors.
    times : array, optional
        Seconds of each picture, by number.

    Returns
    -------
    int array (N,)
        Numbers from `first`, by appearance.

    Raises
    ------
    InputError
        If a picture has more than `MAX_PEOPLE` people: the work grows with their square.
    """
    busiest = int(np.bincount(frame).max(initial=0))
    if busiest > MAX_PEOPLE:
        expected, remedy = f"at most {MAX_PEOPLE:,} people in a picture", "leave out uncertain detections"
        raise refusal(source, "people", f"{busiest:,}", expected, remedy)
    points = points[:, COMPARED]
    size = areas(points)
    person = np.full(len(points), -1, dtype=np.intp)
    if len(np.unique(frame)) == len(frame) and _moves_far(points, size):
        return first + np.cumsum(np.diff(frame, prepend=frame[:1]) > PATIENCE_PICTURES + 1)
    moments = np.arange(int(frame.max(initial=-1)) + 1, dtype=np.float64)
    if times is not None and np.isfinite(times).all():
        moments[1:] = np.cumsum(np.maximum(VIDEO_RATE * np.diff(times[: len(moments)]), 1.0))
    last = np.empty(0, dtype=np.intp)  # the last row of each person who may be seen again
    velocity = np.empty((0, 2))
    known = np.empty((0, *points.shape[1:]))  # the last place of every point, those unseen since moved along
    count = 0
    for number in np.unique(frame):
        rows = np.flatnonzero(frame == number)
        waiting = number - frame[last] <= PATIENCE_PICTURES + 1
        last, velocity, known = last[waiting], velocity[waiting], known[waiting]
        gap = moments[number] - moments[frame[last]]
        ahead = np.minimum(gap, TRUSTED_VELOCITY_PICTURES)
        fresh = np.isnan(velocity[:, 0])
        expected = known + (ahead[:, None] * np.nan_to_num(velocity))[:, None]
        common = np.fmax(size[last][:, None], size[rows])
        reach = np.where(fresh, FRESH_MOTION_FACTOR * ahead, ahead)
        old, new = _matches(_similarity(expected, points[rows], common, reach))
        step = _median(points[rows[new]] - known[old])
        velocity[old] = step / gap[old, None]
        known[old] = np.where(np.isnan(points[rows[new]]), known[old] + step[:, None], points[rows[new]])
        person[rows[new]] = person[last[old]]
        size[rows[new]] = np.where(np.isnan(size[rows[new]]), size[last[old]], size[rows[new]])
        last[old] = rows[new]
        started = np.setdiff1d(rows, rows[new])
        person[started] = count + np.arange(len(started))
        count += len(started)
        last = np.concatenate([last, started])
        velocity = np.concatenate([velocity, np.full((len(started), 2), np.nan)])
        known = np.concatenate([known, points[started]])
    return first + person


def _median(moved: Array) -> Array:
    """Return the median motion (N, 2) of points (N, P, 2); zero if none is known."""
    ordered, row = np.sort(moved, axis=1), np.arange(len(moved))  # NaN sorts last
    count = np.maximum((~np.isnan(moved[..., 0])).sum(axis=1), 1)
    return np.asarray(np.nan_to_num((ordered[row, (count - 1) // 2] + ordered[row, count // 2]) / 2))


def _matches(alike: Array) -> tuple[Ints, Ints]:
    """Return pairs (old, new) with the largest sum of similarities, none below `MIN_SIMILARITY`."""
    from scipy.optimize import linear_sum_assignment

    alike = np.where(alike < MIN_SIMILARITY, 0.0, alike)
    old, new = linear_sum_assignment(alike, maximize=True)
    kept = alike[old, new] > 0
    return old[kept], new[kept]


def _similarity(expected: Array, seen: Array, sizes: Array, reach: Array) -> Array:
    """Compare expected people (T, P, 2) with seen ones (N, P, 2): similarities (T, N)."""
    squared = ((expected[:, None] - seen[None]) ** 2).sum(axis=-1)
    both = ~np.isnan(squared)
    falloff = FALLOFF**2 + (MOTION_SIGMA * reach[:, None, None]) ** 2
    spread = np.nan_to_num(sizes, nan=1.0)[..., None] * falloff
    alike = np.where(both, np.exp(-np.where(both, squared, 0.0) / (2 * spread)), 0.0)
    count = both.sum(axis=-1)
    return np.where(count > 0, alike.sum(axis=-1) / np.maximum(count, 1), UNSEEN_SIMILARITY)


def areas(points: Array) -> Array:
    """Return the areas of people (N,), square pixels; NaN if fewer than two points are known."""
    known = ~np.isnan(points[..., :1])
    low, high = np.where(known, points, np.inf).min(axis=1), np.where(known, points, -np.inf).max(axis=1)
    spans = np.where(known.sum(axis=1) > 1, high - low, np.nan)
    spans = np.maximum(spans, MIN_WIDTH_OVER_HEIGHT * spans.max(axis=1, keepdims=True))
    found = AREA_OVER_BOX * spans.prod(axis=1)
    return np.where(found > 0, found, np.nan)


def _moves_far(points: Array, size: Array) -> bool:
    """Tell whether a person, seen at points (F, P, 2), moves farther from picture to picture than in a video."""
    if len(points) == 1:
        return True
    moved = np.linalg.norm(np.diff(points, axis=0), axis=2)
    moved[np.isnan(moved).all(axis=1)] = 0.0
    far = np.nanmedian(moved, axis=1) / np.sqrt(np.fmax(np.fmax(size[1:], size[:-1]), 1.0))
    return float(np.nanquantile(far, VIDEO_SHARE)) > MOTION_SIGMA
