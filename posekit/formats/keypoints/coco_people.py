"""COCO's people: the fields that annotations and results share, and how their points' third number is meant."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from posekit.formats.keypoints.coco_images import Images
from posekit.geometry import Array
from posekit.safe_io import refusal, shown


def pictures_of(
    source: Path, field: str, people: Sequence[dict[str, Any]], images: Images
) -> NDArray[np.intp]:
    """Return the picture of each person (D,).

    Raises
    ------
    InputError
        Where one belongs to no picture of the file.
    """
    frame = np.empty(len(people), dtype=np.intp)
    for place, one in enumerate(people):
        identity = one.get("image_id")
        if type(identity) not in (int, str) or identity not in images.index:
            raise refusal(
                source,
                f"{field}[{place}].image_id",
                shown(identity),
                f"the id of one of the {len(images.names)} images",
                "add the image, or remove the person",
            )
        frame[place] = images.index[identity]
    return frame


def identities_of(source: Path, field: str, people: Sequence[dict[str, Any]]) -> list[int | str]:
    """Return the picture's id of each person, for files without a list of images.

    Raises
    ------
    InputError
        Where one has none.
    """
    found: list[int | str] = []
    for place, one in enumerate(people):
        identity = one.get("image_id")
        if not isinstance(identity, int | str) or isinstance(identity, bool):
            raise refusal(source, f"{field}[{place}].image_id", shown(identity), "a number")
        found.append(identity)
    return found


def scores_of(source: Path, field: str, people: Sequence[dict[str, Any]]) -> Array:
    """Return each person's score (D,), NaN where there is none."""
    values = [one.get("score") for one in people]
    for place, value in enumerate(values):
        if value is not None and type(value) not in (int, float):
            raise refusal(source, f"{field}[{place}].score", shown(value), "a number")
    return np.array([np.nan if value is None else value for value in values], dtype=np.float64)


def tracks_of(source: Path, field: str, people: Sequence[dict[str, Any]]) -> NDArray[np.intp]:
    """Return who each person is along the pictures (D,): PoseTrack's ``track_id``, -1 where there is none."""
    values = [one.get("track_id", -1) for one in people]
    for place, value in enumerate(values):
        if value is not None and (type(value) is not int or not -1 <= value < 2**31):
            raise refusal(source, f"{field}[{place}].track_id", shown(value), "a number from 0")
    return np.array([-1 if value is None else value for value in values], dtype=np.intp)


def as_confidences(values: Array) -> tuple[Array, Array]:
    """Part triples (D, K, 3) of a detector into points and confidences; (0, 0) is a missing point."""
    points, confidence = values[..., :2].copy(), values[..., 2].copy()
    missing = np.isnan(points).all(axis=-1) | (points == 0).all(axis=-1)
    points[missing] = np.nan
    confidence[missing] = np.nan
    return points, confidence


def by_picture(frame: NDArray[np.intp], points: Array) -> NDArray[np.intp]:
    """Return the rows (D',) of people of whom a point is known, in the order of their pictures."""
    known = np.flatnonzero(~np.isnan(points[..., 0]).all(axis=1)) if points.size else np.empty(0, np.intp)
    ordered: NDArray[np.intp] = known[np.argsort(frame[known], kind="stable")]
    return ordered
