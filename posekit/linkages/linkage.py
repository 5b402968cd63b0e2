"""An articulated object as data: points, segments of known length, and what else is known of its shape."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import TypedDict, Unpack

import numpy as np

from posekit.errors import InputError
from posekit.geometry import Array
from posekit.linkages import consistency
from posekit.linkages.naming import find, split_segment


@dataclass(frozen=True, kw_only=True)
class Midpoint:
    """A point in the middle of a segment; its image is the mean of the segment's ends (Taylor 2000, eq. 1).

    Parameters
    ----------
    name : str
        Its own, as an image or a constraint names it.
    ends : tuple of int
        The segment's two ends, as indices into the linkage's points.
    """

    name: str
    ends: tuple[int, int]


class AboutLinkage(TypedDict, total=False):
    """What is said of a linkage as a whole; `Linkage` describes each."""

    unit: float | None
    height: float | None
    urdf: str | None
    source: str


@dataclass(frozen=True, kw_only=True, eq=False)
class Linkage:
    """An articulated object: points joined by rigid segments whose lengths are known up to one factor.

    A *node* is a point or, after them, a midpoint. Make one from names with `from_names`.

    Parameters
    ----------
    name : str
        What messages and files call the object.
    points : tuple of str (P,)
        Names of the points that an image shows.
    segments : tuple of (int, int) (S,)
        The nodes at the two ends of each rigid segment.
    lengths : array (S,)
        Their lengths, in any unit: one factor is absorbed by the scale s (Taylor 2000, §2).
    midpoints : tuple of Midpoint
        Further nodes, P, P + 1, …, which the image need not show.
    coplanar : tuple of tuple of int
        Sets of four or more nodes that lie in a plane.
    perpendicular : tuple of (int, int)
        Pairs of segments at right angles, as indices into `segments`.
    collinear : tuple of (int, int, int)
        Triples of nodes that lie on a line.
    unit : float, optional
        Metres of one unit of length; absent where the lengths are relative.
    height : float, optional
        Height of the whole object, in the unit of its lengths: a stature in pixels divided by it is s.
    urdf : str, optional
        Name or file of the robot with this linkage, for its joint limits.
    source : str
        Where the lengths come from.

    Raises
    ------
    InputError
        Where a length is not finite and positive, a node or a name is unknown or repeated, a segment is given
        twice, the object falls into parts, a loop cannot close, or its constraints contradict each other.
    """

    name: str
    points: tuple[str, ...]
    segments: tuple[tuple[int, int], ...]
    lengths: Array
    midpoints: tuple[Midpoint, ...] = ()
    coplanar: tuple[tuple[int, ...], ...] = ()
    perpendicular: tuple[tuple[int, int], ...] = ()
    collinear: tuple[tuple[int, int, int], ...] = ()
    unit: float | None = None
    height: float | None = None
    urdf: str | None = None
    source: str = ""

    def __post_init__(self) -> None:
        lengths = np.array(self.lengths, dtype=np.float64)
        lengths.flags.writeable = False
        object.__setattr__(self, "lengths", lengths)
        where = f"linkage {self.name}"
        consistency.check_names(where, self.nodes)
        consistency.check_midpoints(where, self.nodes, self.segments, [m.ends for m in self.midpoints])
        consistency.check_segments(where, self.nodes, self.segments, lengths, self.halves)
        consistency.check_connected(where, self.nodes, self.segments, self.halves)
        consistency.check_loops(where, self.nodes, self.segments, lengths, self.halves)
        consistency.check_constraints(
            where, self.nodes, self.segments, lengths, self.coplanar, self.perpendicular, self.collinear
        )
        for field, value in (("unit", self.unit), ("height", self.height)):
            if value is not None and not (math.isfinite(value) and value > 0):
                raise InputError(
                    f"{where}: {field} is {value:g}; expected a finite positive number, or leave it out"
                )

    @property
    def nodes(self) -> tuple[str, ...]:
        """Names of the points, then of the midpoints."""
        return (*self.points, *(midpoint.name for midpoint in self.midpoints))

    @property
    def segment_names(self) -> tuple[str, ...]:
        """Names of the segments, ``a-b``."""
        return tuple(f"{self.nodes[a]}-{self.nodes[b]}" for a, b in self.segments)

    @property
    def halves(self) -> tuple[tuple[int, int, int], ...]:
        """Both halves of every segment with a midpoint: (end, midpoint, index of the segment)."""
        index = {frozenset(ends): number for number, ends in enumerate(self.segments)}
        return tuple(
            (end, len(self.points) + number, index[frozenset(midpoint.ends)])
            for number, midpoint in enumerate(self.midpoints)
            if frozenset(midpoint.ends) in index
            for end in midpoint.ends
        )

    def segment(self, name: str) -> int:
        """Return the index of a segment; ``b-a`` is ``a-b``.

        Raises
        ------
        InputError
            Where there is none of that name.
        """
        return find_segment(f"linkage {self.name}", name, self.nodes, self.segments)

    def place_nodes(self, points: Array) -> Array:
        """Add the midpoints to points or their images: (..., P, D) to (..., P + midpoints, D)."""
        middles = [points[..., m.ends, :].mean(axis=-2) for m in self.midpoints]
        return np.concatenate([points, np.stack(middles, axis=-2)], axis=-2) if middles else points

    @staticmethod
    def from_names(
        *,
        name: str,
        segments: Mapping[str, float] | Mapping[tuple[str, str], float],
        points: Sequence[str] | None = None,
        midpoints: Mapping[str, tuple[str, str]] | None = None,
        coplanar: Iterable[Sequence[str]] = (),
        perpendicular: Iterable[tuple[str, str]] = (),
        collinear: Iterable[Sequence[str]] = (),
        **about: Unpack[AboutLinkage],
    ) -> Linkage:
        """Make a linkage from names.

        Parameters
        ----------
        name : str
            What messages call it.
        segments : mapping
            Segment, as ``"a-b"`` or ``("a", "b")``, to its length.
        points : sequence of str, optional
            Their order; by default as the segments, given as pairs, name them.
        midpoints : mapping, optional
            Name of a midpoint to the ends of its segment.
        coplanar : iterable of sequences of str
            Groups of four or more nodes that lie in one plane, by name.
        perpendicular : iterable of (str, str)
            Pairs of segments at a right angle, by name.
        collinear : iterable of sequences of str
            Triples of nodes on one line, by name.
        **about
            Unit, height, URDF and source, as `Linkage` has them.

        Raises
        ------
        InputError
            As `Linkage` does, and where a name is not known.
        """
        where = f"linkage {name}"
        middles = {} if midpoints is None else dict(midpoints)
        if points is None:
            pairs = [key for key in segments if isinstance(key, tuple)]
            if len(pairs) < len(segments):
                raise InputError(f"{where}: give points too, or name each segment by a pair of points")
            points = [point for point in dict.fromkeys(sum(pairs, ())) if point not in middles]
        nodes = (*points, *middles)
        ends = tuple(
            tuple(find(where, end, nodes) for end in key)
            if isinstance(key, tuple)
            else split_segment(where, key, nodes)
            for key in segments
        )
        for key, pair in zip(segments, ends, strict=True):
            if len(pair) != 2:
                raise InputError(f"{where}: segment {key!r} has {len(pair)} ends; expected 2")
        return Linkage(
            name=name,
            points=tuple(points),
            segments=tuple((pair[0], pair[1]) for pair in ends),
            lengths=np.array(list(segments.values()), dtype=np.float64),
            midpoints=tuple(
                Midpoint(name=middle, ends=(find(where, a, nodes), find(where, b, nodes)))
                for middle, (a, b) in middles.items()
            ),
            coplanar=tuple(tuple(find(where, node, nodes) for node in group) for group in coplanar),
            perpendicular=tuple(
                (
                    find_segment(where, a, nodes, ends),
                    find_segment(where, b, nodes, ends),
                )
                for a, b in perpendicular
            ),
            collinear=tuple(_triple(where, group, nodes) for group in collinear),
            **about,
        )


def find_segment(where: str, name: str, nodes: Sequence[str], segments: Sequence[Sequence[int]]) -> int:
    """Return the index of the segment called ``a-b`` or ``b-a``."""
    pair = split_segment(where, name, nodes)
    for number, ends in enumerate(segments):
        if set(ends) == set(pair):
            return number
    names = [f"{nodes[ends[0]]}-{nodes[ends[1]]}" for ends in segments]
    raise InputError(f"{where}: {name} is not one of its segments; they are {', '.join(names)}")


def _triple(where: str, group: Sequence[str], nodes: Sequence[str]) -> tuple[int, int, int]:
    if len(group) != 3:
        raise InputError(f"{where}: collinear {', '.join(group)}: {len(group)} points; expected 3")
    a, b, c = (find(where, node, nodes) for node in group)
    return a, b, c
