"""COCO's people: the fields that annotations and results share, and how their points' third number is meant."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from posekit.formats.keypoints.coco_images import Images
from posekit.formats.keypoints.keypoints import KeyPoints
from posekit.formats.skeleton_maps import SkeletonMap
from posekit.geometry import Array
from posekit.safe_io import refusal, shown


def _each(
    source: Path,
    field: str,
    people: Sequence[dict[str, Any]],
    name: str,
    fits: Callable[[Any], bool],
    expected: str,
    remedy: str = "correct it",
) -> list[Any]:
    """Return one value of each person; None, where it is not there, has to fit too."""
    values = [one.get(name) for one in people]
    for place, value in enumerate(values):
        if not fits(value):
            raise refusal(source, f"{field}[{place}].{name}", shown(value), expected, remedy)
    return values


def identities_of(source: Path, field: str, people: Sequence[dict[str, Any]]) -> list[int | str]:
    """Return the picture's id of each person, for files without a list of images.

    Raises
    ------
    InputError
        Where one has none.
    """
    return _each(source, field, people, "image_id", lambda one: type(one) in (int, str), "a number")


class Parted(NamedTuple):
    """People's numbers, parted.

    Attributes
    ----------
    points : array (D, K, 2)
        NaN where one is missing.
    confidence : array (D, K)
        NaN where there is none.
    occluded : bool array (D, K)
        Which points are hidden.
    """

    points: Array
    confidence: Array
    occluded: NDArray[np.bool_]


def key_points_of(
    source: Path,
    field: str,
    people: Sequence[dict[str, Any]],
    images: Images,
    parted: Parted,
    layout: SkeletonMap,
    *,
    format: str,
    sequence: bool = False,
) -> KeyPoints:
    """Make key points of the people of whom a point is known, in the order of their pictures.

    Parameters
    ----------
    source : Path
        The file.
    field : str
        Where in it the people are listed; empty where they are all of it.
    people : sequence of dict (D,)
        As listed, each with its ``image_id`` and perhaps a ``score`` and PoseTrack's ``track_id``.
    images : Images
        The pictures.
    parted : Parted
        The people's points.
    layout : SkeletonMap
        What the points are.
    format : str
        The format's name.
    sequence : bool
        Whether the pictures are of one film.

    Raises
    ------
    InputError
        Where a person belongs to no picture of the file, or a score or a track is no number.
    """
    identities = _each(
        source,
        field,
        people,
        "image_id",
        lambda one: type(one) in (int, str) and one in images.index,
        f"the id of one of the {len(images.names)} images",
        "add the image, or remove the person",
    )
    scores = _each(
        source, field, people, "score", lambda one: one is None or type(one) in (int, float), "a number"
    )
    tracks = _each(
        source,
        field,
        people,
        "track_id",
        lambda one: one is None or (type(one) is int and -1 <= one < 2**31),
        "a number from 0",
    )
    frame = np.array([images.index[one] for one in identities], dtype=np.intp)
    points = parted.points if parted.points.size else np.empty((len(people), len(layout.points), 2))
    known = np.flatnonzero(~np.isnan(parted.points[..., 0]).all(axis=1)) if parted.points.size else frame[:0]
    rows = known[np.argsort(frame[known], kind="stable")]
    return KeyPoints(
        format=format,
        source=str(source),
        layout=layout,
        pictures=images.names,
        size=images.size,
        frame=frame[rows],
        points=points[rows],
        confidence=parted.confidence[rows],
        occluded=parted.occluded[rows],
        score=np.array([np.nan if one is None else one for one in scores], dtype=np.float64)[rows],
        person=np.array([-1 if one is None else one for one in tracks], dtype=np.intp)[rows],
        sequence=sequence,
    )


def as_confidences(values: Array) -> Parted:
    """Part triples (D, K, 3) of a detector into points and confidences; (0, 0) is a missing point."""
    points, confidence = values[..., :2].copy(), values[..., 2].copy()
    missing = np.isnan(points).all(axis=-1) | (points == 0).all(axis=-1)
    points[missing] = np.nan
    confidence[missing] = np.nan
    return Parted(points, confidence, np.zeros(missing.shape, dtype=np.bool_))
