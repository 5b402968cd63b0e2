"""Key points in memory: what a detector found in the pictures of one camera."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Final

import numpy as np
from numpy.typing import NDArray

from posekit.display.short_repr import ShortRepr
from posekit.errors import InputError
from posekit.formats.skeleton_maps import SkeletonMap
from posekit.geometry import Array
from posekit.safe_io import refusal

FARTHEST_PIXEL: Final = 1e6
"""Pixels from the origin: no picture is so large, and a larger number is damage."""


def _nothing() -> Array:
    return np.empty(0)


@dataclass(frozen=True, kw_only=True, eq=False)
class KeyPoints(ShortRepr):
    """D detections of people in F pictures, K points each; a row is one person in one picture.

    Parameters
    ----------
    format : str
        The format's name, as ``openpose``.
    source : str
        The file or folder it came from.
    layout : SkeletonMap
        What the points are; its `points` are the K names.
    pictures : tuple of str (F,)
        What each picture is called: a file's name, an image id, a frame's number.
    size : array (F, 2)
        Width and height of each picture, pixels; NaN where the file does not say.
    time : array (F,)
        Seconds; NaN where the file does not say.
    frame : int array (D,)
        The picture of each detection, ascending.
    person : int array (D,)
        Who it is along the pictures, from 0; -1 where the file does not say.
    points : array (D, K, 2)
        Pixels, x right, y down, the middle of the first pixel at (0, 0) where the format says so; NaN where a
        point is missing, which is never a point at the origin. Where `normalised`, fractions of width and height.
    confidence : array (D, K)
        As the file has it; NaN where there is none, or the point is missing.
    occluded : bool array (D, K)
        Points that were placed though hidden.
    score : array (D,)
        The detection's; NaN where there is none.
    sequence : bool
        Whether the pictures are of one film; in a collection of photographs nobody is followed.
    normalised : bool
        Whether the points are fractions of the picture, whose size is not known.
    by_camera : bool
        Whether it is one person whom several cameras saw: `person` is the number of the camera.

    Raises
    ------
    InputError
        Where shapes do not fit, a coordinate is infinite or beyond `FARTHEST_PIXEL`, a point is known in part, or a
        size, a time, a confidence or a person's number is impossible.
    """

    format: str
    source: str
    layout: SkeletonMap
    pictures: tuple[str, ...]
    frame: NDArray[np.intp]
    points: Array
    size: Array = field(default_factory=_nothing)
    time: Array = field(default_factory=_nothing)
    person: NDArray[np.intp] = field(default_factory=lambda: np.empty(0, dtype=np.intp))
    confidence: Array = field(default_factory=_nothing)
    occluded: NDArray[np.bool_] = field(default_factory=lambda: np.empty(0, dtype=np.bool_))
    score: Array = field(default_factory=_nothing)
    sequence: bool = True
    normalised: bool = False
    by_camera: bool = False

    def __post_init__(self) -> None:
        count, people, pictures = len(self.layout.points), len(self.frame), len(self.pictures)
        shapes: dict[str, tuple[tuple[int, ...], object]] = {
            "frame": ((people,), np.intp),
            "points": ((people, count, 2), np.float64),
            "size": ((pictures, 2), np.float64),
            "time": ((pictures,), np.float64),
            "person": ((people,), np.intp),
            "confidence": ((people, count), np.float64),
            "occluded": ((people, count), np.bool_),
            "score": ((people,), np.float64),
        }
        empty = {np.float64: np.nan, np.intp: -1, np.bool_: False}
        for name, (shape, kind) in shapes.items():
            given = np.array(getattr(self, name), dtype=kind)  # type: ignore[call-overload]
            left_out = given.size == 0 and name not in ("frame", "points")
            values = np.full(shape, empty[kind], dtype=kind) if left_out else given  # type: ignore[index, call-overload]
            if values.shape != shape:
                raise InputError(f"{self.source}: {name} has shape {values.shape}; expected {shape}")
            values.flags.writeable = False
            object.__setattr__(self, name, values)
        self._check()

    def __len__(self) -> int:
        """Return the number of detections."""
        return len(self.frame)

    def _check(self) -> None:
        unknown = np.isnan(self.points)
        with np.errstate(invalid="ignore"):
            bad = (np.abs(self.points) > FARTHEST_PIXEL) | (unknown ^ unknown.all(axis=-1, keepdims=True))
        if bad.any():
            row, point, _ = (int(k) for k in np.argwhere(bad)[0])
            raise refusal(
                self.source,
                f"{self.pictures[int(self.frame[row])]}: {self.layout.points[point]}",
                str(self.points[row, point].tolist()),
                f"two numbers up to {FARTHEST_PIXEL:,.0f}, or a missing point",
            )
        if len(self.frame) and (
            (np.diff(self.frame) < 0).any() or self.frame[0] < 0 or self.frame[-1] >= len(self.pictures)
        ):
            raise InputError(f"{self.source}: detections are not in the order of their pictures")
        for name, values, impossible, expected in (
            ("size", self.size, (self.size <= 0) | np.isinf(self.size), "a positive width and height"),
            ("time", self.time, np.isinf(self.time), "seconds"),
            ("confidence", self.confidence, np.isinf(self.confidence), "a finite number"),
            ("score", self.score, np.isinf(self.score), "a finite number"),
            ("person", self.person, self.person < -1, "a number from 0, or -1 for unknown"),
        ):
            if impossible.any():
                where = tuple(int(k) for k in np.argwhere(impossible)[0])
                of = where[0] if name in ("size", "time") else int(self.frame[where[0]])
                raise refusal(
                    self.source, f"{self.pictures[of]}: {name}", str(values[where].item()), expected
                )

    @property
    def landmarks(self) -> Array:
        """The landmarks of every detection (D, 21, 2), ordered as `posekit.formats.skeleton_maps.LANDMARK_ORDER` is."""
        return self.layout.gather(self.points)

    @property
    def landmark_confidence(self) -> Array:
        """How sure the landmarks are (D, 21); a mean's is the mean of its points'."""
        return self.layout.gather(self.confidence[..., None])[..., 0]
