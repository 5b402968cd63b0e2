"""DetectionRows of key points as a file lists them: person by person, in any order, picture by picture in the end."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from posekit.formats.given_file import GivenFile, counted
from posekit.formats.keypoints.keypoints import FARTHEST_PIXEL, KeyPoints
from posekit.formats.skeleton_maps import SkeletonMap
from posekit.geometry import Array
from posekit.safe_io import cut, refusal, shown

COORDINATE_TYPES = frozenset((int, float, type(None)))
"""What a list of coordinates may hold: numbers, and null for what is not known. A bool is no number."""
LARGEST_NUMBER = FARTHEST_PIXEL
"""Of any number, as of a coordinate."""


def numbers(values: object, source: str | Path, field: str, width: int) -> Array:
    """Read a flat list ``[a, b, c, a, b, c, …]`` as an array (K, width); null is NaN.

    Raises
    ------
    InputError
        Where it is no such list, or a number is beyond `LARGEST_NUMBER`.
    """
    if not isinstance(values, list) or not set(map(type, values)) <= COORDINATE_TYPES:
        raise refusal(source, field, _wrong(values), f"a list of numbers, {width} a point")
    if not values or len(values) % width:
        got = f"{len(values)} numbers"
        raise refusal(source, field, got, f"a multiple of {width}: {width} a point", "write it again")
    array = np.array(values, dtype=np.float64).reshape(-1, width)
    beyond = np.asarray(np.abs(array) > LARGEST_NUMBER)
    if beyond.any():
        worst = float(array[beyond][0])
        raise refusal(source, field, shown(worst), f"at most {LARGEST_NUMBER:g} in size")
    return array


def pairs(values: object, source: str | Path, field: str) -> Array:
    """Read ``[[x, y], …]`` as an array (K, n), n the same for all points."""
    if not isinstance(values, list) or not values or not all(isinstance(point, list) for point in values):
        raise refusal(source, field, shown(values), "a list of [x, y]")
    widths = set(map(len, values))
    if len(widths) > 1 or 0 in widths:
        raise refusal(source, field, f"points of {min(widths)} to {max(widths)} numbers", "[x, y] each")
    return numbers([number for point in values for number in point], source, field, widths.pop())


def _wrong(values: object) -> str:
    if not isinstance(values, list):
        return shown(values)
    index = next(k for k, value in enumerate(values) if type(value) not in COORDINATE_TYPES)
    return f"{shown(values[index])} at place {index}"


@dataclass
class DetectionRows:
    """What a file says of pictures and people, in the order in which it says it.

    Parameters
    ----------
    source : str
        What to call the file in errors.
    """

    source: str
    pictures: dict[str, tuple[float, float, float]] = field(default_factory=dict)
    labels: list[str] = field(default_factory=list)
    points: list[Array] = field(default_factory=list)
    confidence: list[Array] = field(default_factory=list)
    person: list[int] = field(default_factory=list)
    score: list[float] = field(default_factory=list)

    @property
    def count(self) -> int:
        """The number of points of a person; 0 as long as there is nobody."""
        return len(self.points[0]) if self.points else 0

    def documents(self, given: GivenFile) -> Iterator[tuple[Path, Any]]:
        """Go through the JSON files that are given; each is the source of errors while it is the turn of it."""
        for path, document in given.documents():
            self.source = str(path)
            yield path, document
        self.source = str(given.path)

    def picture(
        self, label: object, *, time: float = np.nan, size: Sequence[float] = (np.nan, np.nan)
    ) -> str:
        """Note that there is a picture, with people or without; return its label as text."""
        text = str(label)
        known = self.pictures.get(text, (np.nan, np.nan, np.nan))
        told = (float(time), float(size[0]), float(size[1]))
        merged = tuple(b if np.isnan(a) else a for a, b in zip(known, told, strict=True))
        self.pictures[text] = (merged[0], merged[1], merged[2])
        return text

    def add(
        self, label: object, points: Array, confidence: Array, *, person: object = None, score: object = None
    ) -> None:
        """Note a person in a picture: points (K, 2) and how sure they are (K,); a point known in part is none.

        The person's number and score are as the file has them, or None: what is no number is not known.
        """
        if len(points) != (self.count or len(points)):
            got = f"a person of {len(points)} points after one of {self.count}"
            remedy = "read the files of each model by themselves"
            raise refusal(self.source, f"picture {cut(str(label))}", got, "the same number for all", remedy)
        missing = np.asarray(np.isnan(points).any(axis=-1))
        self.labels.append(self.picture(label))
        self.points.append(np.where(missing[:, None], np.nan, points))
        self.confidence.append(np.where(missing, np.nan, confidence))
        who = whole(person)
        self.person.append(-1 if who is None else who)
        self.score.append(number(score))

    def keypoints(self, name: str, layout: SkeletonMap, *, normalised: bool = False) -> KeyPoints:
        """Make key points of all rows: pictures in the order of the numbers in their labels."""
        order = sorted(self.pictures, key=_in_order)
        place = {label: index for index, label in enumerate(order)}
        frame = np.array([place[label] for label in self.labels], dtype=np.intp)
        rows = np.argsort(frame, kind="stable")
        count = len(layout.points)
        described = np.array([self.pictures[label] for label in order]).reshape(-1, 3)
        return KeyPoints(
            format=name,
            source=self.source,
            layout=layout,
            pictures=tuple(order),
            frame=frame[rows],
            points=np.array(self.points).reshape(-1, count, 2)[rows],
            confidence=np.array(self.confidence).reshape(-1, count)[rows],
            person=np.array(self.person, dtype=np.intp)[rows],
            score=np.array(self.score, dtype=np.float64)[rows],
            time=described[:, 0],
            size=described[:, 1:],
            normalised=normalised,
        )


def _in_order(label: str) -> tuple[float, tuple[list[tuple[int, str]], str]]:
    """Order labels that are numbers by them (a minus sign is one), names by the numbers in them."""
    try:
        number = float(label)
    except ValueError:
        number = np.inf
    return (np.inf if np.isnan(number) else number), counted(Path(label))


def whole(value: object) -> int | None:
    """Return a whole number from 0 to 2**31 as int, whichever way it is spelled; None else."""
    if isinstance(value, str) and value.strip().isdecimal() and len(value) < 11:
        value = int(value)
    if isinstance(value, bool) or not isinstance(value, int | float):
        return None
    return int(value) if 0 <= value < 2**31 and value == int(value) else None


def number(value: object) -> float:
    """Return a number as float; NaN for anything else."""
    return float(value) if isinstance(value, int | float) and not isinstance(value, bool) else np.nan
