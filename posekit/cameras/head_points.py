"""The points of a head: their names, their positions in the head's frame, and a test whether they fix a camera.

The head's frame is right-handed: x forward, y up, z to the person's right (Lee & Chen 1985, §2.1).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from posekit.errors import HeadError, refusal
from posekit.geometry import Array, Flags, Record
from posekit.skeleton import HEAD_POINTS

#: Minimum number of points that determine a camera's eleven unknowns (Lee & Chen 1985, §2.1).
MIN_POINTS: Final = 6

#: Ratio of a point set's thickness to its size; below it the points lie in one plane, or on one line of the image.
DEGENERATE_EXTENT: Final = 1e-3


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class HeadPoints(Record):
    """Six or more named points of a head, in the head's frame.

    Parameters
    ----------
    names : tuple of str
        Unique name of each point.
    points : array (P, 3)
        Positions, metres. The origin of the head's frame is arbitrary: in `TABLE_A2` the neck is at (-0.34, 0.52, 0).

    Raises
    ------
    HeadError
        If there are fewer than six points, a coordinate is not finite, or all points lie in one plane.

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
        names, points = tuple(self.names), np.array(self.points, dtype=np.float64)
        if points.shape != (len(names), 3) or not np.isfinite(points).all():
            got = f"{len(names)} names and points of shape {points.shape}"
            raise refusal("head_points", "", got, "three finite numbers for each name", error=HeadError)
        if reason := degeneracy(names, points, np.ones(len(names), dtype=np.bool_)):
            raise HeadError(reason)
        self._set("names", names)
        self._set("points", points)

    @classmethod
    def from_mapping(cls, points: Mapping[str, ArrayLike]) -> HeadPoints:
        """Make head points from a mapping of names to positions, metres; keep the order of the mapping."""
        return cls(names=tuple(points), points=np.array(list(points.values()), dtype=np.float64))

    def with_points(self, points: Mapping[str, ArrayLike]) -> HeadPoints:
        """Return head points with some positions replaced by name, and new names appended."""
        return HeadPoints.from_mapping({**dict(zip(self.names, self.points, strict=True)), **points})


def degeneracy(names: tuple[str, ...], points: Array, seen: Flags) -> str:
    """Return the reason why the seen points determine no camera; an empty string if they determine one."""
    count = int(seen.sum())
    if count < MIN_POINTS:
        missing = [name for name, visible in zip(names, seen, strict=True) if not visible]
        listed = f"; missing: {', '.join(missing)}" if missing else ""
        return f"{count} of {len(names)} head points are known, at least {MIN_POINTS} are needed{listed}"
    known = points[seen]
    size, _, thickness = np.linalg.svd(known - known.mean(axis=0), compute_uv=False) / np.sqrt(count)
    if thickness <= DEGENERATE_EXTENT * size:
        return (
            f"the {count} head points lie in one plane (thickness {thickness:.3g} m, size {size:.3g} m): "
            "a plane does not determine a camera; add a point off it, the nose or the neck"
        )
    return ""


#: The head of Lee & Chen 1985, Table A.2(a), in metres.
#:
#: The right eye's x is printed as -32.168 cm. Only -31.168, the value of the left eye, reproduces the projection of
#: Table A.2(b) and the depth of Table 2(d), so it is used here.
TABLE_A2: Final = HeadPoints(
    names=("neck", *HEAD_POINTS),
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
