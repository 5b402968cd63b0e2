"""The points of the head: names, places in the head's frame, and whether they can determine a camera."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from difflib import get_close_matches

import numpy as np
from numpy.typing import ArrayLike, NDArray

from posekit.errors import HeadError
from posekit.geometry import Array
from posekit.skeleton import HEAD_POINTS

POINT_NAMES = ("neck", *HEAD_POINTS)

MIN_POINTS = 6
"""Points that a camera's eleven unknowns need (Lee & Chen 1985, §2.1)."""

DEGENERATE_EXTENT = 1e-3
"""Fraction of the head's size below which two points count as one, and a set of points as a plane."""


@dataclass(frozen=True, kw_only=True, eq=False)
class HeadPoints:
    """Six or more named points of a head, in the head's frame.

    The frame is the paper's, right-handed: x forward, y up, z to the person's right. Its origin is free: in
    Table A.2 the neck is at (-0.34, 0.52, 0).

    Parameters
    ----------
    names : tuple of str
        One a point, each once.
    points : array (P, 3)
        Metres.

    Raises
    ------
    HeadError
        Where there are fewer than six, a coordinate is not finite, two coincide, or all lie in one plane.

    Examples
    --------
    >>> TABLE_A2.names
    ('neck', 'nose', 'right_eye', 'left_eye', 'right_ear', 'left_ear')
    >>> TABLE_A2.with_points({"chin": [-0.302, 0.565, 0.0]}).points.shape
    (7, 3)
    """

    names: tuple[str, ...]
    points: Array

    def __post_init__(self) -> None:
        names = tuple(self.names)
        points = np.array(self.points, dtype=np.float64)
        if points.shape != (len(names), 3):
            raise HeadError(
                f"the head has {len(names)} names and points of shape {points.shape}; "
                f"expected ({len(names)}, 3)"
            )
        repeated = sorted({name for name in names if names.count(name) > 1})
        if repeated:
            raise HeadError(f"head points are named twice: {', '.join(repeated)}; give each name once")
        for name, point in zip(names, points, strict=True):
            if not np.isfinite(point).all():
                raise HeadError(f"head point {name} is at {point.tolist()}; expected three finite numbers")
        reason = degeneracy(names, points, np.ones(len(names), dtype=np.bool_))
        if reason:
            raise HeadError(reason)
        points.flags.writeable = False
        object.__setattr__(self, "names", names)
        object.__setattr__(self, "points", points)

    @classmethod
    def from_mapping(cls, points: Mapping[str, ArrayLike]) -> HeadPoints:
        """Make a head of points by name, any names, in the mapping's order; metres."""
        places = []
        for name, point in points.items():
            try:
                place = np.asarray(point, dtype=np.float64)
            except (TypeError, ValueError) as error:
                raise HeadError(f"head point {name} is {point!r}; expected three numbers x, y, z") from error
            if place.shape != (3,):
                raise HeadError(f"head point {name} has shape {place.shape}; expected three numbers x, y, z")
            places.append(place)
        return cls(names=tuple(points), points=np.array(places).reshape(-1, 3))

    def with_points(self, points: Mapping[str, ArrayLike]) -> HeadPoints:
        """Replace points by name and append those that are new."""
        return HeadPoints.from_mapping({**dict(zip(self.names, self.points, strict=True)), **points})

    def index(self, name: str) -> int:
        """Return the row of a point.

        Raises
        ------
        HeadError
            Where the head has no such point.
        """
        if name not in self.names:
            near = get_close_matches(name, self.names, n=1)
            hint = f"; did you mean {near[0]}?" if near else ""
            raise HeadError(f"the head has no point {name!r}, only {', '.join(self.names)}{hint}")
        return self.names.index(name)


def degeneracy(names: tuple[str, ...], points: Array, seen: NDArray[np.bool_]) -> str:
    """Say why those points (P, 3) that are `seen` (P,) cannot determine a camera; empty if they can."""
    count = int(seen.sum())
    if count < MIN_POINTS:
        missing = [name for name, visible in zip(names, seen, strict=True) if not visible]
        listed = f"; missing: {', '.join(missing)}" if missing else ""
        return f"{count} of {len(names)} head points are known, at least {MIN_POINTS} are needed{listed}"
    known = points[seen]
    size, _, thickness = np.linalg.svd(known - known.mean(axis=0), compute_uv=False) / np.sqrt(count)
    gaps = np.linalg.norm(known[:, None] - known, axis=-1)
    gaps[np.diag_indices(count)] = np.inf
    if gaps.min() <= DEGENERATE_EXTENT * size:
        first, second = np.flatnonzero(seen)[np.array(np.unravel_index(gaps.argmin(), gaps.shape))]
        return (
            f"head points {names[first]} and {names[second]} coincide ({gaps.min():.3g} m apart): "
            "they are one point; correct them or leave one out"
        )
    if thickness <= DEGENERATE_EXTENT * size:
        return (
            f"the {count} head points lie in one plane (off it {thickness:.3g} m, along it {size:.3g} m): "
            "a plane does not determine a camera; add a point off it, the nose or the neck"
        )
    return ""


def head_points_cam(R: Array, t: Array, points: ArrayLike | HeadPoints) -> Array:
    """Place head points (P, 3) in the camera frame, ``R p + t``.

    Parameters
    ----------
    R : array (..., 3, 3)
        Rotation from the head's frame to the camera's.
    t : array (..., 3)
        The head frame's origin in the camera frame, metres.
    points : HeadPoints or array (P, 3)
        Metres, head frame.

    Returns
    -------
    array (..., P, 3)
        Metres, camera frame.
    """
    places = points.points if isinstance(points, HeadPoints) else np.asarray(points, dtype=np.float64)
    placed: Array = places @ np.swapaxes(R, -1, -2) + t[..., None, :]
    return placed


TABLE_A2 = HeadPoints(
    names=POINT_NAMES,
    points=np.array(
        [
            [-0.34168, 0.52103, 0.0],
            [-0.29168, 0.61603, 0.0],
            [-0.31168, 0.65103, 0.055],
            [-0.31168, 0.65103, -0.055],
            [-0.35168, 0.60103, 0.085],
            [-0.35168, 0.60103, -0.085],
        ]
    ),
)
"""The head of Lee & Chen 1985, Table A.2(a), in metres.

The right eye's x is printed as -32.168 cm. Only -31.168, the left eye's, gives the projection of Table A.2(b)
and the depth of Table 2(d), so it stands here.
"""
