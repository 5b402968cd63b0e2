"""Who is who along a sequence, where the file does not say: detections are matched picture by picture."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import Final

import numpy as np
from numpy.typing import NDArray

from posekit.errors import InputError
from posekit.formats.keypoints.keypoints import KeyPoints
from posekit.formats.keypoints.track_assignment import assign
from posekit.formats.keypoints.track_similarity import (
    COMPARED_LANDMARKS,
    MOTION_SIGMA,
    area,
    similarity,
)
from posekit.geometry import Array
from posekit.safe_io import refusal

MIN_SIMILARITY: Final = 0.15
"""Similarity below which two detections are not one person."""
PATIENCE_PICTURES: Final = 30
"""Pictures through which somebody who is not seen is waited for: a second of video."""
MAX_PEOPLE: Final = 1000
"""In one picture; the work grows with the square."""
FRESH_MOTION_FACTOR: Final = 3.0
"""How much more motion is allowed somebody who was seen once, whose speed is not known."""
TRUSTED_SPEED_PICTURES: Final = 8
"""Pictures over which a speed is trusted: who is gone for longer may have turned."""
VIDEO_SHARE: Final = 0.75
"""Share of a video's pictures between which people move less than `MOTION_SIGMA`: now and then somebody else comes."""
PICTURES_A_SECOND: Final = 30.0
"""Of usual video: pictures that are farther apart in time count as so many as it would have had between them."""


def track(
    keypoints: KeyPoints, *, least: float = MIN_SIMILARITY, patience: int = PATIENCE_PICTURES
) -> KeyPoints:
    """Tell people apart along the pictures.

    Each detection is compared with where the people of the pictures before are expected (the last place, moved on at
    the last speed) by `posekit.formats.keypoints.track_similarity.similarity`, and the assignment with the largest
    sum is taken. Who is not seen is waited for. The work is O(F P²) for P people in each of F pictures.

    Pictures that are farther apart in time than a video's leave people room for as much more. One detection a picture
    is one person where people move farther between pictures than in a video, whatever the times.

    Parameters
    ----------
    least : float
        Similarity, 0 to 1, below which somebody is new.
    patience : int
        Pictures through which somebody who is not seen is waited for.

    Returns
    -------
    KeyPoints
        With `person` from 0, by first appearance; in a collection of photographs everybody is somebody else. Where the
        file says who somebody is, that stays, and others get numbers behind those.

    Raises
    ------
    InputError
        Where a bound is impossible, or more than `MAX_PEOPLE` people are in a picture.
    """
    if not 0 < least < 1 or patience < 0:
        raise InputError(
            f"tracking asks for a similarity of {least:g} and waits {patience} pictures; expected 0 to 1, and 0 or more"
        )
    unknown: NDArray[np.intp] = np.flatnonzero(keypoints.person < 0)
    if not len(unknown):
        return keypoints
    if not keypoints.sequence:
        person = keypoints.person.copy()
        person[unknown] = person.max(initial=-1) + 1 + np.arange(len(unknown))
        return replace(keypoints, person=person)
    frames = keypoints.frame[unknown]
    busiest = int(np.bincount(frames).max())
    if busiest > MAX_PEOPLE:
        picture = keypoints.pictures[int(np.argmax(np.bincount(frames)))]
        expected = f"at most {MAX_PEOPLE:,} to track"
        remedy = "leave out the unsure ones"
        raise refusal(keypoints.source, f"picture {picture}", f"{busiest:,} people", expected, remedy)
    person = keypoints.person.copy()
    points = keypoints.landmarks[unknown][:, COMPARED_LANDMARKS]
    areas = area(points)
    if busiest == 1 and len(unknown) == len(person) and _far_apart(points, areas):
        return replace(keypoints, person=np.cumsum(np.diff(frames, prepend=frames[0]) > patience + 1))
    tracks = _Tracks(int(keypoints.person.max(initial=-1)) + 1, _moments(keypoints))
    edges = np.flatnonzero(np.diff(frames, prepend=-1, append=frames[-1] + 1))
    for start, end in pairwise(edges):
        rows = slice(int(start), int(end))
        person[unknown[rows]] = tracks.meet(int(frames[start]), points[rows], areas[rows], least, patience)
    return replace(keypoints, person=person)


def _far_apart(points: Array, areas: Array) -> bool:
    """Tell whether somebody, seen at points (F, P, 2), moves farther from picture to picture than in a video."""
    if len(points) == 1:
        return True
    moved = np.linalg.norm(np.diff(points, axis=0), axis=2)
    moved[np.isnan(moved).all(axis=1)] = 0.0
    far = np.nanmedian(moved, axis=1) / np.sqrt(np.fmax(np.fmax(areas[1:], areas[:-1]), 1.0))
    return float(np.nanquantile(far, VIDEO_SHARE)) > MOTION_SIGMA


