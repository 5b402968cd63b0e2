"""`Linkage`: an articulated object, made from names, a TOML file, or a robot."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from posekit.errors import InputError, nearest, refusal, shown
from posekit.files import DATA, read_table
from posekit.geometry import Array, Record, read_only

#: Largest number of segments of one object.
MAX_SEGMENTS: Final = 2000

#: Relative violation of the triangle inequality that counts as rounding of lengths; the loop is then straight.
LOOP_ROUNDING: Final = 1e-9


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Linkage(Record):
    """An articulated object: points joined by rigid segments whose lengths are known up to one factor.

    A *node* is a point or a midpoint; nodes are numbered from 0, points before midpoints. `Linkage.from_names` makes a
    linkage from names.

    Parameters
    ----------
    name : str
        Name for messages and files.
    points : sequence of P str
        Names of the points in an image.
    segments : sequence of S (int, int)
        Nodes at the two ends of each rigid segment.
    lengths : array (S,)
        Lengths of the segments, in any unit: the scale s absorbs a common factor (Taylor 2000, §2).
    midpoints : sequence of (str, (int, int))
        Names of further nodes P, P + 1, …; each is the midpoint of the segment between two points.
    coplanar : sequence of sequence of int
        Sets of four or more nodes that lie in a plane.
    perpendicular : sequence of (int, int)
        Pairs of segments at right angles.
    collinear : sequence of (int, int, int)
        Triples of nodes on one line.
    unit : float, optional
        Metres in one unit of length; None if lengths are relative.
    height : float, optional
        Height of the whole object in the unit of its lengths.
    urdf : str
        Name or path of the robot with this linkage, for its joint limits; empty if there is none.
    source : str
        Origin of the lengths.

    Raises
    ------
    InputError
        If a length is not positive, a name is unknown or repeated, some points are not connected by segments, or a loop
        cannot close.
    """

    name: str
    points: Sequence[str]
    segments: Sequence[tuple[int, int]]
    lengths: Array
    midpoints: Sequence[tuple[str, tuple[int, int]]] = ()
    coplanar: Sequence[Sequence[int]] = ()
    perpendicular: Sequence[tuple[int, int]] = ()
    collinear: Sequence[tuple[int, int, int]] = ()
    unit: float | None = None
    height: float | None = None
    urdf: str = ""
    source: str = ""

    def __post_init__(self) -> None:
        self._set("lengths", read_only(self.lengths))
        self._set("points", tuple(self.points))
        self._set("segments", tuple((int(a), int(b)) for a, b in self.segments))
        self._check_names()
        self._check_shape()
        for kind, groups, least in (("coplanar", self.coplanar, 4), ("collinear", self.collinear, 3)):
            for group in groups:
                if len(set(group)) < least:
                    names = ", ".join(self.nodes[node] for node in group)
                    expected = f"at least {least} different points"
                    raise self._wrong(kind, names, expected, "drop or complete it")

    def _wrong(self, field: str, got: str, expected: str, remedy: str = "correct it") -> InputError:
        return refusal(f"linkage {self.name}", field, got, expected, remedy)

    def _check_names(self) -> None:
        """Refuse impossible names, segments and lengths."""
        nodes, count = self.nodes, len(self.nodes)
        if len(set(nodes)) < count or not all(node and node.isprintable() for node in nodes):
            raise self._wrong("points", shown(list(nodes)), "different names of letters, digits and _")
        if not 0 < len(self.segments) <= MAX_SEGMENTS or self.lengths.shape != (len(self.segments),):
            got = f"{len(self.segments)} segments and {self.lengths.size} lengths"
            raise self._wrong("segments", got, f"1 to {MAX_SEGMENTS}, each with one length")
        seen: set[frozenset[int]] = set()
        for (a, b), length in zip(self.segments, self.lengths.tolist(), strict=True):
            if not (0 <= a < count and 0 <= b < count) or a == b or frozenset((a, b)) in seen:
                raise self._wrong("segments", f"({a}, {b})", "two different nodes, each pair once")
            if not (math.isfinite(length) and 1e-12 <= length <= 1e12):
                raise self._wrong(f"{nodes[a]}-{nodes[b]}", f"{length:g}", "a finite positive length")
            seen.add(frozenset((a, b)))
        for name, ends in self.midpoints:
            if frozenset(ends) not in seen:
                expected = "the ends of a segment"
                raise self._wrong(f"midpoints.{name}", "no segment", expected, "add the segment")
        for field in ("unit", "height"):
            value = getattr(self, field)
            if value is not None and not (math.isfinite(value) and value > 0):
                raise self._wrong(field, f"{value:g}", "a finite positive number", "leave it out")

    def _check_shape(self) -> None:
        """Refuse a linkage with points that no segments connect, or with a loop that cannot close."""
        from scipy.sparse.csgraph import shortest_path

        edges = [(*pair, float(size)) for pair, size in zip(self.segments, self.lengths, strict=True)]
        edges += [(end, middle, float(self.lengths[whole]) / 2) for end, middle, whole in self.halves]
        graph = np.full((len(self.nodes), len(self.nodes)), np.inf)
        for a, b, length in edges:
            graph[a, b] = graph[b, a] = min(length, graph[a, b])
        apart = shortest_path(graph, directed=False)
        if np.isinf(apart).any():
            alone = self.nodes[int(np.isinf(apart[0]).argmax())]
            raise self._wrong("segments", f"no way from {self.nodes[0]} to {alone}", "one connected object")
        for a, b, length in edges:
            if length > apart[a, b] * (1 + LOOP_ROUNDING):
                expected = f"a loop that closes: the others of its loop are {apart[a, b]:g} together"
                raise self._wrong(f"{self.nodes[a]}-{self.nodes[b]}", f"{length:g}", expected)

    @property
    def nodes(self) -> tuple[str, ...]:
        """Names of the points, then of the midpoints."""
        return (*self.points, *(name for name, _ in self.midpoints))

    @property
    def segment_names(self) -> tuple[str, ...]:
        """Names of the segments, ``a-b``."""
        return tuple(f"{self.nodes[a]}-{self.nodes[b]}" for a, b in self.segments)

    @property
    def halves(self) -> tuple[tuple[int, int, int], ...]:
        """Indices (end, midpoint, segment) of both halves of each segment that has a midpoint."""
        index = {frozenset(ends): number for number, ends in enumerate(self.segments)}
        return tuple(
            (end, len(self.points) + number, index[frozenset(ends)])
            for number, (_, ends) in enumerate(self.midpoints)
            for end in ends
        )

    def segment(self, name: str) -> int:
        """Return the index of a segment by its name; ``b-a`` names the same segment as ``a-b``.

        Raises
        ------
        InputError
            If no segment has that name.
        """
        turned = [f"{self.nodes[b]}-{self.nodes[a]}" for a, b in self.segments]
        known = [*self.segment_names, *turned]
        if name not in known:
            near = nearest(name, self.segment_names)
            raise self._wrong("segment", shown(name), "one of its segments", near)
        return known.index(name) % len(turned)

    def place_nodes(self, points: Array) -> Array:
        """Append the midpoints to points (..., P, D) in space or in the image; return nodes (..., N, D)."""
        middles = [points[..., list(ends), :].mean(axis=-2) for _, ends in self.midpoints]
        return np.concatenate([points, np.stack(middles, axis=-2)], axis=-2) if middles else points

    @staticmethod
    def from_names(
        *,
        name: str,
        segments: Mapping[str, float] | Mapping[tuple[str, str], float],
        points: Sequence[str] | None = None,
        midpoints: Mapping[str, Sequence[str]] | None = None,
        coplanar: Iterable[Sequence[str]] = (),
        perpendicular: Iterable[Sequence[str]] = (),
        collinear: Iterable[Sequence[str]] = (),
        **about: Any,
    ) -> Linkage:
        """Make a linkage from names.

        Parameters
        ----------
        name : str
            Name for messages.
        segments : mapping
            Segment, as ``"a-b"`` or ``("a", "b")``, to its length.
        points : sequence of str, optional
            Names of the points in their order; by default in the order in which `segments` names them.
        midpoints : mapping, optional
            Name of a midpoint to the ends of its segment.
        coplanar, perpendicular, collinear
            Groups of node names; pairs of segment names.
        **about
            ``unit``, ``height``, ``urdf``, ``source``.

        Raises
        ------
        InputError
            If a name is unknown, or for the reasons of `Linkage`.

        Examples
        --------
        >>> rod = Linkage.from_names(name="rod", segments={("a", "b"): 5.0, ("b", "c"): 3.0})
        >>> rod.segment("c-b")
        1
        """
        middles = dict(midpoints or {})
        if points is None:
            ends = (end for key in segments for end in (key.split("-") if isinstance(key, str) else key))
            points = [end for end in dict.fromkeys(ends) if end not in middles]
        nodes = [*points, *middles]

        def find(node: str) -> int:
            if node not in nodes:
                near = nearest(node, nodes)
                raise refusal(f"linkage {name}", "point", shown(node), "one of its points", near)
            return nodes.index(node)

        def split(key: str | tuple[str, str]) -> tuple[int, int]:
            if isinstance(key, str):
                parts = key.split("-")
                ways = [("-".join(parts[:k]), "-".join(parts[k:])) for k in range(1, len(parts))]
                known = [way for way in ways if set(way) <= set(nodes)]
                key = known[0] if len(known) == 1 else (key, key)
            return find(key[0]), find(key[1])

        pairs = [split(key) for key in segments]
        made = Linkage(
            name=name,
            points=points,
            segments=pairs,
            lengths=np.array(list(segments.values()), dtype=np.float64),
            midpoints=[(middle, (find(a), find(b))) for middle, (a, b) in middles.items()],
            coplanar=[tuple(find(node) for node in group) for group in coplanar],
            collinear=[(find(a), find(b), find(c)) for a, b, c in collinear],
            **about,
        )
        return replace(made, perpendicular=[(made.segment(a), made.segment(b)) for a, b in perpendicular])


def linkage_names() -> tuple[str, ...]:
    """Return the names of the built-in linkages."""
    return tuple(sorted(path.stem for path in (DATA / "linkages").glob("*.toml")))


def load_linkage(name: str | Path) -> Linkage:
    """Load a linkage by name, from a TOML file, or from a robot.

    Parameters
    ----------
    name : str or path
        ``taylor_human``, ``four_bar``, ``planar_chain``; a ``.toml`` file; or a robot or URDF that
        `posekit.robots.load_robot` knows.

    Raises
    ------
    InputError
        If the name is unknown, or the file or robot describes no object.

    Examples
    --------
    >>> human = load_linkage("taylor_human")
    >>> len(human.points), len(human.segments)
    (12, 11)
    """
    if str(name) not in linkage_names() and Path(name).suffix.lower() != ".toml":
        from posekit.robots import load_robot

        return linkage_of_robot(load_robot(str(name), bodies="none"))
    table = read_table(str(name), "linkages", linkage_names(), "posekit.linkage/1", "linkage")
    table |= table.pop("constraints", {})
    table.pop("schema")
    try:
        return Linkage.from_names(**{"name": Path(name).stem} | table)
    except (AttributeError, TypeError, ValueError) as error:
        got = str(error).rpartition("() ")[2].removeprefix("got ")
        raise refusal(name, "", got, "the fields of posekit.linkage/1", "correct it") from None


#: Distance (metres) from all joints below which the base or the end of a limb is not a separate point.
MIN_POINT_DISTANCE_METRES: Final = 5e-3


def linkage_of_robot(robot: Any) -> Linkage:
    """Return a linkage whose points are the revolute joints, the base and the ends of limbs of a robot.

    A segment joins two points whose distance is the same in several random configurations. A rigid body with three or
    more points therefore becomes a set of triangles.

    Parameters
    ----------
    robot : Robot
        `posekit.robots.Robot`.

    Raises
    ------
    InputError
        If fewer than two points remain, or rigid segments do not connect all points.
    """
    import pinocchio as pin

    from posekit.robots.kinematics import frame_places
    from posekit.synthesis.objects import random_configurations

    model = robot.model
    # Points after a sliding joint have no constant distance to other points.
    kinds = [joint.shortname().removeprefix("JointModel") for joint in model.joints]
    sliding = {k for k, kind in enumerate(kinds) if kind.startswith(("P", "T"))}
    turning = [k for k in range(1, model.njoints) if not sliding.intersection(model.supports[k])]
    bodies = [k for k, frame in enumerate(model.frames) if frame.type == pin.FrameType.BODY]
    used = {frame.parentFrame for frame in model.frames}
    last = [k for k in bodies if k not in used and model.frames[k].parentJoint in turning]
    joints = [model.getFrameId(model.names[k], pin.FrameType.JOINT) for k in turning if model.nvs[k] == 1]
    ids = [*bodies[:1], *joints, *last]
    shapes = random_configurations(robot, 6, np.random.default_rng(0))
    places, ends = frame_places(model, shapes, ids), [0, *range(1 + len(joints), len(ids))]
    # Joints come first; a base or an end near a joint is omitted, and coincident joints are one point.
    kept: list[int] = []
    for k in [*range(1, 1 + len(joints)), *ends]:
        apart = MIN_POINT_DISTANCE_METRES if k in ends else 1e-9
        gaps = np.linalg.norm(places[:, kept] - places[:, [k]], axis=2)
        if (gaps.max(axis=0, initial=0.0) > apart).all():
            kept.append(k)
    kept.sort()
    points, names = places[:, kept], [model.frames[ids[k]].name for k in kept]
    segments: dict[tuple[str, str], float] = {}
    for a, b in combinations(range(len(names)), 2):
        length = np.linalg.norm(points[:, a] - points[:, b], axis=1)
        if np.ptp(length) < 1e-9:
            segments[names[a], names[b]] = float(length.mean())
    return Linkage.from_names(
        name=robot.name,
        points=names,
        segments=segments,
        unit=1.0,
        urdf=robot.source or robot.name,
        source=robot.name,
    )


def read_nearer(
    linkage: Linkage, nearer: Mapping[str, str] | Sequence[Mapping[str, str]] | None, count: int
) -> NDArray[np.int8]:
    """Return the stated flips (F, S) of F = `count` frames: 1, -1, or 0 if the flip is not stated.

    Parameters
    ----------
    linkage : Linkage
    nearer : mapping or sequence of mappings, optional
        Mapping from the name of a segment to the name of its nearer end: one mapping for all frames, or one per frame.
    count : int
        Number of frames.

    Raises
    ------
    InputError
        If a segment or an end is unknown, or the number of mappings is not the number of frames.
    """
    hands = [nearer] if isinstance(nearer, Mapping) else list(nearer or [{}])
    if len(hands) not in (1, count):
        expected = f"{count}, or one for all"
        raise refusal("", "nearer", f"{len(hands)} frames", expected, "give one per frame")
    flips = np.zeros((len(hands), len(linkage.segments)), dtype=np.int8)
    for own, choices in zip(flips, hands, strict=True):
        for name, end in choices.items():
            number = linkage.segment(name)
            ends = [linkage.nodes[node] for node in linkage.segments[number]]
            if end not in ends:
                where, expected = f"linkage {linkage.name}", " or ".join(ends)
                raise refusal(where, f"nearer.{name}", shown(end), expected, "correct it")
            own[number] = 1 - 2 * ends.index(end)
    return np.broadcast_to(flips, (count, flips.shape[1]))


def name_nearer(linkage: Linkage, flips: Array | NDArray[np.int8]) -> dict[str, str]:
    """Return flips (S,) as a mapping from segments to their nearer ends: the inverse of `read_nearer`."""
    return {
        name: linkage.nodes[ends[0] if flip > 0 else ends[1]]
        for name, ends, flip in zip(linkage.segment_names, linkage.segments, flips.tolist(), strict=True)
        if flip != 0
    }
