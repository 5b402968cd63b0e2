"""The parts of COCO-WholeBody's 133 points, and how files part them."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np

from posekit.formats.keypoints.coco_triples import triples
from posekit.geometry import Array
from posekit.safe_io import refusal, shown

WHOLEBODY_PARTS: Final = (
    ("keypoints", 17, ""),
    ("foot_kpts", 6, "foot_valid"),
    ("face_kpts", 68, "face_valid"),
    ("lefthand_kpts", 21, "lefthand_valid"),
    ("righthand_kpts", 21, "righthand_valid"),
)
"""A part's field, its points, and the flag that says whether it was labelled."""
WHOLEBODY_POINTS: Final = sum(count for _, count, _ in WHOLEBODY_PARTS)
FLAGGED_POINTS: Final = 23
"""Body and feet come first: of their points it is known whether they are hidden."""


def is_wholebody(person: dict[str, Any]) -> bool:
    """Tell whether a person has the parts, or the 133 in one list."""
    points = person.get("keypoints")
    return any(field in person for field, *_ in WHOLEBODY_PARTS[1:]) or (
        isinstance(points, list) and len(points) == 3 * WHOLEBODY_POINTS
    )


def joined(source: Path, field: str, people: Sequence[dict[str, Any]]) -> Array:
    """Join each person's parts (D, 133, 3); (0, 0, 0) for parts that are absent, empty or flagged as not labelled.

    Raises
    ------
    InputError
        Where a part has another number of points, or something else than numbers.
    """
    if not people:
        return np.empty((0, WHOLEBODY_POINTS, 3))
    columns = []
    start = 0
    for name, count, flag in WHOLEBODY_PARTS:
        part = slice(3 * start, 3 * (start + count))
        start += count
        lists = []
        for place, one in enumerate(people):
            whole = one.get("keypoints")
            values = (
                whole[part]
                if isinstance(whole, list) and len(whole) == 3 * WHOLEBODY_POINTS
                else one.get(name)
            )
            if values is None or values == [] or (flag and not one.get(flag, True)):
                values = [0] * (3 * count)
            if not isinstance(values, list) or len(values) != 3 * count:
                got = f"{len(values)} numbers" if isinstance(values, list) else shown(values)
                raise refusal(source, f"{field}[{place}].{name}", got, f"{3 * count}: [x, y, v] * {count}")
            lists.append(values)
        columns.append(triples(source, lists, lambda k, name=name: f"{field}[{k}].{name}"))  # type: ignore[misc]
    return np.concatenate(columns, axis=1)