def _moments(keypoints: KeyPoints) -> Array:
    """Return when each picture was taken (F,), in pictures of usual video; neighbours are one apart at least."""
    count = np.arange(len(keypoints.pictures), dtype=np.float64)
    apart = np.diff(keypoints.time)
    if not np.isfinite(apart).all():
        return count
    return np.concatenate([count[:1], np.cumsum(np.maximum(PICTURES_A_SECOND * apart, 1.0))])


@dataclass
class _Tracks:
    """The people who may be seen again: where they were last, how fast, and when; `moments` (F,) are the pictures'."""

    next: int
    moments: Array
    who: NDArray[np.intp] = field(default_factory=lambda: np.empty(0, dtype=np.intp))
    last: NDArray[np.intp] = field(default_factory=lambda: np.empty(0, dtype=np.intp))
    points: Array = field(default_factory=lambda: np.empty((0, len(COMPARED_LANDMARKS), 2)))
    speed: Array = field(default_factory=lambda: np.empty((0, 2)))
    area: Array = field(default_factory=lambda: np.empty(0))
    fresh: NDArray[np.bool_] = field(default_factory=lambda: np.empty(0, dtype=np.bool_))

    def meet(self, frame: int, seen: Array, areas: Array, least: float, patience: int) -> NDArray[np.intp]:
        """Say who the people of a picture are, and remember them."""
        waiting = frame - self.last <= patience + 1
        self._keep(waiting)
        found: NDArray[np.intp] = np.full(len(seen), -1, dtype=np.intp)
        if len(self.who) and len(seen):
            pairs = self._pairs(frame, seen, areas, least)
            found[pairs[:, 1]] = pairs[:, 0]
        old = found >= 0
        self._move(found[old], frame, seen[old], areas[old])
        new = ~old
        count = int(new.sum())
        who: NDArray[np.intp] = np.empty(len(seen), dtype=np.intp)
        who[old] = self.who[found[old]]
        who[new] = self.next + np.arange(count)
        self.next += count
        self.who = np.concatenate([self.who, who[new]])
        self.last = np.concatenate([self.last, np.full(count, frame, dtype=np.intp)])
        self.points = np.concatenate([self.points, seen[new]])
        self.speed = np.concatenate([self.speed, np.zeros((count, 2))])
        self.area = np.concatenate([self.area, areas[new]])
        self.fresh = np.concatenate([self.fresh, np.ones(count, dtype=np.bool_)])
        return who

    def _keep(self, rows: NDArray[np.bool_]) -> None:
        for name in ("who", "last", "points", "speed", "area", "fresh"):
            setattr(self, name, getattr(self, name)[rows])

    def _pairs(self, frame: int, seen: Array, areas: Array, least: float) -> NDArray[np.intp]:
        """Return pairs (track, detection) with the largest sum of similarities, none below `least`."""
        gap = self.moments[frame] - self.moments[self.last]
        ahead = np.minimum(gap, TRUSTED_SPEED_PICTURES)
        expected = self.points + (ahead[:, None] * self.speed)[:, None]
        both = np.stack(np.broadcast_arrays(self.area[:, None], areas[None]))
        common = np.where(np.isnan(both).all(axis=0), 1.0, np.fmax(both[0], both[1]))
        alike = similarity(expected, seen, common, np.where(self.fresh, FRESH_MOTION_FACTOR * ahead, ahead))
        alike[alike < least] = 0.0
        turned = alike.shape[0] > alike.shape[1]
        table = alike.T if turned else alike
        columns = assign(1.0 - table)
        kept = table[np.arange(len(columns)), columns] > 0
        rows = np.flatnonzero(kept)
        pairs = np.stack([rows, columns[kept]], axis=1)
        return np.asarray(pairs[:, ::-1] if turned else pairs, dtype=np.intp)

    def _move(self, rows: NDArray[np.intp], frame: int, seen: Array, areas: Array) -> None:
        """Take over where people are now; a point that is hidden stays where it was, moved along with the others."""
        gap = self.moments[frame] - self.moments[self.last[rows]]
        moved = seen - self.points[rows]
        known = ~np.isnan(moved[..., 0])
        step = np.zeros((len(rows), 2))
        some = known.any(axis=1)
        step[some] = _median(moved[some])
        self.speed[rows] = step / gap[:, None]
        self.points[rows] = np.where(np.isnan(seen), self.points[rows] + step[:, None], seen)
        self.area[rows] = np.where(np.isnan(areas), self.area[rows], areas)
        self.last[rows] = frame
        self.fresh[rows] = False


def _median(values: Array) -> Array:
    """Return the medians (N, 2) of what is known of (N, P, 2), at least one each; NaN sorts last."""
    ordered = np.sort(values, axis=1)
    count = (~np.isnan(values[..., 0])).sum(axis=1)
    row = np.arange(len(values))
    return np.asarray((ordered[row, (count - 1) // 2] + ordered[row, count // 2]) / 2)
