"""What makes an articulated object impossible: checked once, when a `Linkage` is made."""

from __future__ import annotations

import heapq
import math
from collections.abc import Sequence

import numpy as np

from posekit.errors import InputError
from posekit.geometry import Array
from posekit.linkages.naming import shown

Halves = Sequence[tuple[int, int, int]]
Segments = Sequence[tuple[int, int]]

MAX_NODES = 500
"""The most points and midpoints of one object."""

MAX_SEGMENTS = 2000
"""The most segments of one object."""

LENGTH_RANGE = (1e-12, 1e12)
"""Lengths that double precision can square and compare."""

RELATIVE_ROUNDING = 1e-9
"""Of a length: how far rounded lengths may miss the triangle inequality and still make a flat loop."""


def check_names(where: str, nodes: Sequence[str]) -> None:
    """Refuse names that are empty, do not print, or are given twice."""
    if len(nodes) > MAX_NODES:
        raise InputError(f"{where}: {len(nodes)} points; expected at most {MAX_NODES}")
    if len(nodes) < 2:
        raise InputError(f"{where}: {len(nodes)} points; expected at least two, joined by a segment")
    seen: set[str] = set()
    for node in nodes:
        if not node or not node.isprintable() or node != node.strip():
            raise InputError(f"{where}: {shown(node)!r} is no name for a point; use letters, digits and _")
        if node in seen:
            raise InputError(f"{where}: point {shown(node)} is given twice; give each its own name")
        seen.add(node)


def check_midpoints(
    where: str, nodes: Sequence[str], segments: Segments, ends: Sequence[tuple[int, int]]
) -> None:
    """Refuse a midpoint whose two ends are no segment."""
    n_points = len(nodes) - len(ends)
    joined = {frozenset(pair) for pair in segments}
    for number, (a, b) in enumerate(ends):
        name = nodes[n_points + number]
        if not (0 <= a < n_points and 0 <= b < n_points):
            raise InputError(f"{where}: midpoint {name} must lie between two points, not other midpoints")
        if frozenset((a, b)) not in joined:
            raise InputError(
                f"{where}: midpoint {name} is of no segment: {nodes[a]}-{nodes[b]} is not given; "
                "add it to the segments with its length"
            )


def check_segments(
    where: str, nodes: Sequence[str], segments: Segments, lengths: Array, halves: Halves
) -> None:
    """Refuse segments without two different ends, given twice, or without a finite positive length."""
    if len(segments) == 0:
        raise InputError(f"{where}: no segments; expected at least one, with its length")
    if lengths.shape != (len(segments),):
        raise InputError(
            f"{where}: {lengths.size} lengths for {len(segments)} segments; expected one for each"
        )
    if len(segments) > MAX_SEGMENTS:
        raise InputError(f"{where}: {len(segments)} segments; expected at most {MAX_SEGMENTS}")
    pieces = {frozenset((end, middle)) for end, middle, _ in halves}
    seen: set[frozenset[int]] = set()
    for (a, b), length in zip(segments, lengths.tolist(), strict=True):
        if not (0 <= a < len(nodes) and 0 <= b < len(nodes)):
            raise InputError(f"{where}: segment ({a}, {b}): expected indices from 0 to {len(nodes) - 1}")
        name = f"{nodes[a]}-{nodes[b]}"
        if a == b:
            raise InputError(
                f"{where}: segment {name} begins and ends at one point; join two different points"
            )
        if not (math.isfinite(length) and length > 0):
            raise InputError(
                f"{where}: segment {name} has length {length:g}; expected a finite length above zero"
            )
        if not LENGTH_RANGE[0] <= length <= LENGTH_RANGE[1]:
            raise InputError(
                f"{where}: segment {name} has length {length:g}; expected one from {LENGTH_RANGE[0]:g} to "
                f"{LENGTH_RANGE[1]:g}: choose another unit"
            )
        if frozenset((a, b)) in seen:
            raise InputError(f"{where}: segment {name} is given twice; keep one of the two")
        if frozenset((a, b)) in pieces:
            raise InputError(f"{where}: segment {name} is half of another one; leave it out")
        seen.add(frozenset((a, b)))


def check_connected(where: str, nodes: Sequence[str], segments: Segments, halves: Halves) -> None:
    """Refuse an object that falls into parts: their depths would have nothing to do with each other."""
    parts = components(len(nodes), [*segments, *((end, middle) for end, middle, _ in halves)])
    if len(parts) > 1:
        listed = " and ".join(_listed([nodes[node] for node in part]) for part in parts[:3])
        raise InputError(
            f"{where}: falls into {len(parts)} parts, {listed}; join them by segments or make each its own linkage"
        )


def components(n: int, edges: Sequence[tuple[int, int]]) -> list[list[int]]:
    """Group n nodes by what edges connect, each group in order."""
    neighbours: list[list[int]] = [[] for _ in range(n)]
    for a, b in edges:
        neighbours[a].append(b)
        neighbours[b].append(a)
    parts: list[list[int]] = []
    seen: set[int] = set()
    for start in range(n):
        if start in seen:
            continue
        seen.add(start)
        part = [start]
        for node in part:  # grows while it is walked
            fresh = [other for other in dict.fromkeys(neighbours[node]) if other not in seen]
            seen.update(fresh)
            part.extend(fresh)
        parts.append(sorted(part))
    return parts


