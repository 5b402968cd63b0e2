"""The people in a file: who there is, and one of them along the pictures."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from posekit.formats.keypoints.keypoints import KeyPoints
from posekit.formats.keypoints.rows import whole
from posekit.formats.keypoints.track_similarity import area
from posekit.formats.keypoints.tracking import track
from posekit.geometry import Array
from posekit.safe_io import refusal, shown

PERSON_RULES: Final = ("largest", "first", "surest")
"""How somebody can be chosen without a number."""


@dataclass(frozen=True, kw_only=True)
class Person:
    """What a file has of one person.

    Parameters
    ----------
    person : int
        The number to choose them by.
    pictures : int
        In how many pictures they are.
    first, last : str
        The names of the first and of the last of these.
    confidence : float
        The mean of all points that are there; NaN where the file has none.
    seen : float
        How many of the landmarks that the layout has are there, as a fraction, over all these pictures.
    height : float
        The median of the longer side of the box around them, in the file's unit.
    """

    person: int
    pictures: int
    first: str
    last: str
    confidence: float
    seen: float
    height: float


def list_people(keypoints: KeyPoints) -> tuple[Person, ...]:
    """List who is in the pictures; people are tracked first where the file does not tell them apart."""
    tracked = track(keypoints)
    landmarks = tracked.landmarks
    possible = max(len(tracked.layout.landmarks), 1)
    found = []
    for person in np.unique(tracked.person):
        rows = np.flatnonzero(tracked.person == person)
        sure = tracked.confidence[rows]
        sure = sure[~np.isnan(sure)]
        frames = np.unique(tracked.frame[rows])
        found.append(
            Person(
                person=int(person),
                pictures=len(frames),
                first=tracked.pictures[int(frames[0])],
                last=tracked.pictures[int(frames[-1])],
                confidence=float(sure.mean()) if len(sure) else float("nan"),
                seen=float((~np.isnan(landmarks[rows, :, 0])).sum() / (possible * len(rows))),
                height=_median(_longest(tracked.points[rows])),
            )
        )
    return tuple(found)


def choose(keypoints: KeyPoints, person: int | str = "largest") -> KeyPoints:
    """Choose one person along the pictures.

    Parameters
    ----------
    person : int or str
        The number of `list_people`: the file's own, or that of tracking. Or ``largest``: who fills most of the
        pictures, summed over them; ``surest``: whose points' confidences sum to most; ``first``: the first in the first
        picture that has anybody. In a collection of photographs nobody is followed: a rule chooses in each picture.

    Returns
    -------
    KeyPoints
        At most one row a picture; pictures without that person keep their place.

    Raises
    ------
    InputError
        Where nobody has that number.
    """
    tracked = track(keypoints)
    people = np.unique(tracked.person)
    number = whole(person)
    if number is None and person not in PERSON_RULES:
        raise refusal(keypoints.source, "person", shown(person), f"a number, or {', '.join(PERSON_RULES)}")
    if not len(people):
        return tracked
    if number is None and not keypoints.sequence:
        return select(tracked, _best(tracked, np.arange(len(tracked)), _worth(tracked, str(person))))
    if number is None:
        number = _by_rule(tracked, people, str(person))
    elif number not in people:
        there = ", ".join(str(one) for one in people[:10]) + (", …" if len(people) > 10 else "")
        raise refusal(keypoints.source, "person", str(number), f"one of {there}", "list them first")
    rows = np.flatnonzero(tracked.person == number)
    return select(tracked, _best(tracked, rows, _sureness(tracked)))  # trackers do repeat somebody


def select(keypoints: KeyPoints, rows: ArrayLike) -> KeyPoints:
    """Return some of the detections, by index or mask, ascending; pictures keep their places."""
    index: NDArray[np.intp] = np.arange(len(keypoints))[np.asarray(rows)].reshape(-1)
    return replace(
        keypoints,
        frame=keypoints.frame[index],
        points=keypoints.points[index],
        person=keypoints.person[index],
        confidence=keypoints.confidence[index],
        occluded=keypoints.occluded[index],
        score=keypoints.score[index],
    )


def _by_rule(tracked: KeyPoints, people: NDArray[np.intp], rule: str) -> int:
    if rule == "first":
        return int(tracked.person[0])
    worth = _worth(tracked, rule)
    total = np.bincount(np.searchsorted(people, tracked.person), weights=worth)
    return int(people[int(np.argmax(total))])


def _worth(tracked: KeyPoints, rule: str) -> Array:
    """Return what each detection (D,) counts by a rule."""
    if rule == "first":
        return -np.arange(len(tracked), dtype=np.float64)
    return np.sqrt(np.nan_to_num(_area(tracked))) if rule == "largest" else _sureness(tracked)


def _area(keypoints: KeyPoints) -> Array:
    """Return areas (D,): of pictures whose size is known, as fractions of them."""
    size = keypoints.size[keypoints.frame].prod(axis=1)
    return area(keypoints.points) / np.where(np.isnan(size) | np.isnan(size).any(), 1.0, size)


def _sureness(keypoints: KeyPoints) -> Array:
    """Return the sum of confidences (D,); a point without one counts as sure."""
    there = ~np.isnan(keypoints.points[..., 0])
    sure = np.where(np.isnan(keypoints.confidence), 1.0, keypoints.confidence)
    return np.asarray(np.where(there, sure, 0.0).sum(axis=1))


def _best(keypoints: KeyPoints, rows: NDArray[np.intp], worth: Array) -> NDArray[np.intp]:
    """Keep of some rows the one in each picture that counts most."""
    rows = rows[np.lexsort((-worth[rows], keypoints.frame[rows]))]
    return np.asarray(rows[np.diff(keypoints.frame[rows], prepend=-1) > 0])


def _longest(points: Array) -> Array:
    known = np.asarray(~np.isnan(points[..., :1]))
    low = np.where(known, points, np.inf).min(axis=1)
    high = np.where(known, points, -np.inf).max(axis=1)
    return np.asarray(np.where(np.asarray(known.any(axis=(1, 2)))[:, None], high - low, np.nan).max(axis=1))


def _median(values: Array) -> float:
    values = values[np.isfinite(values)]
    return float(np.median(values)) if len(values) else float("nan")
