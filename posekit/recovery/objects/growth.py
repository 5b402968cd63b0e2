"""The interpretation tree of any articulated object: every way to flip its segments, pruned by loops and shape."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from posekit.errors import refusal
from posekit.geometry import Array
from posekit.recovery.objects.family import LinkageFamily
from posekit.recovery.objects.linkage import read_nearer

EXACT: Final = (1e-6, 1e-9, 1e-6)
#: Allowed error of closing lengths, shortfall of segments and error of image points, in longest segments: rounding, and
#: points picked by hand.
MEASURED: Final = (0.01, 0.02, 0.01)

#: Residual of a minimum that leaves nothing: these alone are used where there are any.
CLOSED_RESIDUAL: Final = 1e-16

#: Largest number of postures of a level.
MAX_POSTURES: Final = 200_000


class Growth:
    """The interpretation tree of one frame at one scale.

    Nodes are placed breadth first from the first point that is seen; each branches toward the camera and away, except
    that a midpoint between two placed ends, and the end beyond a placed midpoint, are determined.
    """

    def __init__(self, family: LinkageFamily, nearer: Mapping[str, str]) -> None:
        self.family, self.linkage = family, family.linkage
        linkage = self.linkage
        self.hand = read_nearer(linkage, nearer)
        seen = np.isfinite(self.family.place[:, 0])
        middle = {node: tuple(a for a, m, _ in linkage.halves if m == node) for _, node, _ in linkage.halves}
        neighbours: dict[int, list[tuple[int, int, float]]] = {k: [] for k in range(len(linkage.nodes))}
        used = {node for ends in linkage.segments for node in ends}
        edges = [(a, b, k, 1.0) for k, (a, b) in enumerate(linkage.segments)]
        edges += [(end, node, whole, 0.5) for end, node, whole in linkage.halves if node in used]
        for a, b, k, share in edges:
            if seen[a] and seen[b]:
                neighbours[a].append((b, k, share))
                neighbours[b].append((a, k, share))
        nodes = [int(seen.argmax())]
        steps: list[tuple[int, int, int, float, int]] = []
        closed: set[int] = set()
        for node in nodes:  # grows while it is walked
            for other, k, share in neighbours[node]:
                if other in nodes:
                    continue
                opposite = next((end for end in middle.get(node, ()) if end != other and share < 1), -1)
                between = middle.get(other, (-1,)) if share < 1 else (-1,)
                if all(end in nodes for end in between):
                    steps.append((other, between[0], k, 0.5, between[1]))
                elif opposite in nodes:
                    steps.append((other, node, k, -1.0, opposite))
                    closed.add(k)
                else:
                    steps.append((other, node, k, share, -1))
                    closed |= {k} if share == 1 else set()
                nodes.append(other)
        lost = [linkage.nodes[k] for k in np.flatnonzero(seen) if k not in nodes and k < len(linkage.points)]
        if lost:
            got = f"{linkage.nodes[nodes[0]]} and {lost[0]} in parts that nothing seen joins"
            raise refusal(f"linkage {linkage.name}", "image", got, "one connected part", "add image points")
        self.nodes, self.steps = nodes, steps
        self.chords = [
            (k, pair)
            for k, pair in enumerate(linkage.segments)
            if k not in closed and set(pair) <= set(nodes)
        ]

    def best(
        self, scales: Array, given: tuple[float, float, float] | None, about: dict[str, Any]
    ) -> tuple[Array, Array, Array]:
        """Grow one frame exactly; as measured where nothing is left or nothing shows that it is exact."""
        linkage = self.linkage
        longest = float(linkage.lengths.max())
        exact, measured = ([part * longest for part in row] for row in (EXACT, MEASURED))
        ways = [("given", list(given))] if given is not None else [("exact", exact), ("measured", measured)]
        fitted = about["family"]["how"].split("+")
        evidence = len(self.chords) - (fitted == ["closure"] and len(self.chords) == 1)
        evidence += len(linkage.coplanar) * ("coplanar" not in fitted) + len(linkage.collinear)
        closed = any(one["residual"] <= CLOSED_RESIDUAL for one in about["family"].get("minima", ()))
        for judged, (rigid, tangent, point) in ways:
            beside = 0.0 if judged == "exact" else point
            parts = [self.grow(s, rigid, tangent, beside) for s in scales.tolist()]
            about["judged"] = "closed" if judged == "exact" and evidence <= 0 else judged
            if any(len(part[0]) for part in parts) and (evidence > 0 or closed):
                break
        rejected: Counter[str] = Counter()
        for part in parts:
            rejected.update(part[2])
        about["rejected"] = dict(rejected)
        points, flips = (np.concatenate([part[k] for part in parts]) for k in (0, 1))
        return points, flips, np.repeat(scales, [len(part[0]) for part in parts])

    def grow(
        self, s: float, rigid: float, tangent: float, beside: float
    ) -> tuple[Array, Array, Counter[str]]:
        """Return postures (N, P, 3), flips (N, S) and the rejected leaves by reason, at one scale."""
        linkage, place = self.linkage, self.family.place / s
        spread = self._spread(place, beside)
        postures = np.full((1, len(linkage.nodes), 3), np.nan)
        postures[0, self.nodes[0]] = [*place[self.nodes[0]], 0.0]
        branching = sum(other < 0 for *_, other in self.steps)
        lost: Counter[str] = Counter()
        placed = {self.nodes[0]}
        level = 1e-6 * float(linkage.lengths.max())
        for node, start, k, share, other in self.steps:
            new = np.empty((len(postures), 3))
            new[:, :2] = place[node]
            if other >= 0:
                turn = postures[:, [start, other], 2]
                new[:, 2] = turn.mean(axis=1) if share > 0 else 2 * turn[:, 0] - turn[:, 1]
                options = [new]
            else:
                branching -= 1
                length = share * float(linkage.lengths[k])
                apart = float(np.linalg.norm(place[node] - place[start]))
                if apart > length + tangent:
                    lost[f"length/{linkage.segment_names[k]}"] += len(postures) << (branching + 1)
                    return np.empty((0, len(linkage.points), 3)), np.empty((0, len(linkage.lengths))), lost
                depth = math.sqrt(max(length**2 - apart**2, 0.0))
                options = []
                for sign in (-1.0, 1.0) if depth > level else (1.0,):
                    one = new.copy()
                    one[:, 2] = postures[:, start, 2] + sign * depth
                    options.append(one)
                if len(options) == 1:
                    lost[f"level/{linkage.segment_names[k]}"] += len(postures) << branching
            postures = np.repeat(postures, len(options), axis=0)
            postures[:, node] = np.stack(options, axis=1).reshape(-1, 3)
            placed.add(node)
            for reason, bad in self._judge(postures, node, placed, rigid, spread):
                lost[reason] += int(bad.sum()) << branching
                postures = postures[~bad]
            if len(postures) > MAX_POSTURES:
                got = f"over {MAX_POSTURES} postures"
                raise refusal(f"linkage {linkage.name}", "image", got, "fewer", "say which ends are nearer")
        points = postures[:, : len(linkage.points)]
        flips = np.nan_to_num(np.where(self.family.seen, self.family.flips_of(np.nan_to_num(points)), 0))
        return points, flips, lost

    def _spread(self, place: Array, beside: float) -> dict[str, Any]:
        r"""Bound the error of depths where image points are off by p at most.

        A segment of length l that is seen e long has a depth between :math:`\sqrt{l^2 - (e + 2p)^2}` and
        :math:`\sqrt{l^2 - (e - 2p)^2}`, whichever way it is flipped: the depth between two points is off by no more
        than the sum over the segments between them.
        """
        paths: dict[int, frozenset[int]] = {self.nodes[0]: frozenset()}
        edges: dict[int, float] = {}
        for node, start, k, share, other in self.steps:
            length = abs(share) * float(self.linkage.lengths[k]) if other < 0 else 0.0
            apart = float(np.linalg.norm(place[node] - place[start]))
            least, depth, most = (
                math.sqrt(max(length**2 - max(apart + off, 0.0) ** 2, 0.0))
                for off in (2 * beside, 0.0, -2 * beside)
            )
            edges[node] = max(most - depth, depth - least) if other < 0 else 0.0
            paths[node] = paths[start] | {node}
        return {"paths": paths, "edges": edges, "beside": beside}

    def _judge(
        self, postures: Array, node: int, placed: set[int], rigid: float, spread: Mapping[str, Any]
    ) -> list[tuple[str, NDArray[np.bool_]]]:
        """Judge what is complete once `node` is placed; one reason kills a posture."""
        linkage, beside = self.linkage, spread["beside"]

        def between(a: int, b: int) -> float:
            return float(sum(spread["edges"][k] for k in spread["paths"][a] ^ spread["paths"][b]))

        found: list[tuple[str, NDArray[np.bool_]]] = []
        alive = np.ones(len(postures), dtype=np.bool_)

        def kill(reason: str, bad: NDArray[np.bool_]) -> None:
            found.append((reason, bad[alive]))
            alive[alive] = ~bad[alive]

        for k, (a, b) in self.chords:
            if node in (a, b) and {a, b} <= placed:
                apart = postures[:, b] - postures[:, a]
                flat, depth = np.hypot(apart[:, 0], apart[:, 1]), np.abs(apart[:, 2])
                off = between(a, b)
                far = np.hypot(flat + 2 * beside, depth + off)
                near = np.hypot(np.maximum(flat - 2 * beside, 0.0), np.maximum(depth - off, 0.0))
                length = float(linkage.lengths[k])
                kill(f"closure/{linkage.segment_names[k]}", (length < near - rigid) | (length > far + rigid))
        for k in np.flatnonzero(self.hand).tolist():
            a, b = linkage.segments[k]
            if node in (a, b) and {a, b} <= placed:
                depth = (postures[:, b, 2] - postures[:, a, 2]) * self.hand[k]
                chosen = len(spread["paths"][a] ^ spread["paths"][b]) == 1
                kill(
                    f"nearer/{linkage.segment_names[k]}", depth < -(1e-6 if chosen else 1e-6 + between(a, b))
                )
        groups = [("coplanar", group, 2) for group in linkage.coplanar]
        for kind, group, rank in (*groups, *(("collinear", group, 1) for group in linkage.collinear)):
            if node in group and set(group) <= placed:
                points = postures[:, list(group)]
                sizes = np.linalg.svd(points - points.mean(axis=1, keepdims=True), compute_uv=False)
                value = np.sqrt((sizes[:, rank:] ** 2).sum(axis=1) / len(group))
                shifts = [math.sqrt(float(np.mean([between(a, b) ** 2 for b in group]))) for a in group]
                names = "-".join(linkage.nodes[k] for k in group)
                kill(f"{kind}/{names}", value > rigid + beside + min(shifts))
        for first, second in linkage.perpendicular:
            (a, b), (c, d) = linkage.segments[first], linkage.segments[second]
            if node in (a, b, c, d) and {a, b, c, d} <= placed:
                one, two = postures[:, b] - postures[:, a], postures[:, d] - postures[:, c]
                longer = np.maximum(np.linalg.norm(one, axis=1), np.linalg.norm(two, axis=1))
                value = np.abs((one * two).sum(axis=1)) / longer
                names = f"{linkage.segment_names[first]}_{linkage.segment_names[second]}"
                kill(f"perpendicular/{names}", value > rigid + between(a, b) + between(c, d) + 4 * beside)
        return found