def check_loops(where: str, nodes: Sequence[str], segments: Segments, lengths: Array, halves: Halves) -> None:
    """Refuse loops that cannot close: one segment is longer than all the others of its loop together."""
    edges = [
        *((a, b, length) for (a, b), length in zip(segments, lengths.tolist(), strict=True)),
        *((end, middle, float(lengths[whole]) / 2) for end, middle, whole in halves),
    ]
    if len(edges) < len(nodes):
        return  # a tree
    nearest = np.full((len(nodes), len(nodes)), np.inf)
    for a, b, length in edges:
        nearest[a, b] = nearest[b, a] = min(nearest[a, b], length)
    for node in range(len(nodes)):  # Floyd 1962, Warshall 1962
        nearest = np.minimum(nearest, nearest[:, node, None] + nearest[node])
    for number, (a, b, length) in enumerate(edges):
        if length > nearest[a, b] * (1 + RELATIVE_ROUNDING):
            others, path = _shortest(len(nodes), edges, number)
            loop = "-".join(nodes[node] for node in [*path, a])
            raise InputError(
                f"{where}: the loop {_cut(loop)} cannot close: {nodes[a]}-{nodes[b]} is {length:g} long, the others "
                f"together {others:g}; correct a length"
            )


def _shortest(n: int, edges: Sequence[tuple[int, int, float]], without: int) -> tuple[float, list[int]]:
    """Return the shortest way (Dijkstra 1959) between an edge's ends that does not use it, and its nodes."""
    start, goal, _ = edges[without]
    neighbours: list[list[tuple[int, float]]] = [[] for _ in range(n)]
    for number, (a, b, length) in enumerate(edges):
        if number != without:
            neighbours[a].append((b, length))
            neighbours[b].append((a, length))
    best = {start: 0.0}
    before: dict[int, int] = {}
    queue = [(0.0, start)]
    while queue:
        distance, node = heapq.heappop(queue)
        if node == goal:
            break
        if distance > best[node]:
            continue
        for other, length in neighbours[node]:
            if distance + length < best.get(other, math.inf):
                best[other] = distance + length
                before[other] = node
                heapq.heappush(queue, (best[other], other))
    if goal not in best:
        return math.inf, []
    path = [goal]
    while path[-1] != start:
        path.append(before[path[-1]])
    return best[goal], path[::-1]


def check_constraints(
    where: str,
    nodes: Sequence[str],
    segments: Segments,
    lengths: Array,
    coplanar: Sequence[Sequence[int]],
    perpendicular: Sequence[tuple[int, int]],
    collinear: Sequence[tuple[int, int, int]],
) -> None:
    """Refuse constraints that say nothing, name a point twice, or contradict the lengths or each other."""
    for kind, groups, least in (("coplanar", coplanar, 4), ("collinear", collinear, 3)):
        for group in groups:
            if not all(0 <= node < len(nodes) for node in group):
                raise InputError(
                    f"{where}: {kind} {list(group)}: expected indices from 0 to {len(nodes) - 1}"
                )
            listed = ", ".join(nodes[node] for node in group)
            if len(set(group)) < len(group):
                raise InputError(f"{where}: {kind} {_cut(listed)}: a point is given twice; give each once")
            if len(group) < least:
                raise InputError(
                    f"{where}: {kind} {listed}: {len(group)} points always are; expected at least {least}"
                )
    names = [f"{nodes[a]}-{nodes[b]}" for a, b in segments]
    for first, second in perpendicular:
        if not (0 <= first < len(segments) and 0 <= second < len(segments)):
            raise InputError(
                f"{where}: perpendicular ({first}, {second}): expected indices from 0 to {len(segments) - 1}"
            )
        if first == second:
            raise InputError(
                f"{where}: perpendicular {names[first]}: a segment is not perpendicular to itself"
            )
        for triple in collinear:
            if {*segments[first], *segments[second]} <= set(triple):
                raise InputError(
                    f"{where}: {names[first]} and {names[second]} cannot be perpendicular and on one line, "
                    f"{', '.join(nodes[node] for node in triple)}; drop one of the two"
                )
    known = {frozenset(ends): length for ends, length in zip(segments, lengths.tolist(), strict=True)}
    for triple in collinear:
        a, b, c = triple
        sides = sorted(known.get(frozenset(pair), 0.0) for pair in ((a, b), (b, c), (a, c)))
        if sides[0] > 0 and abs(sides[0] + sides[1] - sides[2]) > 1e-6 * sides[2]:
            raise InputError(
                f"{where}: collinear {', '.join(nodes[node] for node in triple)}: their distances "
                f"{sides[0]:g}, {sides[1]:g} and {sides[2]:g} make a triangle; correct a length"
            )


def _listed(names: Sequence[str]) -> str:
    shortened = ", ".join(names[:6])
    return f"({shortened}{f' and {len(names) - 6} more' if len(names) > 6 else ''})"


def _cut(text: str) -> str:
    return text if len(text) <= 2 * 60 else text[: 2 * 60 - 1] + "…"
